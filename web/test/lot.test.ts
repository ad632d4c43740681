// Car parks: the ways that are driven, the room that is left, the message of a round.

import { Builder } from 'flatbuffers';
import { expect, test } from 'vitest';

import { clearanceOf } from '../src/race/clearance';
import { Course } from '../src/race/course';
import { type OwnParking, comparedWithPlan } from '../src/race/ownparking';
import { Ways } from '../src/race/ways';
import { decode } from '../src/wire/decode';
import { Block } from '../src/wire/generated/spectate/block.js';
import { Goal } from '../src/wire/generated/spectate/goal.js';
import { Lot } from '../src/wire/generated/spectate/lot.js';
import { PlannedWay } from '../src/wire/generated/spectate/planned-way.js';
import { kart, roundCourse, snapshot } from './frames';

const BODY = { length: 2, width: 1, ahead: 0 };

/** An area of 20 m by 20 m around the origin. */
function yard(): Course {
  const [a, b] = [-10, 10];
  return new Course({
    ...roundCourse(),
    line: new Float64Array(),
    borders: new Float64Array([a, a, b, a, b, a, b, b, b, b, a, b, a, b, a, a]),
  });
}

function drive(ways: Ways, places: readonly (readonly [number, number])[]): void {
  places.forEach(([x, speed], tick) => ways.note(snapshot({ tick, karts: [kart({ x, speed })] }), 0));
}

test('a course without a line is a car park', () => {
  expect(yard().isLot).toBe(true);
  expect(new Course(roundCourse()).isLot).toBe(false);
});

test('a way has a point every 15 cm, and a dot where the direction changed', () => {
  const ways = new Ways();
  drive(ways, [
    [0, 1],
    [0.1, 1],
    [0.2, 1],
    [0.4, 0],
    [0.2, -1],
    [0, -1],
  ]);
  const way = ways.ways.get(0)!;
  expect(way.points.map(({ x }) => x)).toEqual([0, 0.2, 0.4, 0.2, 0]);
  expect(way.turns).toEqual([{ x: 0.2, y: 0 }]);
});

test('a vehicle that stands still has one point and no dot', () => {
  const ways = new Ways();
  drive(ways, [
    [0, 0.01],
    [0, -0.01],
    [0, 0.01],
  ]);
  expect(ways.ways.get(0)!.points).toHaveLength(1);
  expect(ways.ways.get(0)!.turns).toHaveLength(0);
});

test('the clearance is the distance of the body from the nearest wall', () => {
  const own = kart({ x: 7, y: 0 });
  expect(clearanceOf(own, snapshot({ karts: [own] }), BODY, yard(), null)).toBeCloseTo(2); // 10 - 7 - 1
});

test('blocks, other vehicles and people count as well, and a touch is 0', () => {
  const own = kart({ x: 0, y: 0 });
  const clearance = (changes: Parameters<typeof snapshot>[0], block?: number): number => {
    const at = { y: 0, heading: 0, length: 1, width: 1, kind: 2 };
    const blocks = block === undefined ? [] : [{ ...at, x: block }];
    const frame = snapshot({ karts: [own], ...changes });
    return clearanceOf(own, frame, BODY, yard(), { kind: 'lot', epoch: 1, goals: [], blocks, ways: [] });
  };
  expect(clearance({}, 4)).toBeCloseTo(2.5); // 4 - 1 - 0.5
  expect(clearance({ karts: [own, kart({ seat: 1, x: 0, y: 3 })] })).toBeCloseTo(2); // 3 - 0.5 - 0.5
  expect(clearance({ walkers: [{ x: 2, y: 0, radius: 0.25 }] })).toBeCloseTo(0.75);
  expect(clearance({}, 1.2)).toBe(0);
});

test('a round comes with its goals and its blocks', () => {
  const builder = new Builder();
  Lot.startGoalsVector(builder, 1);
  Goal.createGoal(builder, 1, 2, 0.5, 3, 2, -1, 7);
  const goals = builder.endVector();
  Lot.startBlocksVector(builder, 1);
  Block.createBlock(builder, 5, 6, 0, 1.5, 1, 4);
  const blocks = builder.endVector();
  const points = PlannedWay.createPointsVector(builder, [1, 2, 3, 4]);
  const way = PlannedWay.createPlannedWay(builder, 7, points);
  const ways = Lot.createWaysVector(builder, [way]);
  Lot.startLot(builder);
  Lot.addEpoch(builder, 3);
  Lot.addGoals(builder, goals);
  Lot.addBlocks(builder, blocks);
  Lot.addWays(builder, ways);
  builder.finish(Lot.endLot(builder), 'RLOT');
  const data = builder.asUint8Array();
  const frame = decode(data.slice().buffer);
  expect(frame).toEqual({
    kind: 'lot',
    epoch: 3,
    goals: [{ x: 1, y: 2, heading: 0.5, length: 3, width: 2, slot: -1, seat: 7 }],
    blocks: [{ x: 5, y: 6, heading: 0, length: 1.5, width: 1, kind: 4 }],
    ways: [{ seat: 7, points: [{ x: 1, y: 2 }, { x: 3, y: 4 }] }],
  });
});

test('a drive by hand is compared with the plan, whose changes of direction may be none', () => {
  const own = { seconds: 30, way: 24, moves: 2 } as OwnParking;
  const planned = { seconds: 20, way: 16, moves: 0 };
  expect(comparedWithPlan({ ...own, planned: null })).toEqual([]);
  expect(comparedWithPlan({ ...own, planned })).toEqual([
    { name: 'time', driven: 30, planned: 20, ratio: 1.5 },
    { name: 'way', driven: 24, planned: 16, ratio: 1.5 },
    { name: 'moves', driven: 2, planned: 0, ratio: NaN },
  ]);
});
