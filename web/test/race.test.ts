import { expect, test } from 'vitest';

import { ServerClock } from '../src/race/clock';
import { Race } from '../src/race/race.svelte';
import { clockText } from '../src/i18n/figures';
import { ownParking } from '../src/race/ownparking';
import { Ending, Phase, Status } from '../src/wire/tables';
import type { StandingsFrame } from '../src/wire/frames';
import { event, kart, roundCourse, snapshot, standing } from './frames';

function table(changes: Partial<StandingsFrame> = {}): StandingsFrame {
  return {
    kind: 'standings',
    epoch: 1,
    tick: 900,
    startTick: 60,
    phase: Phase.RUNNING,
    flag: 0,
    laps: 3,
    course: 'round',
    rows: [],
    ...changes,
  };
}

test('after a race the lobby is seen again, though nothing drives there', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900, phase: Phase.FINISHED }), 0);
  race.take(table({ phase: Phase.LOBBY }), 10);
  expect(race.headline?.phase).toBe(Phase.LOBBY);
  expect(race.kart(0)).toBeNull();
  race.take(snapshot({ epoch: 2, tick: 1, phase: Phase.COUNTDOWN }), 20);
  expect(race.headline?.phase).toBe(Phase.COUNTDOWN);
});

test('a snapshot that comes after the lobby of its race does not bring the race back', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900 }), 0);
  race.take(table({ phase: Phase.LOBBY }), 10);
  race.take(snapshot({ tick: 901 }), 20);
  expect(race.headline?.phase).toBe(Phase.LOBBY);
  race.take(table({ phase: Phase.RUNNING }), 30); // a server that goes on with that race
  race.take(snapshot({ tick: 902 }), 40);
  expect(race.headline?.phase).toBe(Phase.RUNNING);
});

test('events of a server that was started anew are told, though they count from one again', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900 }), 0);
  race.take({ kind: 'events', epoch: 1, events: [event({ sequence: 1, tick: 800 })] }, 0);
  race.take(snapshot({ tick: 5 }), 20);
  race.take({ kind: 'events', epoch: 1, events: [event({ sequence: 1, tick: 3 })] }, 30);
  expect(race.news.events.map(({ tick }) => tick)).toEqual([3]);
});

test('events are kept where a server takes up its race a few ticks earlier', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900 }), 0);
  race.take({ kind: 'events', epoch: 1, events: [event({ sequence: 1, tick: 800 })] }, 0);
  race.take(snapshot({ tick: 880 }), 20);
  expect(race.news.events).toHaveLength(1);
});

test('a race is over once its standings say so, though the last snapshot was of a race', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900 }), 0);
  race.take(table({ phase: Phase.FINISHED }), 10);
  expect(race.headline?.phase).toBe(Phase.FINISHED);
  race.take(snapshot({ epoch: 2, tick: 1 }), 1000);
  expect(race.headline?.phase).toBe(Phase.RUNNING);
});

test('a snapshot of another phase is read at once', () => {
  const race = new Race();
  race.take(snapshot({ tick: 900 }), 0);
  race.take(snapshot({ tick: 901, phase: Phase.FINISHED }), 10);
  expect(race.headline?.phase).toBe(Phase.FINISHED);
});

test('the clock of another server replaces the one before at once', () => {
  const clock = new ServerClock();
  clock.note(0, 2, 1_000_000);
  clock.note(0, 10, 90_000_000);
  expect(clock.serverMs(5)).toBe(90_000);
});

test('the time of a way that ended unseen is not known, and of any other is when it ended', () => {
  const race = new Race();
  race.take({ ...roundCourse(), line: new Float64Array() }, 0);
  const parking = { ending: Ending.WALL, slot: 0, way: 1, reversed: 0, moves: 0 };
  const rows = [0, 1].map((seat) => standing(seat, { status: Status.RETIRED, parking }));
  race.take(table({ rows, startTick: 60 }), 0);
  race.take(snapshot({ tick: 660, karts: [kart({ status: Status.RACING })] }), 10);
  const done = [0, 1].map((seat) => kart({ seat, status: Status.RETIRED }));
  race.take(snapshot({ tick: 5000, karts: done }), 20);
  expect(ownParking(race, 0)?.seconds).toBe(10);
  expect(ownParking(race, 1)?.seconds).toBeNaN();
  expect(clockText(NaN)).toBe('–');
});

test('karts can be parked in a car park, and on a track with slots', () => {
  const race = new Race();
  race.take(roundCourse(), 0);
  expect(race.hasSlots).toBe(false);
  race.take({ ...roundCourse(), slots: [{ x: 0, y: 0, heading: 0, length: 3, width: 2 }] }, 0);
  expect([race.hasSlots, race.isLot]).toEqual([true, false]);
});
