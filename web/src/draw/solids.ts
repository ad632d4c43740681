// What stands up from the ground in the driver's view: walls, karts, boxes. Drawn far to near.

import type { Course, Point } from '../race/course';
import type { KartBody } from '../race/race.svelte';
import type { KartFrame } from '../wire/frames';
import type { Eye, Place } from './eye';
import { trace } from './eye';
import { middleOf } from './karts';
import { liveryOf } from './palette';

export interface Solid {
  distance: number; // [m] ahead, by which solids are sorted
  draw(context: CanvasRenderingContext2D): void;
}

interface Wall {
  from: Point;
  to: Point;
  shade: number; // 0 or 1: two tones by turns, so that one sees how fast they pass
}

/** Returns the walls of a course in pieces of at most `piece` metres. */
export function wallsOf(course: Course, piece: number): Wall[] {
  const walls: Wall[] = [];
  for (const loop of course.loops) {
    let travelled = 0;
    for (let i = 1; i < loop.length; i++) {
      const [start, end] = [loop[i - 1]!, loop[i]!];
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

export function wallSolids(
  walls: readonly Wall[],
  own: Point,
  eye: Eye,
  height: number,
  reach: number,
): Solid[] {
  const solids: Solid[] = [];
  const square = reach ** 2;
  for (const { from, to, shade } of walls) {
    if ((from.x - own.x) ** 2 + (from.y - own.y) ** 2 > square) continue;
    const start = eye.place(from.x, from.y);
    const end = eye.place(to.x, to.y);
    const distance = 0.5 * (Math.hypot(start.ahead, start.left) + Math.hypot(end.ahead, end.left));
    if (distance > reach || Math.max(start.ahead, end.ahead) < eye.near) continue;
    solids.push({
      distance,
      draw: (context) => drawWall(context, eye, [start, end], height, shade, distance / reach),
    });
  }
  return solids;
}

function drawWall(
  context: CanvasRenderingContext2D,
  eye: Eye,
  [start, end]: [Place, Place],
  height: number,
  shade: number,
  far: number,
): void {
  const side = eye.shape([start, end, { ...end, up: height }, { ...start, up: height }]);
  const [face, top] = wallColours(shade, far);
  context.fillStyle = face;
  fill(context, side);
  // Closes the seam to the next piece.
  context.strokeStyle = face;
  context.lineWidth = 0.8;
  context.stroke();
  const rim = 0.86 * height;
  const band = eye.shape([
    { ...start, up: rim },
    { ...end, up: rim },
    { ...end, up: height },
    { ...start, up: height },
  ]);
  context.fillStyle = top;
  fill(context, band);
}

const FAR_STEPS = 24;
// By distance and tone: to put such words together anew for each wall would cost more than drawing.
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

export interface Body {
  x: number;
  y: number;
  heading: number;
  length: number;
  width: number;
  height: number;
}

/** Returns a box as a solid. colour: as `#rrggbb`; label: what its sign says. */
export function boxSolid(body: Body, eye: Eye, colour: string, label: () => Label | null): Solid | null {
  const centre = eye.place(body.x, body.y);
  if (centre.ahead < eye.near) return null;
  return {
    distance: Math.hypot(centre.ahead, centre.left),
    draw: (context) => {
      drawBox(context, body, eye, colour);
      const text = label();
      if (text) drawLabel(context, eye, { ...centre, up: 1.5 * body.height }, text);
    },
  };
}

export function kartSolid(kart: KartFrame, { length, width, ahead }: KartBody, eye: Eye): Solid | null {
  const livery = liveryOf(kart.seat);
  const { heading } = kart;
  const body = { ...middleOf(kart, ahead), heading, length, width, height: 0.6 * width };
  return boxSolid(body, eye, livery.colour, () => ({
    text: String(kart.seat),
    colour: livery.colour,
    ink: livery.ink,
    size: 0.7 * width,
  }));
}

function drawBox(context: CanvasRenderingContext2D, body: Body, eye: Eye, colour: string): void {
  const corners = cornersOf(body);
  const base = corners.map(({ x, y }) => eye.place(x, y, 0.12 * body.height));
  const faces = base.map((start, index) => {
    const end = base[(index + 1) % 4]!;
    return { start, end, distance: Math.hypot(start.ahead + end.ahead, start.left + end.left) };
  });
  faces.sort((one, other) => other.distance - one.distance);
  context.strokeStyle = 'rgb(0 0 0 / 55%)';
  context.lineWidth = 1;
  for (const [index, { start, end }] of faces.entries()) {
    const top = body.height;
    context.fillStyle = `color-mix(in srgb, ${colour}, black ${index === 3 ? 12 : 38}%)`;
    fill(context, eye.shape([start, end, { ...end, up: top }, { ...start, up: top }]));
    context.stroke();
  }
  context.fillStyle = `color-mix(in srgb, ${colour}, white 18%)`;
  fill(context, eye.shape(base.map((place) => ({ ...place, up: body.height }))));
  context.stroke();
}

export interface Label {
  text: string;
  colour: string;
  ink: string;
  size: number; // [m]
}

/** Draws a round sign that stays readable far away. */
export function drawLabel(context: CanvasRenderingContext2D, eye: Eye, at: Place, label: Label): void {
  const { x, y } = eye.project(at);
  const size = Math.min(Math.max(label.size * eye.scaleAt(at.ahead), 15), 64);
  context.beginPath();
  context.arc(x, y - 0.6 * size, 0.62 * size, 0, 2 * Math.PI);
  context.fillStyle = label.colour;
  context.fill();
  context.lineWidth = 2;
  context.strokeStyle = 'rgb(0 0 0 / 70%)';
  context.stroke();
  context.font = `800 ${(0.8 * size).toFixed(0)}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = label.ink;
  context.fillText(label.text, x, y - 0.57 * size);
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

function fill(context: CanvasRenderingContext2D, pixels: { x: number; y: number }[]): void {
  context.beginPath();
  trace(context, pixels);
  context.fill();
}

function pointBetween(from: Point, to: Point, share: number): Point {
  return { x: from.x + share * (to.x - from.x), y: from.y + share * (to.y - from.y) };
}
