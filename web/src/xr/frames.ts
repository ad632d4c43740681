// Frames of a headset and of the track, as matrices: column by column, as WebGL reads them. Pure.
// Track: x east, y north, z up. Headset: x right, y up, z back, in metres of the room.

import type { Box, Point } from '../race/course';

export type Matrix = readonly number[]; // 16
export type Spot = readonly [x: number, y: number, z: number];

/** A pose on the track. */
export interface Pose {
  x: number; // [m]
  y: number;
  heading: number; // [rad]
}

/** Returns the product of two matrices: first `right`, then `left`. */
export function product(left: Matrix, right: Matrix): Matrix {
  const result = new Array<number>(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let each = 0; each < 4; each++) sum += left[row + 4 * each]! * right[each + 4 * column]!;
      result[row + 4 * column] = sum;
    }
  }
  return result;
}

export function apply(matrix: Matrix, [x, y, z]: Spot): Spot {
  const row = (each: number): number =>
    matrix[each]! * x + matrix[each + 4]! * y + matrix[each + 8]! * z + matrix[each + 12]!;
  return [row(0), row(1), row(2)];
}

/** Returns the matrix that turns the track about z, scales it, stands it upright and moves it. */
function upright(turn: number, scale: number, origin: Spot): Matrix {
  const [cos, sin] = [scale * Math.cos(turn), scale * Math.sin(turn)];
  // East is right, north is away (-z), up is y.
  return [cos, 0, -sin, 0, -sin, 0, -cos, 0, 0, scale, 0, 0, ...origin, 1];
}

export interface Table {
  size: number; // [m] of the longer side of the model
  height: number; // [m] of the table above the floor
  away: number; // [m] from the room's origin to the middle of the table
}

/** Returns where the track stands as a model on a table. */
export function onTable(box: Box, { size, height, away }: Table): Matrix {
  const [wide, deep] = [box.right - box.left, box.top - box.bottom];
  // Its longer side from left to right.
  const turn = deep > wide ? 0.5 * Math.PI : 0;
  const scale = size / Math.max(wide, deep);
  const middle: Matrix = [
    ...[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],
    ...[-0.5 * (box.left + box.right), -0.5 * (box.bottom + box.top), 0, 1],
  ];
  return product(upright(turn, scale, [0, height, -away]), middle);
}

// Two points touched may lie further from or nearer to each other than those of the track by this
// share, and by this length [m].
const MOST_STRETCH = 0.05;
const MOST_ERROR = 0.1;

/**
 * Returns where the track lies at true scale, from two of its points and where they were touched.
 * Null where the distances do not fit: one of them was not the point meant.
 */
export function byTwoPoints(track: [Point, Point], touched: [Spot, Spot]): Matrix | null {
  const [from, to] = track;
  const [start, end] = touched;
  const wanted = Math.hypot(to.x - from.x, to.y - from.y);
  const found = Math.hypot(end[0] - start[0], end[2] - start[2]);
  if (Math.abs(found - wanted) > Math.max(MOST_STRETCH * wanted, MOST_ERROR)) return null;
  // Seen from above with z back, angles go round the other way.
  const turn =
    Math.atan2(-(end[2] - start[2]), end[0] - start[0]) - Math.atan2(to.y - from.y, to.x - from.x);
  const middle = [0.5 * (from.x + to.x), 0.5 * (from.y + to.y), 0] as const;
  const turned = apply(upright(turn, 1, [0, 0, 0]), middle);
  const origin = [0, 1, 2].map((axis) => 0.5 * (start[axis]! + end[axis]!) - turned[axis]!);
  return upright(turn, 1, origin as unknown as Spot);
}

/**
 * Returns where the track lies for a driver: the room is the kart, its origin the driver's eye as
 * the headset was when the session began. eye: ahead, left and up of the kart's place [m].
 */
export function fromSeat({ x, y, heading }: Pose, eye: Spot): Matrix {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  // Ahead of the kart is -z, its left is -x.
  const turn = 0.5 * Math.PI - heading;
  const [ahead, left, up] = eye;
  const origin = [x + ahead * cos - left * sin, y + ahead * sin + left * cos, up] as const;
  const moved = apply(upright(turn, 1, [0, 0, 0]), origin);
  return upright(turn, 1, [-moved[0], -moved[1], -moved[2]]);
}
