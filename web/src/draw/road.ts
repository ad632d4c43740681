// The ground in the driver's view: verge, asphalt, bands that pass, the ideal line.

import type { Course } from '../race/course';
import type { ReferenceLine, Zone } from '../race/line';
import type { HazardFrame } from '../wire/frames';
import { type Perspective, type Place, trace } from './perspective';
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
export function drawBackdrop(
  context: CanvasRenderingContext2D,
  view: Perspective,
  width: number,
  height: number,
): void {
  gradient(context, ROAD.sky, 0, view.horizon, width);
  gradient(context, ROAD.ground, view.horizon, height, width);
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

/** Draws the surfaces of the whole course. step: between the points of an edge [m]. */
export function drawSurfaces(
  context: CanvasRenderingContext2D,
  course: Course,
  view: Perspective,
  step: number,
): void {
  const { kerb, grass } = course.frame;
  const hasVerge = kerb + grass > 0;
  const ground = new Path2D();
  for (const loop of course.loops) {
    trace(ground, view.shape(loop.map(({ x, y }) => view.place(x, y))));
  }
  context.fillStyle = hasVerge ? ROAD.grass : ROAD.asphalt;
  context.fill(ground, 'evenodd');
  if (kerb > 0) fillRibbon(context, course, view, { beyond: kerb, step }, ROAD.kerb);
  if (hasVerge) fillRibbon(context, course, view, { beyond: 0, step }, ROAD.asphalt);
}

function fillRibbon(
  context: CanvasRenderingContext2D,
  course: Course,
  view: Perspective,
  { beyond, step }: { beyond: number; step: number },
  colour: string,
): void {
  const path = new Path2D();
  for (const side of ['left', 'right'] as const) {
    const places = course.edgeLine(side, beyond, step).map(({ x, y }) => view.place(x, y));
    trace(path, view.shape(places));
  }
  context.fillStyle = colour;
  context.fill(path, 'evenodd');
}

/** Draws bands across the road ahead, which show the speed. */
export function drawBands(
  context: CanvasRenderingContext2D,
  course: Course,
  view: Perspective,
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
    trace(context, view.shape(corners.map(({ x, y }) => view.place(x, y))));
    context.fill();
  }
}

/** Draws the ideal line ahead: wide where one accelerates, as rungs where one brakes. */
export function drawIdealLine(
  context: CanvasRenderingContext2D,
  line: ReferenceLine,
  view: Perspective,
  near: number,
  width: number,
  reach: number,
): void {
  const step = Math.max(Math.round((0.5 * width) / line.frame.spacing), 1);
  const spacing = line.frame.spacing * step;
  const count = Math.min(Math.floor(reach / spacing), Math.floor(line.count / step));
  for (const strip of stripsOf(line, near, step, count)) {
    context.globalAlpha = 0.9 - 0.75 * (strip.first / count);
    context.fillStyle = ZONE_COLOURS[strip.zone];
    context.beginPath();
    trace(context, view.shape(bandOf(line, view, strip, widthIn(strip.zone, width))));
    context.fill();
  }
  context.globalAlpha = 1;
}

interface Strip {
  zone: Zone;
  first: number; // pieces from the kart
  points: number[]; // of the line
}

// Most pieces in a strip of one zone: strips fade with distance.
const STRIP_PIECES = 16;

/** Returns the line ahead in strips of one zone each; of a braking zone every second piece. */
function stripsOf(line: ReferenceLine, near: number, step: number, count: number): Strip[] {
  const strips: Strip[] = [];
  for (let piece = 0; piece < count; piece++) {
    const at = (near + piece * step) % line.count;
    const next = (at + step) % line.count;
    const zone = line.zones[at]!;
    const last = strips.at(-1);
    if (zone === 'brake') {
      if (Math.floor(at / step) % 2 === 0) strips.push({ zone, first: piece, points: [at, next] });
    } else if (last?.zone === zone && last.points.length <= STRIP_PIECES) {
      last.points.push(next);
    } else strips.push({ zone, first: piece, points: [at, next] });
  }
  return strips.reverse(); // far ones first
}

function widthIn(zone: Zone, width: number): number {
  if (zone === 'hold') return 0.45 * width;
  return zone === 'brake' ? 1.25 * width : width;
}

/** Returns a strip of the line as a shape on the ground, along one side and back on the other. */
function bandOf(line: ReferenceLine, view: Perspective, strip: Strip, width: number): Place[] {
  const { x, y } = line.frame;
  const [left, right]: [Place[], Place[]] = [[], []];
  for (const at of strip.points) {
    const next = (at + 1) % line.count;
    const [dx, dy] = [x[next]! - x[at]!, y[next]! - y[at]!];
    const half = (0.5 * width) / (Math.hypot(dx, dy) || 1);
    left.push(view.place(x[at]! - half * dy, y[at]! + half * dx));
    right.push(view.place(x[at]! + half * dy, y[at]! - half * dx));
  }
  return [...left, ...right.reverse()];
}

/** Draws hazards on the road, such as oil. */
export function drawPuddles(
  context: CanvasRenderingContext2D,
  hazards: readonly HazardFrame[],
  view: Perspective,
): void {
  for (const { x, y, radius } of hazards) {
    const rim = Array.from({ length: 20 }, (_, i) =>
      view.place(x + radius * Math.cos((i * TAU) / 20), y + radius * Math.sin((i * TAU) / 20)),
    );
    context.beginPath();
    trace(context, view.shape(rim));
    context.fillStyle = '#0c0906';
    context.fill();
    context.strokeStyle = '#ffb000';
    context.lineWidth = 3;
    context.stroke();
  }
}
