// Karts on the map: to scale where that is visible, never smaller than their number.

import type { KartBody } from '../race/race.svelte';
import type { KartFrame, TrailerFrame } from '../wire/frames';
import { KartFlag, Status } from '../wire/tables';
import type { Point } from '../race/course';
import type { Camera } from './camera';
import { type MapColours, liveryOf } from './palette';

/** Least length of a kart on the picture [pixels]. */
const LEAST_PIXELS = 26;
const TAU = 2 * Math.PI;

export interface KartStyle {
  body: KartBody;
  camera: Camera;
  ratio: number; // pixels of the canvas in one of the picture
  colours: MapColours;
  followed: number; // seat, -1 for none
  isBox: boolean; // of its true size and shape, as in a car park
}

/** Draws the boxes of trailers in the colours of what draws them, below the vehicles. */
export function drawTrailers(
  context: CanvasRenderingContext2D,
  trailers: readonly TrailerFrame[],
  { camera, ratio, colours }: KartStyle,
): void {
  for (const trailer of trailers) {
    const { x, y } = camera.toPicture(trailer);
    const length = trailer.length * camera.scale;
    const width = trailer.width * camera.scale;
    context.setTransform(ratio, 0, 0, ratio, x * ratio, y * ratio);
    context.rotate(-trailer.heading);
    context.globalAlpha = 0.75;
    context.fillStyle = liveryOf(trailer.seat).colour;
    context.fillRect(-0.5 * length, -0.5 * width, length, width);
    context.globalAlpha = 1;
    context.lineWidth = 1;
    context.strokeStyle = colours.halo;
    context.strokeRect(-0.5 * length, -0.5 * width, length, width);
  }
}

/** Draws karts, those in front last so that they lie on top. */
export function drawKarts(
  context: CanvasRenderingContext2D,
  karts: readonly KartFrame[],
  style: KartStyle,
): void {
  const order = [...karts].sort((one, other) => other.rank - one.rank);
  for (const kart of order) {
    if (kart.status !== Status.ABSENT) drawKart(context, kart, style);
  }
}

function drawKart(context: CanvasRenderingContext2D, kart: KartFrame, style: KartStyle): void {
  const { camera, ratio, body } = style;
  const place = camera.toPicture(middleOf(kart, body.ahead));
  const length = lengthOn(style);
  const width = style.isBox || length > LEAST_PIXELS ? body.width * camera.scale : 0.56 * length;
  context.setTransform(ratio, 0, 0, ratio, place.x * ratio, place.y * ratio);
  context.globalAlpha = opacityOf(kart);
  drawRings(context, kart, style, length);
  context.rotate(-kart.heading);
  if (style.isBox) drawVehicle(context, kart.seat, length, width, style.colours);
  else drawBody(context, kart.seat, length, width, style.colours);
  context.rotate(kart.heading);
  drawNumber(context, kart.seat, Math.max(0.62 * width, 10));
  context.globalAlpha = 1;
}

/** Returns the opacity of a kart: a ghost, and one that is out of the race, is faint. */
export function opacityOf(kart: KartFrame): number {
  const isOut = kart.status === Status.RETIRED || (kart.flags & KartFlag.SUSPENDED) !== 0;
  return isOut || kart.isGhost ? 0.4 : 1;
}

/** Returns how long karts are on the picture [pixels]. */
export function lengthOn({ body, camera, isBox }: KartStyle): number {
  return isBox ? body.length * camera.scale : Math.max(body.length * camera.scale, LEAST_PIXELS);
}

/** Returns the middle of a kart's body; its place is its centre of gravity. */
export function middleOf(kart: KartFrame, ahead: number): Point {
  return {
    x: kart.x + ahead * Math.cos(kart.heading),
    y: kart.y + ahead * Math.sin(kart.heading),
  };
}

function drawBody(
  context: CanvasRenderingContext2D,
  seat: number,
  length: number,
  width: number,
  colours: MapColours,
): void {
  const livery = liveryOf(seat);
  const [back, side, nose] = [-0.5 * length, 0.5 * width, 0.5 * length];
  context.beginPath();
  context.moveTo(back, -side);
  context.lineTo(0.2 * length, -side);
  context.lineTo(nose, -0.35 * side);
  context.lineTo(nose, 0.35 * side);
  context.lineTo(0.2 * length, side);
  context.lineTo(back, side);
  context.closePath();
  context.fillStyle = livery.colour;
  context.fill();
  if (livery.hasStripe) {
    context.fillStyle = livery.ink;
    context.fillRect(back, -side, 0.14 * length, width);
    context.fillRect(0.24 * length, -0.8 * side, 0.08 * length, 1.6 * side);
  }
  context.lineWidth = 1.5;
  context.strokeStyle = colours.halo;
  context.stroke();
}

/** Draws a vehicle as the rectangle that it takes, with a windscreen that shows its front. */
function drawVehicle(
  context: CanvasRenderingContext2D,
  seat: number,
  length: number,
  width: number,
  colours: MapColours,
): void {
  const livery = liveryOf(seat);
  context.fillStyle = livery.colour;
  context.fillRect(-0.5 * length, -0.5 * width, length, width);
  context.fillStyle = livery.ink;
  context.fillRect(0.24 * length, -0.4 * width, 0.12 * length, 0.8 * width);
  if (livery.hasStripe) context.fillRect(-0.46 * length, -0.5 * width, 0.08 * length, width);
  context.lineWidth = 1;
  context.strokeStyle = colours.halo;
  context.strokeRect(-0.5 * length, -0.5 * width, length, width);
}

function drawNumber(context: CanvasRenderingContext2D, seat: number, size: number): void {
  context.font = `700 ${size.toFixed(0)}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = liveryOf(seat).ink;
  context.fillText(String(seat), 0, 0.5);
}

/** Rings show what acts on a kart: they differ in stroke, not only in colour. */
function drawRings(
  context: CanvasRenderingContext2D,
  kart: KartFrame,
  style: KartStyle,
  length: number,
): void {
  const radius = 0.62 * length;
  if (kart.seat === style.followed) ring(context, radius + 7, style.colours.ink, 2, []);
  if (kart.flags & KartFlag.IMMUNE) ring(context, radius, '#7fd4ff', 3, []);
  if (kart.effects > 0) ring(context, radius + 3, '#ffb347', 3, [3, 4]);
  if (kart.flags & KartFlag.DOUBTFUL) ring(context, radius, '#ffe066', 2, [1, 5]);
  if (kart.flags & KartFlag.WRONG_WAY) ring(context, radius + 3, '#ff5a4d', 3, [8, 4]);
}

function ring(
  context: CanvasRenderingContext2D,
  radius: number,
  colour: string,
  width: number,
  dashes: number[],
): void {
  context.beginPath();
  context.arc(0, 0, radius, 0, TAU);
  context.setLineDash(dashes);
  context.lineWidth = width;
  context.strokeStyle = colour;
  context.stroke();
  context.setLineDash([]);
}
