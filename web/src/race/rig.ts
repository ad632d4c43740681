// A vehicle with trailers: where it leads with the wheels as they are, and from which angle at a
// hitch no reversing brings it straight again. The angle at a hitch is the heading of what draws
// minus that of what is drawn.

import type { KartFrame, TrailerFrame } from '../wire/frames';
import { wrap } from './buffer';
import type { Point } from './course';

// The prediction is this long [m], in steps of this length.
export const AHEAD_M = 12;
const STEP_M = 0.1;

export interface Hitch {
  offset: number; // [m] from the axle ahead back to the hitch; negative: the hitch is ahead of it
  bar: number; // [m] from the hitch back to the axle
}

export interface Rig {
  rearAxle: number; // [m] from the centre of gravity back to the rear axle
  wheelbase: number; // [m]
  lock: number; // most steering [rad]
  hitches: Hitch[]; // the nearest one first
}

/** Returns the vehicle that a rule book describes, null where it draws no trailer. */
export function rigOf(values: ReadonlyMap<string, string>): Rig | null {
  const number = (name: string): number => Number(values.get(name) ?? NaN);
  const hitches: Hitch[] = [];
  for (let row = 0; values.has(`trailers.${row}.bar`); row++) {
    hitches.push({ offset: number(`trailers.${row}.hitch`), bar: number(`trailers.${row}.bar`) });
  }
  const [rearAxle, lock] = [number('rear_axle'), number('steering_limit')];
  const wheelbase = number('front_axle') + rearAxle;
  const isKnown = [rearAxle, lock, wheelbase].every(Number.isFinite);
  return isKnown && hitches.length ? { rearAxle, wheelbase, lock, hitches } : null;
}

/**
 * Returns the angle [rad] at the first hitch beyond which reversing at full lock makes it larger.
 *
 * There sin β = κ (L + d cos β), with the curvature κ of full lock, the bar L and the hitch d.
 * Infinity where full lock straightens any angle.
 */
export function noReturn({ wheelbase, lock, hitches }: Rig): number {
  const { offset, bar } = hitches[0]!;
  const curvature = Math.tan(lock) / wheelbase;
  const share = (curvature * bar) / Math.hypot(1, curvature * offset);
  return share < 1 ? Math.atan(curvature * offset) + Math.asin(share) : Infinity;
}

/** Returns the angles [rad] at the hitches of a vehicle. */
export function hitchAngles(kart: KartFrame, trailers: readonly TrailerFrame[]): number[] {
  const own = trailers.filter(({ seat }) => seat === kart.seat);
  return own.map(({ heading }, row) => wrap((own[row - 1] ?? kart).heading - heading));
}

export interface Prediction {
  paths: Point[][]; // of the rear axle, then of each trailer's axle
  isKnife: boolean; // it ends where a hitch is at its limit
}

/** Returns where the axles of a vehicle go with the wheels as they are. way: 1 ahead, -1 back. */
export function predict(
  rig: Rig,
  kart: KartFrame,
  trailers: readonly TrailerFrame[],
  way: 1 | -1,
): Prediction {
  const own = trailers.filter(({ seat }) => seat === kart.seat).slice(0, rig.hitches.length);
  const curvature = Math.tan(kart.steering) / rig.wheelbase;
  const headings = [kart.heading, ...own.map(({ heading }) => heading)];
  const axle: Point = {
    x: kart.x - rig.rearAxle * Math.cos(kart.heading),
    y: kart.y - rig.rearAxle * Math.sin(kart.heading),
  };
  const paths: Point[][] = headings.map(() => []);
  const limits = own.map(({ limit }) => limit);
  for (let step = 0; step <= AHEAD_M / STEP_M; step++) {
    axlesAt(axle, headings, rig).forEach((point, row) => paths[row]!.push(point));
    if (isBent(headings, limits)) return { paths, isKnife: true };
    advance(axle, headings, rig, curvature, way * STEP_M);
  }
  return { paths, isKnife: false };
}

function isBent(headings: readonly number[], limits: readonly number[]): boolean {
  return limits.some((limit, row) => Math.abs(wrap(headings[row]! - headings[row + 1]!)) > limit);
}

function axlesAt(first: Point, headings: readonly number[], rig: Rig): Point[] {
  const places: Point[] = [{ ...first }];
  for (let row = 1; row < headings.length; row++) {
    const { offset, bar } = rig.hitches[row - 1]!;
    const [ahead, own, last] = [headings[row - 1]!, headings[row]!, places.at(-1)!];
    places.push({
      x: last.x - offset * Math.cos(ahead) - bar * Math.cos(own),
      y: last.y - offset * Math.sin(ahead) - bar * Math.sin(own),
    });
  }
  return places;
}

/** Drives `way` metres: the headings of the middle of the step decide. Changes the first two. */
function advance(axle: Point, headings: number[], rig: Rig, curvature: number, way: number): void {
  const half = turnsOf(headings, rig, curvature).map((turn, row) => headings[row]! + 0.5 * way * turn);
  axle.x += way * Math.cos(half[0]!);
  axle.y += way * Math.sin(half[0]!);
  turnsOf(half, rig, curvature).forEach((turn, row) => (headings[row]! += way * turn));
}

/** Returns how each heading changes on a metre of the rear axle [rad/m]. */
function turnsOf(headings: readonly number[], rig: Rig, curvature: number): number[] {
  const turns = [curvature];
  let along = 1;
  for (let row = 1; row < headings.length; row++) {
    const { offset, bar } = rig.hitches[row - 1]!;
    const angle = headings[row - 1]! - headings[row]!;
    const across = -offset * turns[row - 1]!;
    turns.push((along * Math.sin(angle) + across * Math.cos(angle)) / bar);
    along = along * Math.cos(angle) - across * Math.sin(angle);
  }
  return turns;
}
