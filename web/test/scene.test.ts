import { BufferAttribute, Matrix4, Vector3 } from 'three';
import { expect, test } from 'vitest';

import { Course } from '../src/race/course';
import { ReferenceLine } from '../src/race/line';
import { chance } from '../src/scene/chance';
import {
  Above,
  Chase,
  driverAngle,
  lookFromSeat,
  newLook,
  postsAlong,
  Trackside,
} from '../src/scene/eyes';
import { Facets } from '../src/scene/facets';
import { Guide } from '../src/scene/guide';
import { areaOf, areaWithin, bandBetween, leftOf } from '../src/scene/outline';
import { hide, writeUpright, writeWheel } from '../src/scene/placing';
import { QualityKeeper } from '../src/scene/quality';
import { kart, roundCourse } from './frames';

const square = [
  { x: 0, y: 0 },
  { x: 4, y: 0 },
  { x: 4, y: 4 },
  { x: 0, y: 4 },
];
const hole = square.map(({ x, y }) => ({ x: 1 + 0.25 * x, y: 1 + 0.25 * y }));

/** Where an instance puts a point. */
function moved(matrices: Float32Array, row: number, point: [number, number, number]): number[] {
  const matrix = new Matrix4().fromArray(matrices, 16 * row);
  return new Vector3(...point).applyMatrix4(matrix).toArray();
}

/** Area of a sheet [m²], all triangles counter-clockwise. */
function areaOfSheet({ points, triangles }: { points: number[]; triangles: number[] }): number {
  let area = 0;
  for (let i = 0; i < triangles.length; i += 3) {
    const corners = [0, 1, 2].map((step) => {
      const at = 2 * triangles[i + step]!;
      return { x: points[at]!, y: points[at + 1]! };
    });
    area += areaOf(corners);
  }
  return area;
}

test('an instance stands where its kart is, its nose along the heading', () => {
  const matrices = new Float32Array(32);
  writeUpright(matrices, 1, 5, 6, 0, Math.cos(Math.PI / 2), Math.sin(Math.PI / 2), 2, 1, 1);
  const nose = moved(matrices, 1, [0.5, 0, 0]);
  [5, 7, 0].forEach((wanted, axis) => expect(nose[axis]).toBeCloseTo(wanted));
  hide(matrices, 1);
  expect(moved(matrices, 1, [0.5, 0, 0])).toEqual([0, 0, 0]);
});

test('a wheel that has rolled a quarter turn has its foremost point on the ground', () => {
  const matrices = new Float32Array(16);
  writeWheel(matrices, 0, 1, 2, 0.3, 0, Math.PI / 2, 0.1);
  const foot = moved(matrices, 0, [1, 0, 0]);
  [1, 2, 0].forEach((wanted, axis) => expect(foot[axis]).toBeCloseTo(wanted));
});

test('a front wheel that steers left points left', () => {
  const matrices = new Float32Array(16);
  writeWheel(matrices, 0, 0, 0, 1, Math.PI / 6, 0, 1);
  const front = moved(matrices, 0, [1, 0, 0]);
  expect(front[0]).toBeCloseTo(Math.cos(Math.PI / 6));
  expect(front[1]).toBeCloseTo(0.5);
});

test('the ground is the outer border without what lies inside of the inner one', () => {
  expect(areaOfSheet(areaWithin([hole, square]))).toBeCloseTo(16 - 1);
  expect(areaOfSheet(areaWithin([[...square].reverse(), hole]))).toBeCloseTo(15);
});

test('a road of 2 m along a centre line of 100 m has 200 m²', () => {
  const course = new Course(roundCourse());
  const band = bandBetween(course.edgeLine('left', 0, 1), course.edgeLine('right', 0, 1));
  expect(areaOfSheet(band)).toBeCloseTo(200, -0.5);
});

test('left of the course is the inside of a circle that is driven counter-clockwise', () => {
  const course = new Course(roundCourse());
  expect(leftOf(course, 0, { x: course.x(0) - 0.5, y: 0 })).toBeCloseTo(0.5);
});

test('a box has the sides that were asked for, their fronts outside', () => {
  const facets = new Facets();
  facets.box([0, 0, 1], [2, 4, 2], '#ffffff');
  const { position, normal } = facets.geometry().attributes as Record<string, BufferAttribute>;
  expect(position!.count).toBe(36);
  for (let i = 0; i < position!.count; i += 3) {
    const corner = new Vector3().fromBufferAttribute(position!, i).sub(new Vector3(0, 0, 1));
    expect(corner.dot(new Vector3().fromBufferAttribute(normal!, i))).toBeGreaterThan(0);
  }
});

test('numbers that look random are the same for the same seed', () => {
  const [one, other] = [chance(3), chance(3)];
  const numbers = Array.from({ length: 1000 }, () => one());
  expect(numbers).toEqual(Array.from({ length: 1000 }, () => other()));
  expect(numbers.reduce((sum, value) => sum + value, 0) / 1000).toBeCloseTo(0.5, 1);
});

test('the driver looks along the kart, from its seat', () => {
  const look = newLook();
  lookFromSeat(look, kart({ x: 10, heading: Math.PI / 2 }), 0.5, [0.5, 0, 1], 1);
  expect([look.x, look.y, look.z]).toEqual([expect.closeTo(10), expect.closeTo(1), 1]);
  expect([look.atX - look.x, look.atY - look.y]).toEqual([expect.closeTo(0), expect.closeTo(1)]);
  // 75° from side to side where the picture is as wide as high.
  expect((driverAngle(1.5) * 180) / Math.PI).toBeLessThan(75);
});

test('the camera behind a kart comes round with it', () => {
  const [chase, look] = [new Chase(), newLook()];
  chase.look(look, kart(), 2, 0.016);
  expect([look.x, look.y]).toEqual([expect.closeTo(-5.8), expect.closeTo(0)]);
  for (let i = 0; i < 200; i++) chase.look(look, kart({ heading: Math.PI / 2 }), 2, 0.016);
  expect([look.x, look.y]).toEqual([expect.closeTo(0, 1), expect.closeTo(-5.8, 1)]);
});

test('cameras beside the track stand beyond its borders, and the nearest one looks', () => {
  const course = new Course(roundCourse());
  const posts = postsAlong(course, 0.45);
  expect(posts.length).toBe(10);
  const radius = 100 / (2 * Math.PI);
  for (const { x, y } of posts) expect(Math.hypot(x, y)).toBeGreaterThan(radius + 1);
  const look = newLook();
  new Trackside(posts).look(look, kart({ x: radius, y: 0 }), 0.45);
  const nearest = Math.min(...posts.map(({ x, y }) => Math.hypot(x - radius, y)));
  expect(Math.hypot(look.x - radius, look.y)).toBeCloseTo(nearest);
});

test('a camera beside the track is kept until another is clearly nearer', () => {
  const posts = [
    { x: 0, y: 0, z: 1 },
    { x: 10, y: 0, z: 1 },
  ];
  const [camera, look] = [new Trackside(posts), newLook()];
  const seenFrom = (x: number): number => {
    camera.look(look, kart({ x, y: 3 }), 1);
    return look.x;
  };
  expect([4, 5.1, 5.6, 7, 4.9, 3].map(seenFrom)).toEqual([0, 0, 0, 10, 10, 0]);
});

const rectangle = new Float64Array([
  ...[-20, -9, 20, -9, 20, -9, 20, 9],
  ...[20, 9, -20, 9, -20, 9, -20, -9],
]);

test('from above the whole course is in the picture', () => {
  const course = new Course({ ...roundCourse(), borders: rectangle });
  const [above, look] = [new Above(), newLook()];
  above.look(look, course, null, 16 / 9);
  const away = Math.hypot(look.x, look.y, look.z);
  const ahead = new Vector3(-look.x, -look.y, -look.z).normalize();
  const right = ahead
    .clone()
    .cross(new Vector3(0, 0, 1))
    .normalize();
  const up = right.clone().cross(ahead);
  const tangent = Math.tan(0.5 * look.angle);
  for (const [x, y] of [
    [-20, -9],
    [20, -9],
    [20, 9],
    [-20, 9],
  ] as const) {
    const place = new Vector3(x, y, 0);
    const depth = away + place.dot(ahead);
    expect(Math.abs(place.dot(right)) / depth).toBeLessThan((tangent * 16) / 9);
    expect(Math.abs(place.dot(up)) / depth).toBeLessThan(tangent);
  }
});

test('the ideal line ahead is one part of the drawing, past the timing line too', () => {
  const count = 400;
  const angles = Array.from({ length: count }, (_, i) => (2 * Math.PI * i) / count);
  const line = new ReferenceLine({
    kind: 'line',
    spacing: 0.25,
    x: angles.map((angle) => 16 * Math.cos(angle)),
    y: angles.map((angle) => 16 * Math.sin(angle)),
    speed: angles.map(() => 5),
    time: angles.map((_, i) => i * 0.05),
    lapS: 20,
    note: '',
  });
  const guide = new Guide(line, 1);
  const { position } = guide.mesh.geometry.attributes;
  const shown = () => guide.mesh.geometry.drawRange;
  guide.showAhead(16, -0.1); // just before the timing line
  const { start, count: length } = shown();
  expect(start + length).toBeLessThanOrEqual(position!.count);
  expect(length / 6).toBe(64); // 32 m in pieces of half a metre
  guide.showAll();
  expect(shown()).toEqual({ start: 0, count: 6 * 200 });
});

test('pictures that come too slowly are made simpler, and never richer again', () => {
  const keeper = new QualityKeeper();
  const run = (ms: number): number => {
    for (let i = 0; i < 90; i++) keeper.note(ms);
    return keeper.level;
  };
  expect([16, 40, 40, 16, 16, 40, 40].map(run)).toEqual([0, 1, 2, 2, 2, 3, 3]);
});

test('a pause of the page does not count as a slow picture', () => {
  const keeper = new QualityKeeper();
  for (let i = 0; i < 90; i++) keeper.note(5000);
  expect(keeper.level).toBe(0);
  keeper.hold(1);
  for (let i = 0; i < 90; i++) keeper.note(100);
  expect(keeper.level).toBe(1);
});
