// Shapes on the ground, as plain numbers: bands along the course, and filled borders.

import { ShapeUtils, Vector2 } from 'three';

import type { Course, Point } from '../race/course';

/** A flat surface: corners as x, y, and three indices for each triangle. */
export interface Sheet {
  points: number[];
  triangles: number[];
}

/** Returns the band between two lines of the same number of points, each closed. */
export function bandBetween(left: readonly Point[], right: readonly Point[]): Sheet {
  const points = left.flatMap((point, index) => [
    point.x,
    point.y,
    right[index]!.x,
    right[index]!.y,
  ]);
  const triangles: number[] = [];
  const count = left.length;
  for (let i = 0; i < count; i++) {
    const [l, r] = [2 * i, 2 * i + 1];
    const [nl, nr] = [2 * ((i + 1) % count), 2 * ((i + 1) % count) + 1];
    triangles.push(l, r, nr, l, nr, nl);
  }
  return { points, triangles };
}

/** Returns the area between the outermost border and those inside of it. */
export function areaWithin(loops: readonly (readonly Point[])[]): Sheet {
  const rings = loops
    .map((loop) => opened(loop))
    .filter((loop) => loop.length > 2)
    .sort((one, other) => Math.abs(areaOf(other)) - Math.abs(areaOf(one)));
  const [outer, ...holes] = rings.map((ring) => ring.map(({ x, y }) => new Vector2(x, y)));
  if (!outer) return { points: [], triangles: [] };
  if (ShapeUtils.area(outer) < 0) outer.reverse();
  for (const hole of holes) if (ShapeUtils.area(hole) > 0) hole.reverse();
  const triangles = ShapeUtils.triangulateShape(outer, holes).flat();
  return { points: [...outer, ...holes.flat()].flatMap(({ x, y }) => [x, y]), triangles };
}

/** Returns a loop without its last point where that is the first again. */
function opened(loop: readonly Point[]): readonly Point[] {
  const [first, last] = [loop[0], loop.at(-1)];
  if (!first || !last) return loop;
  const isClosed = Math.hypot(first.x - last.x, first.y - last.y) < 1e-6;
  return isClosed ? loop.slice(0, -1) : loop;
}

/** Returns the area of a loop [m²], negative where it goes clockwise. */
export function areaOf(loop: readonly Point[]): number {
  let twice = 0;
  loop.forEach((point, index) => {
    const next = loop[(index + 1) % loop.length]!;
    twice += point.x * next.y - next.x * point.y;
  });
  return 0.5 * twice;
}

/** Returns the sample of the centre line that is nearest to a point. */
export function nearestSample(course: Course, { x, y }: Point): number {
  let [best, least] = [0, Infinity];
  for (let sample = 0; sample < course.samples; sample++) {
    const square = (course.x(sample) - x) ** 2 + (course.y(sample) - y) ** 2;
    if (square < least) [best, least] = [sample, square];
  }
  return best;
}

/** Returns how far a point lies to the left of a sample of the centre line [m]. */
export function leftOf(course: Course, sample: number, { x, y }: Point): number {
  const heading = course.heading(sample);
  const [east, north] = [x - course.x(sample), y - course.y(sample)];
  return north * Math.cos(heading) - east * Math.sin(heading);
}
