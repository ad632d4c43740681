// Messages of where a race is driven and by which rules, from bytes to plain data.

import type { ByteBuffer } from 'flatbuffers';

import type { Frame, Rectangle } from './frames';
import { NOTHING, rowsOf } from './rows';
import { Course, Line, Lot, Rules } from './tables';

export function readCourse(buffer: ByteBuffer): Frame {
  const table = Course.getRootAsCourse(buffer);
  return {
    kind: 'course',
    name: table.name() ?? '',
    title: table.title() ?? '',
    spacing: table.spacing(),
    line: table.lineArray() ?? NOTHING,
    halfWidths: table.halfWidthsArray() ?? NOTHING,
    kerb: table.kerb(),
    grass: table.grass(),
    borders: table.bordersArray() ?? NOTHING,
    gates: table.gatesArray() ?? NOTHING,
    sectors: Array.from(table.sectorsArray() ?? []),
    grid: table.gridArray() ?? NOTHING,
    boxes: table.boxesArray() ?? NOTHING,
    obstacles: table.obstaclesArray() ?? NOTHING,
    kartLength: table.kartLength(),
    kartWidth: table.kartWidth(),
    kartAhead: table.kartAhead(),
    slots: rectanglesIn(table.slotsArray() ?? NOTHING),
  };
}

/** Returns rectangles from rows of five numbers. */
function rectanglesIn(all: ArrayLike<number>): Rectangle[] {
  return rowsOf(Math.floor(all.length / 5), (row) => {
    const [x, y, heading, length, width] = [0, 1, 2, 3, 4].map((part) => all[5 * row + part]!);
    return { x: x!, y: y!, heading: heading!, length: length!, width: width! };
  });
}

export function readLot(buffer: ByteBuffer): Frame {
  const table = Lot.getRootAsLot(buffer);
  return {
    kind: 'lot',
    epoch: table.epoch(),
    goals: rowsOf(table.goalsLength(), (row) => {
      const goal = table.goals(row)!;
      return { ...rectangleOf(goal), seat: goal.seat(), slot: goal.slot() };
    }),
    blocks: rowsOf(table.blocksLength(), (row) => {
      const block = table.blocks(row)!;
      return { ...rectangleOf(block), kind: block.kind() };
    }),
    ways: rowsOf(table.waysLength(), (row) => {
      const way = table.ways(row)!;
      return { seat: way.seat(), points: pointsIn(way.pointsArray() ?? NOTHING) };
    }),
  };
}

/** Returns points from rows of two numbers. */
function pointsIn(all: ArrayLike<number>): { x: number; y: number }[] {
  return rowsOf(Math.floor(all.length / 2), (row) => ({ x: all[2 * row]!, y: all[2 * row + 1]! }));
}

interface Rectangular {
  x(): number;
  y(): number;
  heading(): number;
  length(): number;
  width(): number;
}

function rectangleOf(one: Rectangular): Rectangle {
  return {
    x: one.x(),
    y: one.y(),
    heading: one.heading(),
    length: one.length(),
    width: one.width(),
  };
}

export function readRules(buffer: ByteBuffer): Frame {
  const table = Rules.getRootAsRules(buffer);
  const count = Math.min(table.namesLength(), table.valuesLength());
  const pairs = rowsOf(count, (row): [string, string] => [table.names(row), table.values(row)]);
  return {
    kind: 'rules',
    values: new Map(pairs),
    items: rowsOf(table.itemsLength(), (row) => table.items(row)),
  };
}

export function readLine(buffer: ByteBuffer): Frame {
  const table = Line.getRootAsLine(buffer);
  return {
    kind: 'line',
    spacing: table.spacing(),
    x: table.xArray() ?? NOTHING,
    y: table.yArray() ?? NOTHING,
    speed: table.speedArray() ?? NOTHING,
    time: table.timeArray() ?? NOTHING,
    lapS: table.lap(),
    note: table.note() ?? '',
  };
}
