import { readFileSync } from 'node:fs';

import { expect, test } from 'vitest';

import { allowedSpeed, help, LEVELS, type Situation } from '../src/input/assistance';
import { ReferenceLine } from '../src/race/line';
import { kart, snapshot } from './frames';

// A metre between samples to the east: 10 m/s for 50 m, then a bend of 4 m/s.
const samples = Array.from({ length: 100 }, (_, index) => index);
const line = new ReferenceLine({
  kind: 'line',
  spacing: 1,
  x: samples,
  y: samples.map(() => 0),
  speed: samples.map((index) => (index < 50 ? 10 : 4)),
  time: samples,
  lapS: 100,
  note: '',
});
const rolling = { steering: 0.3, throttle: 0, brake: 0, buttons: 0 };
const flatOut = { ...rolling, throttle: 1 };

function at(x: number, speed: number, changes: Partial<Situation> = {}): Situation {
  return { own: kart({ x, speed }), frame: snapshot(), flag: 0, line, ...changes };
}

test('with the line alone the driver does everything', () => {
  for (const level of ['none', 'line'] as const) {
    expect(help(level, flatOut, at(60, 9))).toEqual({ wheel: flatOut, does: null });
  }
});

test('a driver is left all of the line on a straight and less of it in a bend', () => {
  expect(allowedSpeed(line, 10, 10)).toBe(10);
  expect(allowedSpeed(line, 60, 3)).toBeCloseTo(0.85 * 4);
  expect(allowedSpeed(line, 49, 10)).toBeCloseTo(0.85 * 4); // two metres later it is a bend
});

test('the kart brakes by itself where its driver is too fast, and only there', () => {
  const { wheel, does } = help('brakes', flatOut, at(60, 9));
  expect([wheel.throttle, wheel.brake, wheel.steering, does]).toEqual([0, 1, 0.3, 'brake']);
  expect(help('brakes', flatOut, at(10, 9))).toEqual({ wheel: flatOut, does: null });
  expect(help('brakes', rolling, at(10, 5))).toEqual({ wheel: rolling, does: null });
});

test('with both pedals it accelerates by itself, up to the speed of the line', () => {
  const { wheel, does } = help('pedals', rolling, at(10, 5));
  expect([wheel.throttle, wheel.steering, does]).toEqual([1, 0.3, 'accelerate']);
  expect(help('pedals', rolling, at(10, 9.5)).wheel.throttle).toBeCloseTo(0.5);
});

test('the foot of the driver on the brake counts', () => {
  const braking = { ...rolling, brake: 0.6 };
  expect(help('pedals', braking, at(10, 5))).toEqual({ wheel: braking, does: null });
  expect(help('pedals', braking, at(60, 3.41)).wheel.brake).toBe(0.6);
});

test('a cap such as that of a yellow flag is kept', () => {
  const own = kart({ x: 10, speed: 5, speedCap: 4 });
  expect(help('pedals', rolling, at(10, 5, { own })).does).toBe('brake');
});

test('nobody is helped before the lights, under red, turned round, in reverse, without a line', () => {
  const reversing = { ...rolling, throttle: -0.6 };
  expect(help('pedals', rolling, at(10, 0, { frame: snapshot({ lights: 2 }) })).does).toBeNull();
  expect(help('pedals', rolling, at(10, 0, { flag: 2 })).does).toBeNull();
  const turned = kart({ x: 10, speed: 0, heading: Math.PI });
  expect(help('pedals', rolling, at(10, 0, { own: turned })).does).toBeNull();
  expect(help('pedals', reversing, at(10, 0)).wheel).toBe(reversing);
  expect(help('pedals', rolling, at(10, 5, { line: null })).does).toBeNull();
});

test('ten thousand situations have the answers that a real kart gives', () => {
  const path = new URL('../../tests/shared/assistance.json', import.meta.url);
  const shared = JSON.parse(readFileSync(path, 'utf8')) as Shared;
  const { spacing, x, y, speed } = shared.line;
  const time = x.map(() => 0);
  const own = new ReferenceLine({ kind: 'line', spacing, x, y, speed, time, lapS: 1, note: '' });
  const answers = shared.rows.map((row) => {
    const [level, throttle, brake, x, y, heading, speed, speedCap] = row;
    const [phase, lights, status, flags, flag] = row.slice(8) as [
      number, number, number, number, number,
    ];
    const { wheel, does } = help(LEVELS[level!]!, { ...rolling, throttle: throttle!, brake: brake! }, {
      own: kart({ x: x!, y: y!, heading: heading!, speed: speed!, speedCap: speedCap!, status, flags }),
      frame: snapshot({ phase, lights }),
      flag,
      line: own,
    });
    return [wheel.throttle, wheel.brake, does ?? ''];
  });
  expect(answers).toEqual(shared.answers);
});

interface Shared {
  line: { spacing: number; x: number[]; y: number[]; speed: number[] };
  rows: number[][];
  answers: [number, number, string][];
}
