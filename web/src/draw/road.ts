// The ground in the driver's view: verge, asphalt, bands that pass, the ideal line.

import type { Course } from '../race/course';
import type { ReferenceLine, Zone } from '../race/line';
import type { HazardFrame } from '../wire/frames';
import { type Eye, trace } from './eye';
import { ZONE_COLOURS } from './surface';

const TAU = 2 * Math.PI;

export interface RoadColours {
  sky: [string, string];
  ground: [string, string];
  grass: string;
  asphalt: string;
  band: string;
  kerb: string;
}

export const ROAD: RoadColours = {
  sky: ['#0a1626', '#31506b'],
  ground: ['#141b17', '#1b251f'],
  grass: '#24412c',
  asphalt: '#353b44',
  band: 'rgb(255 255 255 / 4.5%)',
  kerb: '#b34a44',
};

/** Draws sky and ground up to the horizon. */
export function drawBackdrop(context: CanvasRenderingContext2D, eye: Eye, width: number, height: number): void {
  gradient(context, ROAD.sky, 0, eye.horizon, width);
  gradient(context, ROAD.ground, eye.horizon, height, width);
}

function gradient(
  context: CanvasRenderingContext2D,
  [first, last]: [string, string],
  top: number,
  bottom: number,
  width: number,
): void {
  const fill = context.createLinearGradient(0, top, 0, bottom);
  fill.addColorStop(0, first);
  fill.addColorStop(1, last);
  context.fillStyle = fill;
  context.fillRect(0, top, width, bottom - top);
}

/** Draws the surfaces of the whole course. */
export function drawSurfaces(context: CanvasRenderingContext2D, course: Course, eye: Eye): void {
  const { kerb, grass } = course.frame;
  const hasVerge = kerb + grass > 0;
  const ground = new Path2D();
  for (const loop of course.loops) {
    trace(ground, eye.shape(loop.map(({ x, y }) => eye.place(x, y))));
  }
  context.fillStyle = hasVerge ? ROAD.grass : ROAD.asphalt;
  context.fill(ground, 'evenodd');
  if (kerb > 0) fillRibbon(context, course, eye, kerb, ROAD.kerb);
  if (hasVerge) fillRibbon(context, course, eye, 0, ROAD.asphalt);
}

function fillRibbon(
  context: CanvasRenderingContext2D,
  course: Course,
  eye: Eye,
  beyond: number,
  colour: string,
): void {
  const path = new Path2D();
  for (const side of ['left', 'right'] as const) {
    const places = Array.from({ length: course.samples }, (_, sample) => {
      const { x, y } = course.edge(sample, side, beyond);
      return eye.place(x, y);
    });
    trace(path, eye.shape(places));
  }
  context.fillStyle = colour;
  context.fill(path, 'evenodd');
}

/** Draws bands across the road ahead, by which one sees how fast it passes. */
export function drawBands(
  context: CanvasRenderingContext2D,
  course: Course,
  eye: Eye,
  sample: number,
  step: number,
  reach: number,
): void {
  const stride = Math.max(Math.round(step / course.frame.spacing), 1);
  const first = Math.floor(sample / stride) - 1;
  const count = Math.min(Math.ceil(reach / step), Math.floor(course.samples / stride));
  context.fillStyle = ROAD.band;
  for (let band = first; band < first + count; band++) {
    if (band % 2 !== 0) continue;
    const [near, far] = [band * stride, (band + 1) * stride].map(
      (at) => ((at % course.samples) + course.samples) % course.samples,
    ) as [number, number];
    const corners = [
      course.edge(near, 'left'),
      course.edge(near, 'right'),
      course.edge(far, 'right'),
      course.edge(far, 'left'),
    ];
    context.beginPath();
    trace(context, eye.shape(corners.map(({ x, y }) => eye.place(x, y))));
    context.fill();
  }
}

/** Draws the ideal line ahead: wide where one accelerates, as rungs where one brakes. */
export function drawIdealLine(
  context: CanvasRenderingContext2D,
  line: ReferenceLine,
  eye: Eye,
  near: number,
  width: number,
  reach: number,
): void {
  const { spacing } = line.frame;
  const step = Math.max(Math.round((0.5 * width) / spacing), 1);
  const count = Math.min(Math.floor(reach / (spacing * step)), Math.floor(line.count / step));
  for (let piece = count - 1; piece >= 0; piece--) {
    const at = (near + piece * step) % line.count;
    const zone = line.zones[at]!;
    // Rungs: every second piece is left out.
    if (zone === 'brake' && Math.floor(at / step) % 2) continue;
    const fade = 1 - piece / count;
    context.globalAlpha = 0.15 + 0.75 * fade;
    context.fillStyle = ZONE_COLOURS[zone];
    context.beginPath();
    trace(context, eye.shape(rung(line, eye, at, (at + step) % line.count, widthIn(zone, width))));
    context.fill();
  }
  context.globalAlpha = 1;
}

function widthIn(zone: Zone, width: number): number {
  if (zone === 'hold') return 0.45 * width;
  return zone === 'brake' ? 1.25 * width : width;
}

function rung(line: ReferenceLine, eye: Eye, from: number, to: number, width: number) {
  const { x, y } = line.frame;
  const [dx, dy] = [x[to]! - x[from]!, y[to]! - y[from]!];
  const length = Math.hypot(dx, dy) || 1;
  const [across, along] = [(-0.5 * width * dy) / length, (0.5 * width * dx) / length];
  return [
    eye.place(x[from]! + across, y[from]! + along),
    eye.place(x[from]! - across, y[from]! - along),
    eye.place(x[to]! - across, y[to]! - along),
    eye.place(x[to]! + across, y[to]! + along),
  ];
}

/** Draws what lies on the road, such as oil. */
export function drawPuddles(
  context: CanvasRenderingContext2D,
  hazards: readonly HazardFrame[],
  eye: Eye,
): void {
  for (const { x, y, radius } of hazards) {
    const rim = Array.from({ length: 20 }, (_, i) =>
      eye.place(x + radius * Math.cos((i * TAU) / 20), y + radius * Math.sin((i * TAU) / 20)),
    );
    context.beginPath();
    trace(context, eye.shape(rim));
    context.fillStyle = '#0c0906';
    context.fill();
    context.strokeStyle = '#ffb000';
    context.lineWidth = 3;
    context.stroke();
  }
}
