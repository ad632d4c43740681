import { expect, test } from 'vitest';

import { Perspective } from '../src/draw/perspective';
import { Camera } from '../src/draw/camera';
import { Course, loopsOf } from '../src/race/course';
import { ReferenceLine, referenceTrace } from '../src/race/line';
import { roundCourse } from './frames';

test('walls that meet are one way', () => {
  const loops = loopsOf(roundCourse().borders);
  expect(loops.map((loop) => loop.length)).toEqual([4, 3]);
});

test('progress beyond a lap is on the next one', () => {
  const course = new Course(roundCourse(100));
  expect(course.length).toBe(100);
  expect(course.sampleAt(103)).toBe(3);
  expect(course.sampleAt(-1)).toBe(99);
});

test('the left edge of a course driven counter-clockwise is the inner one', () => {
  const course = new Course(roundCourse(100));
  const edge = course.edge(0, 'left');
  expect(edge.x).toBeCloseTo(100 / (2 * Math.PI) - 1);
});

test('the reference lap is measured abreast of the centre line', () => {
  const course = new Course(roundCourse(100));
  const x = Array.from({ length: 100 }, (_, i) => course.x(i));
  const y = Array.from({ length: 100 }, (_, i) => course.y(i));
  const line = new ReferenceLine({
    kind: 'line',
    spacing: 1,
    x,
    y,
    speed: x.map(() => 10),
    time: x.map((_, i) => i / 10),
    lapS: 10,
    note: '',
  });
  const trace = referenceTrace(line, course, 50);
  expect(trace.seconds[25]).toBeCloseTo(5);
  expect(line.zones[0]).toBe('hold');
});

test('a point stays under the finger while one zooms', () => {
  const camera = new Camera();
  camera.fit(800, 400, { left: 0, right: 40, bottom: 0, top: 10 });
  const before = camera.toTrack({ x: 100, y: 50 });
  camera.zoom(3, { x: 100, y: 50 });
  expect(camera.toTrack({ x: 100, y: 50 }).x).toBeCloseTo(before.x);
  expect(camera.toPicture(before).y).toBeCloseTo(50);
});

test('what lies ahead is in the middle, what is near is low and large', () => {
  const view = new Perspective(0.1, 1);
  view.look(0, 0, 0, 800, 600);
  const [near, far] = [view.project(view.place(5, 0)), view.project(view.place(50, 0))];
  expect(near.x).toBe(400);
  expect(near.y).toBeGreaterThan(far.y);
  expect(far.y).toBeGreaterThan(view.horizon);
  expect(view.project(view.place(5, 1)).x).toBeLessThan(400); // to the left
});

test('a shape that reaches behind the eye is cut off, one behind it vanishes', () => {
  const view = new Perspective(1, 1);
  view.look(0, 0, 0, 800, 600);
  const reaching = [view.place(-5, -1), view.place(10, -1), view.place(10, 1), view.place(-5, 1)];
  expect(view.shape(reaching)).toHaveLength(4);
  expect(view.shape([view.place(-5, -1), view.place(-4, 1), view.place(-6, 0)])).toHaveLength(0);
});

test('a reference line whose last point is abreast of the timing line is measured alike', () => {
  const course = new Course(roundCourse(100));
  const index = (i: number) => (i + 1) % 100;
  const x = Array.from({ length: 100 }, (_, i) => course.x(index(i)));
  const y = Array.from({ length: 100 }, (_, i) => course.y(index(i)));
  const speed = x.map(() => 10);
  const time = x.map((_, i) => i / 10);
  const line = { kind: 'line' as const, spacing: 1, x, y, speed, time, lapS: 10, note: '' };
  const trace = referenceTrace(new ReferenceLine(line), course, 50);
  expect([trace.seconds[0], trace.seconds[10], trace.seconds[49]]).toEqual([
    0,
    expect.closeTo(2),
    expect.closeTo(9.8),
  ]);
});
