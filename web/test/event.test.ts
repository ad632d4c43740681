import { expect, test } from 'vitest';

import { en } from '../src/i18n/en';
import { fr } from '../src/i18n/fr';
import { Course } from '../src/race/course';
import { Ghost, chosenGhost } from '../src/race/ghost';
import { Pace } from '../src/race/pace';
import { nowText, podiumOf, remarksOn, secondsLeft, turnsUntil } from '../src/race/programme';
import { EventPhase } from '../src/wire/tables';
import type { GhostFrame, ProgrammeFrame, TeamFrame } from '../src/wire/eventFrames';
import { kart, roundCourse } from './frames';

function team(changes: Partial<TeamFrame>): TeamFrame {
  return {
    ...{ name: '7 Anna', seat: 0, place: 0, points: 0, timeUs: 0, attemptsUs: [] },
    ...{ attemptsLeft: 2, deleted: [], remark: '', canChange: false },
    ...changes,
  };
}

function programme(changes: Partial<ProgrammeFrame> = {}): ProgrammeFrame {
  return {
    kind: 'programme',
    ...{ event: 'cup', title: 'Cup', stage: 'Trial', phase: EventPhase.ON_TRACK },
    now: { title: 'Trial: 7 Anna, attempt 1', teams: ['7 Anna'] },
    ...{ limitS: 300, untilMs: 0, driven: 0, drives: 4, hasPoints: false, attempts: 2 },
    coming: [
      { title: 'Trial: Bert, attempt 1', teams: ['Bert'] },
      { title: 'Trial: 7 Anna, attempt 2', teams: ['7 Anna'] },
    ],
    teams: [team({}), team({ name: 'Bert', seat: 1 })],
    protests: [],
    ...changes,
  };
}

/** A lap of 100 m in 10 s along the x axis. */
function lap(changes: Partial<GhostFrame> = {}): GhostFrame {
  const steps = Array.from({ length: 101 }, (_, i) => i);
  return {
    ...{ team: 'Bert', seat: 1, isBest: true, fromLights: false, timeUs: 10e6 },
    ...{ seconds: steps.map((i) => i / 10), x: steps, y: steps.map(() => 0), distance: steps },
    ...changes,
  };
}

/** A kart that drives laps of 100 m at 5 m/s from the timing line on, for some ticks. */
function driven(ticks: number): Pace {
  const pace = new Pace(100);
  pace.note(kart({ progress: 99.9 }), -1, true);
  for (let tick = 0; tick <= ticks; tick++) {
    const way = (tick / 60) * 5;
    pace.note(kart({ progress: way % 100, laps: Math.floor(way / 100) }), tick, false);
  }
  return pace;
}

test('a kart at half the speed is 4 s behind the ghost after 40 m', () => {
  const ghost = new Ghost(lap());
  const pace = driven(480); // 8 s, 40 m
  expect(ghost.deltaOf(pace, 480, 0)).toBeCloseTo(4);
  const shown = ghost.kartAt(480, pace, 0)!;
  expect([shown.x, shown.speed, shown.isGhost]).toEqual([
    expect.closeTo(80),
    expect.closeTo(10),
    true,
  ]);
});

test('a ghost begins each lap again, and is gone after its own', () => {
  const ghost = new Ghost(lap());
  const pace = driven(1320); // 22 s, 10 m into the second lap
  expect(ghost.kartAt(1320, pace, 0)?.x).toBeCloseTo(20);
  expect(new Ghost(lap({ fromLights: true })).kartAt(1320, pace, 0)).toBeNull();
});

test('sectors are compared with those of the ghost', () => {
  const course = new Course({ ...roundCourse(), sectors: [1, 0], gates: new Float64Array([0, 40]) });
  const deltas = new Ghost(lap()).sectorDeltas(course, 0, [5e6, 0]);
  expect(deltas).toEqual([expect.closeTo(1), undefined]);
});

test('without an own best lap the ghost is the best of all', () => {
  const [best, own] = [new Ghost(lap()), new Ghost(lap({ isBest: false }))];
  expect(chosenGhost([best, own], 'own')).toBe(own);
  expect(chosenGhost([best], 'own')).toBe(best);
  expect(chosenGhost([best, own], 'none')).toBeNull();
});

test('a driver is told after how many others it is called', () => {
  expect(turnsUntil(programme(), 0)).toBe(0);
  expect(turnsUntil(programme(), 1)).toBe(1);
  expect(turnsUntil(programme({ coming: [] }), 1)).toBe(-1);
});

test('an attempt is left its limit, a call the time until it ends', () => {
  const at = { serverMs: 5000, tick: 780, startTick: 180 };
  expect(secondsLeft(programme(), at)).toBe(290);
  expect(secondsLeft(programme({ phase: EventPhase.CALLED, untilMs: 25_000 }), at)).toBe(20);
  expect(secondsLeft(programme({ limitS: 0 }), at)).toBeNaN();
});

test('what is on, and why a lap does not count, is told in the language of the reader', () => {
  expect(nowText(programme(), en)).toBe('Trial, attempt 1 of 2');
  // It is over: its time is among those of the team already.
  const over = programme({ teams: [team({ attemptsUs: [9e6] })] });
  expect(nowText(over, en)).toBe('Trial, attempt 1 of 2');
  const why = 'touched a border, left out gate 3';
  const anna = team({ deleted: [{ attempt: 1, lap: 2, why }], remark: '' });
  expect(remarksOn(anna, en)).toBe('A1 lap 2 deleted: touched a border, left out gate 3');
  expect(remarksOn(anna, fr)).toBe('E1 tour 2 annulé : bordure touchée, porte 3 manquée');
});

test('the podium is shown once all is driven', () => {
  const teams = [1, 2, 3, 4, 0].map((place) => team({ name: `${place}`, place }));
  expect(podiumOf(programme({ teams }))).toEqual([]);
  expect(podiumOf(programme({ teams, driven: 4 })).map(({ place }) => place)).toEqual([1, 2, 3]);
});

test('titles and remarks of the server are said in French as on its sheets, and names stay', () => {
  const { remark, heading } = fr.event;
  expect(heading('Heat 2, round 1, track B')).toBe('Manche 2, tour 1, piste B');
  expect(heading('Time trial: Race Final, attempt 2')).toBe('Contre-la-montre: Race Final, essai 2');
  expect(remark('2 m the wrong way, lap 3; +5 s protest 1')).toBe(
    '2 m à contresens, tour 3; +5 s réclamation 1',
  );
  expect(remark('did not start: not there 30 s after the call')).toBe(
    "non partant : absent 30 s après l'appel",
  );
  expect(['open', 'upheld, +60 s', 'disqualified'].map(remark)).toEqual([
    ...['en attente', 'acceptée, +60 s', 'disqualification'],
  ]);
  expect(en.event.heading('Heat 2')).toBe('Heat 2');
});
