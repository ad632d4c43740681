import { expect, test } from 'vitest';

import { lapPlaces } from '../src/race/lapchart';
import { Response } from '../src/race/response';
import { tableOf } from '../src/race/table';
import type { StandingFrame, StandingsFrame } from '../src/wire/frames';
import { Phase } from '../src/wire/tables';
import { kart, snapshot, standing } from './frames';

function standings(rows: StandingFrame[]): StandingsFrame {
  const race = { epoch: 1, tick: 0, startTick: 0, phase: 2, flag: 0, laps: 3, course: 'oval' };
  return { kind: 'standings', ...race, rows };
}

test('the table is in the order of the server', () => {
  const rows = tableOf({
    snapshot: snapshot({ karts: [kart({ seat: 0, rank: 2 }), kart({ seat: 1, rank: 1 })] }),
    standings: standings([standing(0, { bestLapUs: 9 }), standing(1, { bestLapUs: 8 })]),
    paces: new Map(),
    ages: new Map(),
  });
  expect(rows.map((row) => row.seat)).toEqual([1, 0]);
  expect(rows.map((row) => row.isBest)).toEqual([true, false]);
});

test('after the finish a penalty changes the order, whatever the last snapshot said', () => {
  const rows = tableOf({
    snapshot: snapshot({ karts: [kart({ seat: 0, rank: 1 }), kart({ seat: 1, rank: 2 })] }),
    standings: {
      ...standings([standing(0, { rank: 2, status: 2 }), standing(1, { rank: 1, status: 2 })]),
      phase: Phase.FINISHED,
    },
    paces: new Map(),
    ages: new Map(),
  });
  expect(rows.map(({ seat, status }) => [seat, status])).toEqual([
    [1, 2],
    [0, 2],
  ]);
});

test('the gap of karts that are home is that of their times', () => {
  const rows = tableOf({
    snapshot: null,
    standings: standings([
      standing(0, { status: 2, raceTimeUs: 60_000_000 }),
      standing(1, { status: 2, raceTimeUs: 61_500_000 }),
    ]),
    paces: new Map(),
    ages: new Map(),
  });
  expect(rows[1]?.gapS).toBeCloseTo(1.5);
});

test('gaps are those of the server where it times them', () => {
  const lists = { sectorsUs: [], sectorMerits: [], miniMerits: [], stints: [] };
  const timing = { theoreticalUs: 0, gained: 0, ...lists };
  const rows = tableOf({
    snapshot: null,
    standings: standings([
      standing(0, { timing: { ...timing, intervalUs: 0, lapsDown: 0 } }),
      standing(1, { gapUs: 2_500_000, timing: { ...timing, intervalUs: 2_500_000, lapsDown: 0 } }),
      standing(2, { gapUs: 9_000_000, timing: { ...timing, intervalUs: 6_500_000, lapsDown: 1 } }),
    ]),
    paces: new Map(),
    ages: new Map(),
  });
  expect(rows.map((row) => row.gapS)).toEqual([NaN, 2.5, 9]);
  expect(rows.map((row) => row.intervalS)).toEqual([NaN, 2.5, 6.5]);
  expect(rows.map((row) => row.lapsBehind)).toEqual([0, 0, 1]);
});

test('places by lap follow from the times of the laps', () => {
  const places = lapPlaces([
    standing(0, { lapTimesUs: [10, 30] }),
    standing(1, { lapTimesUs: [20, 10] }),
    standing(2, { lapTimesUs: [15] }),
  ]);
  expect(places.map((row) => row.places)).toEqual([[1, 2], [3, 1], [2]]);
});

test('a response lasts from sending a control until the server has taken it', () => {
  const response = new Response();
  response.noteSent(1, 100);
  response.noteSent(2, 120);
  response.noteAcknowledged(2, 180);
  expect(response.ms).toBe(60);
  response.noteAcknowledged(1, 500); // older than what was acknowledged already
  expect(response.ms).toBe(60);
});

test('in a lobby the table stands in the order of the seats', () => {
  const rows = tableOf({
    snapshot: null,
    standings: standings([standing(1, { rank: 0 }), standing(0, { rank: 0 })]),
    paces: new Map(),
    ages: new Map(),
  });
  expect(rows.map((row) => row.seat)).toEqual([0, 1]);
});
