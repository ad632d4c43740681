// Trailers: angles at hitches, the point of no return, where the wheels lead.

import { expect, test } from 'vitest';

import { type Rig, hitchAngles, noReturn, predict, rigOf } from '../src/race/rig';
import type { TrailerFrame } from '../src/wire/frames';
import { kart } from './frames';

/** Full lock is a circle of 5 m; the hitch is on the rear axle, the bar 4 m long. */
const RIG: Rig = {
  rearAxle: 0,
  wheelbase: 2,
  lock: Math.atan(2 / 5),
  hitches: [{ offset: 0, bar: 4 }],
};

function trailer(changes: Partial<TrailerFrame> = {}): TrailerFrame {
  return { x: -4, y: 0, heading: 0, length: 6, width: 2, limit: 1.2, seat: 0, ...changes };
}

test('a rule book without trailers describes no rig, one with a trailer does', () => {
  const values = new Map([
    ['front_axle', '1.5'],
    ['rear_axle', '0.5'],
    ['steering_limit', '0.4'],
  ]);
  expect(rigOf(values)).toBeNull();
  values.set('trailers.0.bar', '7.7').set('trailers.0.hitch', '-0.6');
  expect(rigOf(values)).toEqual({
    rearAxle: 0.5,
    wheelbase: 2,
    lock: 0.4,
    hitches: [{ offset: -0.6, bar: 7.7 }],
  });
});

test('the angle at a hitch is positive where what draws points left of what is drawn', () => {
  const trailers = [trailer({ heading: -0.3 }), trailer({ heading: 0.1 }), trailer({ seat: 1 })];
  expect(hitchAngles(kart(), trailers)).toEqual([0.3, expect.closeTo(-0.4)]);
});

test('beyond the point of no return the sine is the bar over the radius of full lock', () => {
  expect(Math.sin(noReturn(RIG))).toBeCloseTo(4 / 5);
  const offset = { ...RIG, hitches: [{ offset: 1, bar: 4 }] };
  const angle = noReturn(offset);
  expect(Math.sin(angle)).toBeCloseTo((4 + Math.cos(angle)) / 5);
  expect(noReturn({ ...RIG, hitches: [{ offset: 0, bar: 6 }] })).toBe(Infinity);
});

test('a car with a caravan has no way back in reverse from 73.9°', () => {
  const caravan = { rearAxle: 1, wheelbase: 2.8, lock: 0.6, hitches: [{ offset: 1.2, bar: 3.6 }] };
  expect((noReturn(caravan) * 180) / Math.PI).toBeCloseTo(73.9, 1);
});

test('straight ahead both axles follow a line', () => {
  const { paths, isKnife } = predict(RIG, kart(), [trailer()], 1);
  expect(isKnife).toBe(false);
  expect(paths[0]!.at(-1)).toEqual({ x: expect.closeTo(12), y: 0 });
  expect(paths[1]!.at(-1)).toEqual({ x: expect.closeTo(8), y: 0 });
});

test('on a straight way back the tangent of half the angle grows by e on each bar', () => {
  const bent = trailer({ heading: -0.02, limit: 3 });
  const { paths } = predict(RIG, kart(), [bent], -1);
  const [axle, drawn] = [paths[0]!.at(-1)!, paths[1]!.at(-1)!];
  const angle = Math.atan2(-(axle.y - drawn.y), axle.x - drawn.x);
  expect(Math.tan(angle / 2)).toBeCloseTo(Math.tan(0.01) * Math.exp(12 / 4), 3);
});

test('on the circle of full lock the angle settles where its sine is the bar over the radius', () => {
  const { paths } = predict(RIG, kart({ steering: RIG.lock }), [trailer()], 1);
  const middle = { x: 0, y: 5 };
  for (const { x, y } of paths[0]!) expect(Math.hypot(x - middle.x, y - middle.y)).toBeCloseTo(5, 2);
});

test('a prediction ends where the hitch is at its limit', () => {
  const { paths, isKnife } = predict(RIG, kart({ steering: -0.3 }), [trailer({ heading: -0.5 })], -1);
  expect(isKnife).toBe(true);
  expect(paths[0]!.length).toBeLessThan(121);
});
