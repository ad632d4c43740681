// What real karts say that they see, at the place where they see it.

import type { KartBody } from '../race/race.svelte';
import type { KartAlert, KartFrame } from '../wire/frames';
import { DangerStage } from '../wire/tables';

const WARNS = '#ffd43b';
const BRAKES = '#ff4b3e';
const TAU = 2 * Math.PI;
// Radius of the mark [m], and the least on the screen [pixels].
const SIZE = 0.45;
const LEAST = 9;

/** Draws a line from each kart that warns or brakes to what it does that for, and a ring around it. */
export function drawSeen(
  context: CanvasRenderingContext2D,
  karts: readonly KartFrame[],
  alerts: ReadonlyMap<number, KartAlert>,
  body: KartBody,
  pixel: number,
): void {
  for (const kart of karts) {
    const alert = alerts.get(kart.seat);
    if (!alert || alert.stage < DangerStage.WARN || !alert.distance) continue;
    const [bumper, seen] = [ahead(kart, body.ahead + 0.5 * body.length), placeOf(kart, alert, body)];
    const radius = Math.max(SIZE, LEAST * pixel);
    context.strokeStyle = alert.stage >= DangerStage.EASE ? BRAKES : WARNS;
    context.lineWidth = 2.5 * pixel;
    context.beginPath();
    context.moveTo(...bumper);
    context.lineTo(...seen);
    context.moveTo(seen[0] + radius, seen[1]);
    context.arc(...seen, radius, 0, TAU);
    context.stroke();
  }
}

/** Returns where a kart sees what it tells of: x, y [m]. */
export function placeOf(kart: KartFrame, alert: KartAlert, body: KartBody): [number, number] {
  const [x, y] = ahead(kart, body.ahead + 0.5 * body.length);
  const way = kart.heading + alert.bearing;
  return [x + alert.distance * Math.cos(way), y + alert.distance * Math.sin(way)];
}

function ahead({ x, y, heading }: KartFrame, metres: number): [number, number] {
  return [x + metres * Math.cos(heading), y + metres * Math.sin(heading)];
}
