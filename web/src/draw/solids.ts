// What stands on the road in the driver's view: karts and fixed boxes. Drawn far to near.

import type { Point } from '../race/course';
import type { KartBody } from '../race/race.svelte';
import type { KartFrame } from '../wire/frames';
import { type Perspective, type Place, fillShape } from './perspective';
import { middleOf } from './karts';
import { liveryOf } from './palette';
import { type Sign, drawSign } from './signs';

export interface Solid {
  distance: number; // [m] ahead, by which solids are sorted
  draw(context: CanvasRenderingContext2D): void;
}

/** An upright box. */
export interface Body {
  x: number; // [m] of its middle
  y: number;
  heading: number;
  length: number; // [m]
  width: number;
  base: number; // [m] above the ground
  top: number;
  colour: string;
}

export interface Label extends Sign {
  size: number; // [m]
}

const CABIN_COLOUR = '#20262e';
// A sign is readable far away, and hides nothing when it is near [pixels].
const LEAST_SIGN = 19;
const MOST_SIGN = 56;

/** Returns a kart as a solid: a low body, and its driver. */
export function kartSolid(kart: KartFrame, size: KartBody, view: Perspective): Solid | null {
  const { length, width, ahead } = size;
  const { heading, seat } = kart;
  const { colour, ink } = liveryOf(seat);
  const body: Body = {
    ...{ ...middleOf(kart, ahead), heading, length, width, colour },
    base: 0.06 * width,
    top: 0.36 * width,
  };
  const cabin: Body = {
    ...{ ...middleOf(kart, ahead - 0.08 * length), heading, colour: CABIN_COLOUR },
    ...{ length: 0.4 * length, width: 0.56 * width },
    base: body.top,
    top: 0.72 * width,
  };
  return solidOf([body, cabin], view, { text: String(seat), colour, ink, size: 0.6 * width });
}

/** Returns stacked boxes as a solid, with a sign above them if given. */
export function solidOf(bodies: readonly Body[], view: Perspective, sign: Label | null): Solid | null {
  const foot = bodies[0]!;
  const centre = view.place(foot.x, foot.y, 1.3 * bodies.at(-1)!.top);
  if (centre.ahead < view.near) return null;
  return {
    distance: Math.hypot(centre.ahead, centre.left),
    draw: (context) => {
      for (const body of bodies) drawBox(context, body, view);
      if (sign) drawLabel(context, view, centre, sign);
    },
  };
}

/** Draws the sides of a box from the far to the near ones, then its top. */
function drawBox(context: CanvasRenderingContext2D, body: Body, view: Perspective): void {
  const { base, top, colour } = body;
  const corners = cornersOf(body).map(({ x, y }) => view.place(x, y, base));
  const sides = corners.map((start, index) => {
    const end = corners[(index + 1) % 4]!;
    return { start, end, distance: Math.hypot(start.ahead + end.ahead, start.left + end.left) };
  });
  sides.sort((one, other) => other.distance - one.distance);
  context.strokeStyle = 'rgb(0 0 0 / 55%)';
  context.lineWidth = 1;
  for (const [index, { start, end }] of sides.entries()) {
    context.fillStyle = `color-mix(in srgb, ${colour}, black ${index === 3 ? 12 : 38}%)`;
    fillShape(context, view.shape([start, end, { ...end, up: top }, { ...start, up: top }]));
    context.stroke();
  }
  context.fillStyle = `color-mix(in srgb, ${colour}, white 18%)`;
  fillShape(context, view.shape(corners.map((place) => ({ ...place, up: top }))));
  context.stroke();
}

/** Draws a sign above a place. */
export function drawLabel(
  context: CanvasRenderingContext2D,
  view: Perspective,
  at: Place,
  label: Label,
): void {
  const { x, y } = view.project(at);
  const size = Math.min(Math.max(label.size * view.scaleAt(at.ahead), LEAST_SIGN), MOST_SIGN);
  drawSign(context, label, x, y - 0.5 * size, size);
}

function cornersOf({ x, y, heading, length, width }: Body): Point[] {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  return [
    [0.5, 0.5],
    [-0.5, 0.5],
    [-0.5, -0.5],
    [0.5, -0.5],
  ].map(([along, across]) => ({
    x: x + along! * length * cos - across! * width * sin,
    y: y + along! * length * sin + across! * width * cos,
  }));
}
