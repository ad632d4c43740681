// The walls of a course in the driver's view.

import { wrap } from '../race/buffer';
import type { Course, Point } from '../race/course';
import { type Perspective, type Place, fillShape } from './perspective';
import type { Solid } from './solids';

export interface Wall {
  from: Point;
  to: Point;
  shade: number; // 0 or 1: two tones in turn, which show the speed
}

// Pieces of a wall that turn less than this in all are one [rad].
const MOST_TURN = 0.14;

/** Returns the walls of a course in pieces of at most `piece` metres. */
export function wallsOf(course: Course, piece: number): Wall[] {
  const walls: Wall[] = [];
  for (const loop of course.loops) {
    let travelled = 0;
    for (const [start, end] of chordsOf(loop, piece)) {
      const length = Math.hypot(end.x - start.x, end.y - start.y);
      const parts = Math.max(Math.ceil(length / piece), 1);
      for (let part = 0; part < parts; part++) {
        const middle = travelled + ((part + 0.5) / parts) * length;
        walls.push({
          from: pointBetween(start, end, part / parts),
          to: pointBetween(start, end, (part + 1) / parts),
          shade: Math.floor(middle / piece) % 2,
        });
      }
      travelled += length;
    }
  }
  return walls;
}

/** Returns a path in fewer, longer steps where it is nearly straight. */
function chordsOf(loop: readonly Point[], piece: number): [Point, Point][] {
  const chords: [Point, Point][] = [];
  let start = loop[0];
  for (let i = 1; start && i < loop.length; i++) {
    const [end, next] = [loop[i]!, loop[i + 1]];
    const goesOn =
      next &&
      Math.hypot(next.x - start.x, next.y - start.y) < piece &&
      Math.abs(turnBetween(start, end, next)) < MOST_TURN;
    if (goesOn) continue;
    chords.push([start, end]);
    start = end;
  }
  return chords;
}

function turnBetween(start: Point, middle: Point, end: Point): number {
  const before = Math.atan2(middle.y - start.y, middle.x - start.x);
  return wrap(Math.atan2(end.y - middle.y, end.x - middle.x) - before);
}

/** Returns the walls near enough to be seen. own: where the eye is. */
export function wallSolids(
  walls: readonly Wall[],
  own: Point,
  view: Perspective,
  height: number,
  reach: number,
): Solid[] {
  const solids: Solid[] = [];
  const square = reach ** 2;
  for (const { from, to, shade } of walls) {
    if ((from.x - own.x) ** 2 + (from.y - own.y) ** 2 > square) continue;
    const start = view.place(from.x, from.y);
    const end = view.place(to.x, to.y);
    const distance = 0.5 * (Math.hypot(start.ahead, start.left) + Math.hypot(end.ahead, end.left));
    if (distance > reach || Math.max(start.ahead, end.ahead) < view.near) continue;
    solids.push({
      distance,
      draw: (context) => drawWall(context, view, [start, end], height, shade, distance / reach),
    });
  }
  return solids;
}

function drawWall(
  context: CanvasRenderingContext2D,
  view: Perspective,
  [start, end]: [Place, Place],
  height: number,
  shade: number,
  far: number,
): void {
  const side = view.shape([start, end, { ...end, up: height }, { ...start, up: height }]);
  const [face, top] = wallColours(shade, far);
  context.fillStyle = face;
  fillShape(context, side);
  if (far > PLAIN_FAR) return;
  // Closes the seam to the next piece.
  context.strokeStyle = face;
  context.lineWidth = 0.8;
  context.stroke();
  const rim = 0.86 * height;
  const band = view.shape([
    { ...start, up: rim },
    { ...end, up: rim },
    { ...end, up: height },
    { ...start, up: height },
  ]);
  context.fillStyle = top;
  fillShape(context, band);
}

const FAR_STEPS = 24;
// Beyond this share of the reach a rim would be thinner than a pixel.
const PLAIN_FAR = 0.6;
// Cached by distance and tone: building these strings for each wall would cost more than drawing.
const WALL_COLOURS = [0, 1].map((shade) =>
  Array.from({ length: FAR_STEPS + 1 }, (_, step): [string, string] => {
    const far = step / FAR_STEPS;
    const face = `hsl(212 14% ${(shade ? 64 : 54) - 26 * far}%)`;
    return [face, shade ? `hsl(8 70% ${56 - 20 * far}%)` : `hsl(210 20% ${90 - 36 * far}%)`];
  }),
);

function wallColours(shade: number, far: number): [string, string] {
  return WALL_COLOURS[shade]![Math.min(Math.floor(far * FAR_STEPS), FAR_STEPS)]!;
}

function pointBetween(from: Point, to: Point, share: number): Point {
  return { x: from.x + share * (to.x - from.x), y: from.y + share * (to.y - from.y) };
}
