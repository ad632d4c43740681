import { expect, test } from 'vitest';

import { lapPlaces } from '../src/race/lapchart';
import { Response } from '../src/race/response';
import { Sectors } from '../src/race/sectors';
import { Stints } from '../src/race/stints';
import { tableOf } from '../src/race/table';
import { EventKind } from '../src/wire/tables';
import type { StandingFrame, StandingsFrame } from '../src/wire/frames';
import { event, kart, snapshot } from './frames';

function standing(seat: number, changes: Partial<StandingFrame> = {}): StandingFrame {
  return {
    driver: `driver ${seat}`,
    seat,
    rank: seat + 1,
    laps: 0,
    status: 1,
    lastLapUs: 0,
    bestLapUs: 0,
    raceTimeUs: 0,
    gapUs: 0,
    penalties: 0,
    penaltyUs: 0,
    itemsUsed: 0,
    lapTimesUs: [],
    parking: null,
    planned: null,
    timing: null,
    ...changes,
  };
}

function standings(rows: StandingFrame[]): StandingsFrame {
  const race = { epoch: 1, tick: 0, startTick: 0, phase: 2, flag: 0, laps: 3, course: 'oval' };
  return { kind: 'standings', ...race, rows };
}

function sector(seat: number, number: number, us: number) {
  return event({ kind: EventKind.SECTOR, kart: seat, other: number, value: us });
}

test('a sector is purple, green or yellow', () => {
  const sectors = new Sectors();
  sectors.note(sector(0, 1, 5000));
  sectors.note(sector(1, 1, 6000));
  expect(sectors.of(0)[0]?.merit).toBe('best');
  expect(sectors.of(1)[0]?.merit).toBe('own');
  sectors.note(sector(1, 1, 7000));
  expect(sectors.of(1)[0]?.merit).toBe('none');
});

test('the table is in the order of the server', () => {
  const rows = tableOf({
    snapshot: snapshot({ karts: [kart({ seat: 0, rank: 2 }), kart({ seat: 1, rank: 1 })] }),
    standings: standings([standing(0, { bestLapUs: 9 }), standing(1, { bestLapUs: 8 })]),
    paces: new Map(),
    sectors: new Sectors(),
    ages: new Map(),
  });
  expect(rows.map((row) => row.seat)).toEqual([1, 0]);
  expect(rows.map((row) => row.isBest)).toEqual([true, false]);
});

test('the gap of karts that are home is that of their times', () => {
  const rows = tableOf({
    snapshot: null,
    standings: standings([
      standing(0, { status: 2, raceTimeUs: 60_000_000 }),
      standing(1, { status: 2, raceTimeUs: 61_500_000 }),
    ]),
    paces: new Map(),
    sectors: new Sectors(),
    ages: new Map(),
  });
  expect(rows[1]?.gapS).toBeCloseTo(1.5);
});

test('gaps are those of the server where it times them', () => {
  const timing = { theoreticalUs: 0, gained: 0, miniMerits: [] };
  const rows = tableOf({
    snapshot: null,
    standings: standings([
      standing(0, { timing: { ...timing, intervalUs: 0, lapsDown: 0 } }),
      standing(1, { gapUs: 2_500_000, timing: { ...timing, intervalUs: 2_500_000, lapsDown: 0 } }),
      standing(2, { gapUs: 9_000_000, timing: { ...timing, intervalUs: 6_500_000, lapsDown: 1 } }),
    ]),
    paces: new Map(),
    sectors: new Sectors(),
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
    sectors: new Sectors(),
    ages: new Map(),
  });
  expect(rows.map((row) => row.seat)).toEqual([0, 1]);
});

test('a stint ends where a kart is rescued, and says what it used', () => {
  const lap = (other: number, value: number) => event({ kind: EventKind.LAP, kart: 3, other, value });
  const use = event({ kind: EventKind.USE, kart: 3 });
  const events = [
    ...[lap(1, 9e6), use, lap(2, 8e6), event({ kind: EventKind.USE, kart: 4 })],
    ...[event({ kind: EventKind.STUCK, kart: 3 }), event({ kind: EventKind.RESCUED, kart: 3 })],
    ...[lap(3, 12e6), use, use],
  ];
  const stints = new Stints();
  for (const one of events) stints.note(one);
  expect(stints.of(3)).toEqual([
    { from: 1, laps: 2, bestUs: 8e6, items: 1 },
    { from: 3, laps: 1, bestUs: 12e6, items: 2 },
  ]);
  expect(stints.of(4)).toEqual([{ from: 1, laps: 0, bestUs: 0, items: 1 }]);
});
