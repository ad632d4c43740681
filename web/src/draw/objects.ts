// Item boxes, hazards, trails and rays on the map. All in metres.

import type { Course, Point } from '../race/course';
import type { Mark, Trails } from '../race/trails';
import type { HazardFrame, RaysFrame, SnapshotFrame } from '../wire/frames';
import { RayHit } from '../wire/tables';
import { SPEED_COLOURS } from './palette';

const TAU = 2 * Math.PI;
const RADAR_COLOURS: Record<RayHit, string> = {
  [RayHit.NOTHING]: '#8d97a3',
  [RayHit.BORDER]: '#c8ccd0',
  [RayHit.OBSTACLE]: '#e0b25a',
  [RayHit.HAZARD]: '#ff8a5c',
  [RayHit.KART]: '#7fd4ff',
  [RayHit.PERSON]: '#f27ba5',
};

/** Draws the item boxes: filled where ready, an empty frame while not. */
export function drawBoxes(
  context: CanvasRenderingContext2D,
  course: Course,
  ready: Uint8Array,
  size: number,
  pixel: number,
): void {
  const boxes = course.frame.boxes;
  context.lineWidth = 1.5 * pixel;
  for (let i = 0; i + 1 < boxes.length; i += 2) {
    const isReady = ready[i / 2] === 1;
    const [x, y] = [boxes[i]!, boxes[i + 1]!];
    context.beginPath();
    context.moveTo(x - size, y);
    context.lineTo(x, y + size);
    context.lineTo(x + size, y);
    context.lineTo(x, y - size);
    context.closePath();
    context.globalAlpha = isReady ? 1 : 0.45;
    context.fillStyle = '#b28cff';
    context.strokeStyle = '#e9ddff';
    if (isReady) context.fill();
    context.stroke();
  }
  context.globalAlpha = 1;
}

export function drawHazards(
  context: CanvasRenderingContext2D,
  hazards: readonly HazardFrame[],
  pixel: number,
): void {
  context.lineWidth = 2 * pixel;
  for (const { x, y, radius } of hazards) {
    context.beginPath();
    context.arc(x, y, Math.max(radius, 4 * pixel), 0, TAU);
    context.fillStyle = '#1b1410';
    context.fill();
    context.strokeStyle = '#ffb000';
    context.stroke();
  }
}

/** Draws where karts were, coloured by speed; older marks are thinner. */
export function drawTrails(
  context: CanvasRenderingContext2D,
  trails: Trails,
  frame: SnapshotFrame,
  pixel: number,
): void {
  const ways = SPEED_COLOURS.map(() => new Path2D());
  const wayFor = (speed: number) => {
    const share = Math.min(Math.max(speed / trails.fastest, 0), 1);
    return ways[Math.round(share * (SPEED_COLOURS.length - 1))]!;
  };
  for (const kart of frame.karts) {
    const marks = trails.marks.get(kart.seat) ?? [];
    let from: Mark | undefined;
    for (const to of marks) {
      if (to.tick > frame.tick) break;
      if (from) addStep(wayFor(to.speed), from, to);
      from = to;
    }
    if (from) addStep(wayFor(kart.speed), from, kart);
  }
  context.lineWidth = 2.5 * pixel;
  context.lineCap = 'round';
  context.globalAlpha = 0.8;
  ways.forEach((way, index) => {
    context.strokeStyle = SPEED_COLOURS[index]!;
    context.stroke(way);
  });
  context.globalAlpha = 1;
}

// A step longer than the speed allows in this time [s] is a jump: the kart was moved.
const LEAP_S = 0.6;

function addStep(way: Path2D, from: Point, to: Point & { speed: number }): void {
  if (Math.hypot(to.x - from.x, to.y - from.y) > LEAP_S * (1 + Math.abs(to.speed))) return;
  way.moveTo(from.x, from.y);
  way.lineTo(to.x, to.y);
}

/** Draws what a kart's lidar and radar see. */
export function drawRays(context: CanvasRenderingContext2D, rays: RaysFrame, pixel: number): void {
  drawLidar(context, rays, pixel);
  context.lineWidth = 1.5 * pixel;
  for (let ray = 0; ray < rays.radar.length; ray++) {
    const angle = rays.heading + (rays.radarAngles[ray] ?? 0);
    const [x, y] = sensorAt(rays, rays.radarAhead);
    const range = rays.radar[ray]!;
    context.strokeStyle = RADAR_COLOURS[rays.radarKinds[ray] ?? RayHit.NOTHING];
    context.setLineDash([6 * pixel, 4 * pixel]);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + range * Math.cos(angle), y + range * Math.sin(angle));
    context.stroke();
  }
  context.setLineDash([]);
}

function drawLidar(context: CanvasRenderingContext2D, rays: RaysFrame, pixel: number): void {
  const count = rays.lidar.length;
  if (count < 2) return;
  const seen = new Path2D();
  const hits = new Path2D();
  const [x0, y0] = sensorAt(rays, rays.lidarAhead);
  seen.moveTo(x0, y0);
  for (let ray = 0; ray < count; ray++) {
    const angle = rays.heading - 0.5 * rays.lidarField + (ray * rays.lidarField) / (count - 1);
    const range = rays.lidar[ray]! || 0;
    const x = x0 + range * Math.cos(angle);
    const y = y0 + range * Math.sin(angle);
    seen.lineTo(x, y);
    if (range > 0) hits.rect(x - 1.5 * pixel, y - 1.5 * pixel, 3 * pixel, 3 * pixel);
  }
  seen.closePath();
  context.fillStyle = 'rgb(127 212 255 / 14%)';
  context.fill(seen);
  context.fillStyle = '#7fd4ff';
  context.fill(hits);
}

/** Returns where a sensor is [m]. ahead: of the centre of gravity. */
function sensorAt(rays: RaysFrame, ahead: number): [number, number] {
  return [rays.x + ahead * Math.cos(rays.heading), rays.y + ahead * Math.sin(rays.heading)];
}
