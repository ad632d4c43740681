// How near vehicles come to what stands around them: walls, blocks, other vehicles, people.

import type { KartFrame, LotFrame, Rectangle, SnapshotFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import type { Course, Point } from './course';
import type { KartBody } from './race.svelte';

/** Distances [m] of a vehicle to what is nearest: now, and the least so far. */
export interface Clearance {
  now: number;
  least: number;
}

type Side = [Point, Point];

/** Returns the corners of a rectangle, counter-clockwise. */
export function cornersOf({ x, y, heading, length, width }: Rectangle): Point[] {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  const signs = [
    [0.5, 0.5],
    [-0.5, 0.5],
    [-0.5, -0.5],
    [0.5, -0.5],
  ] as const;
  return signs.map(([along, across]) => ({
    x: x + along * length * cos - across * width * sin,
    y: y + along * length * sin + across * width * cos,
  }));
}

/** Returns the rectangle of a vehicle. */
export function rectangleOfKart(kart: KartFrame, body: KartBody): Rectangle {
  const { heading } = kart;
  return {
    x: kart.x + body.ahead * Math.cos(heading),
    y: kart.y + body.ahead * Math.sin(heading),
    heading,
    length: body.length,
    width: body.width,
  };
}

/** Returns the distance [m] of a vehicle to what is nearest, 0 where they touch. */
export function clearanceOf(
  own: KartFrame,
  frame: SnapshotFrame,
  body: KartBody,
  course: Course,
  lot: LotFrame | null,
): number {
  const drawn = frame.trailers.filter((trailer) => trailer.seat === own.seat);
  const boxes: Rectangle[] = [rectangleOfKart(own, body), ...drawn];
  return Math.min(...boxes.map((box) => clearanceOfBox(box, own, frame, body, course, lot)));
}

function clearanceOfBox(
  box: Rectangle,
  own: KartFrame,
  frame: SnapshotFrame,
  body: KartBody,
  course: Course,
  lot: LotFrame | null,
): number {
  const sides = sidesOf(box);
  const others = frame.karts.filter((kart) => kart.seat !== own.seat && kart.status !== Status.ABSENT);
  const far = frame.trailers.filter((trailer) => trailer.seat !== own.seat);
  const rectangles: Rectangle[] = [
    ...(lot?.blocks ?? []),
    ...others.map((kart) => rectangleOfKart(kart, body)),
    ...far,
  ];
  let least = Infinity;
  const meet = (far: readonly Side[]): void => {
    for (const side of sides) for (const other of far) least = Math.min(least, between(side, other));
  };
  meet(wallsOf(course));
  for (const rectangle of rectangles) {
    const reach = rectangle.length + rectangle.width + box.length + box.width;
    if (Math.hypot(rectangle.x - box.x, rectangle.y - box.y) - reach < least) meet(sidesOf(rectangle));
  }
  for (const { x, y, radius } of frame.walkers) {
    for (const side of sides) least = Math.min(least, Math.max(toSide({ x, y }, side) - radius, 0));
  }
  return least;
}

const WALLS = new WeakMap<Course, Side[]>();

function wallsOf(course: Course): Side[] {
  let walls = WALLS.get(course);
  if (!walls) {
    const { borders, obstacles } = course.frame;
    walls = Array.from({ length: borders.length / 4 }, (_, row): Side => {
      const at = 4 * row;
      return [
        { x: borders[at]!, y: borders[at + 1]! },
        { x: borders[at + 2]!, y: borders[at + 3]! },
      ];
    });
    for (let at = 0; at + 4 < obstacles.length; at += 5) {
      const [x, y, heading, length, width] = obstacles.slice(at, at + 5) as unknown as number[];
      const box = { x: x!, y: y!, heading: heading!, length: length!, width: width! };
      walls.push(...sidesOf(box));
    }
    WALLS.set(course, walls);
  }
  return walls;
}

function sidesOf(rectangle: Rectangle): Side[] {
  const corners = cornersOf(rectangle);
  return corners.map((corner, index): Side => [corner, corners[(index + 1) % 4]!]);
}

/** Returns the distance of two segments, 0 where they cross. */
function between(one: Side, other: Side): number {
  if (cross(one, other[0]) * cross(one, other[1]) < 0) {
    if (cross(other, one[0]) * cross(other, one[1]) < 0) return 0;
  }
  return Math.min(
    toSide(one[0], other),
    toSide(one[1], other),
    toSide(other[0], one),
    toSide(other[1], one),
  );
}

/** Returns twice the signed area of a segment and a point: which side of it the point is on. */
function cross([from, to]: Side, point: Point): number {
  return (to.x - from.x) * (point.y - from.y) - (to.y - from.y) * (point.x - from.x);
}

function toSide(point: Point, [from, to]: Side): number {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const square = dx * dx + dy * dy || 1;
  const along = ((point.x - from.x) * dx + (point.y - from.y) * dy) / square;
  const share = Math.min(Math.max(along, 0), 1);
  return Math.hypot(from.x + share * dx - point.x, from.y + share * dy - point.y);
}
