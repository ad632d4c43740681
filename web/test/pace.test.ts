import { expect, test } from 'vitest';

import { BINS, Pace, deltaTo, gapBetween } from '../src/race/pace';
import { kart } from './frames';

/** Returns a kart that drove so many ticks along a lap of 240 m at `speed` metres a tick. */
function driven(ticks: number, speed: number, from = 0): Pace {
  const pace = new Pace(240);
  for (let tick = 0; tick <= ticks; tick++) {
    const way = from + tick * speed;
    const laps = Math.max(Math.floor(way / 240), 0);
    pace.note(kart({ progress: ((way % 240) + 240) % 240, laps }), tick, tick < 30);
  }
  return pace;
}

test('a gap is the time since the leader was at the same place', () => {
  const leader = driven(300, 1);
  const other = driven(300, 0.5);
  // It is at 150 m after 300 ticks; the leader was there after 150.
  expect(gapBetween(leader, other, 300)).toBeCloseTo(150 / 60);
});

test('a place on the grid lies behind the timing line', () => {
  const pace = driven(5, 1, -10);
  expect(pace.distance).toBeCloseTo(-5);
  expect(driven(20, 1, -10).distance).toBeCloseTo(10);
});

test('a kart that comes to be watched in the second half of a lap is not on the grid', () => {
  const pace = new Pace(240);
  pace.note(kart({ progress: 200 }), 5000, false);
  expect(pace.distance).toBe(200);
});

test('the quickest whole lap is the best', () => {
  const pace = new Pace(240);
  let way = 0;
  for (let tick = 0; way < 740; tick++) {
    pace.note(kart({ progress: way % 240, laps: Math.floor(way / 240) }), tick, false);
    way += way >= 240 && way < 480 ? 2 : 1;
  }
  expect(pace.bestLap).toBe(1);
});

test('a delta is taken at the newest step of the lap', () => {
  const half = driven(122, 1, -2).trace(0);
  const quick = driven(300, 2, -2).trace(0);
  expect(deltaTo(quick, half)).toBeCloseTo(1, 1); // 120 m took 120 ticks and not 60
});

test('what was not seen is not known', () => {
  const trace = new Pace(240).trace(0);
  expect(trace.speeds).toHaveLength(BINS);
  expect(Number.isNaN(trace.seconds[10])).toBe(true);
});

test('of a long race this lap, the one before and the best are kept', () => {
  const pace = new Pace(240);
  let way = 0;
  for (let tick = 0; way < 20 * 240 + 60; tick++) {
    pace.note(kart({ progress: way % 240, laps: Math.floor(way / 240) }), tick, false);
    way += way >= 3 * 240 && way < 4 * 240 ? 2 : 1;
  }
  const known = (lap: number) => !Number.isNaN(pace.trace(lap).seconds[30]!);
  const laps = Array.from({ length: 21 }, (_, lap) => lap);
  expect(laps.filter(known)).toEqual([3, 19, 20]);
  expect(pace.bestLap).toBe(3);
});
