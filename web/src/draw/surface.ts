// Static parts of the map: surfaces, kerbs, borders, sectors, places of the grid, the line.

import type { Course, Point } from '../race/course';
import type { ReferenceLine, Zone } from '../race/line';
import { drawSlots } from './lot';
import type { MapColours } from './palette';

export const ZONE_COLOURS: Record<Zone, string> = {
  accelerate: '#22b585',
  hold: '#f2b63c',
  brake: '#ef6a3a',
};

/** The paths of a course, made once and drawn at any zoom. */
export class Surface {
  private readonly ground = new Path2D();
  private readonly asphalt: Path2D;
  private readonly kerbs: Path2D | null;
  private readonly borders = new Path2D();
  private readonly middle = new Path2D();
  private readonly zones = new Map<Zone, Path2D>();
  private readonly hasVerge: boolean;

  constructor(
    private readonly course: Course,
    line: ReferenceLine | null,
    private readonly places: number, // of the grid, that are drawn
  ) {
    const { kerb, grass } = course.frame;
    this.hasVerge = kerb + grass > 0;
    for (const loop of course.loops) {
      addWay(this.ground, loop);
      addWay(this.borders, loop);
    }
    this.asphalt = ribbon(course, 0);
    this.kerbs = kerb > 0 ? ribbon(course, kerb) : null;
    if (course.isLot) return;
    const centre = Array.from({ length: course.samples }, (_, i) => course.beside(i, 0));
    addWay(this.middle, [...centre, centre[0]!]);
    if (line) this.addZones(line);
  }

  draw(
    context: CanvasRenderingContext2D,
    colours: MapColours,
    pixel: number,
    showLine: boolean,
  ): void {
    context.fillStyle = this.hasVerge ? colours.grass : colours.asphalt;
    context.fill(this.ground, 'evenodd');
    if (this.kerbs) {
      context.fillStyle = colours.kerb;
      context.fill(this.kerbs, 'evenodd');
    }
    if (this.hasVerge) {
      context.fillStyle = colours.asphalt;
      context.fill(this.asphalt, 'evenodd');
    }
    this.drawObstacles(context, colours);
    if (this.course.isLot) {
      drawSlots(context, this.course.frame.slots, colours, pixel);
    } else {
      this.drawSectors(context, colours, pixel);
      this.drawStart(context, colours, pixel);
    }
    if (showLine) this.drawZones(context, pixel);
    context.strokeStyle = colours.border;
    context.lineWidth = 1.6 * pixel;
    context.stroke(this.borders);
  }

  private drawObstacles(context: CanvasRenderingContext2D, colours: MapColours): void {
    const all = this.course.frame.obstacles;
    context.fillStyle = colours.obstacle;
    for (let i = 0; i + 4 < all.length; i += 5) {
      const [x, y, heading, length, width] = all.slice(i, i + 5) as unknown as number[];
      context.save();
      context.translate(x!, y!);
      context.rotate(heading!);
      context.fillRect(-0.5 * length!, -0.5 * width!, length!, width!);
      context.restore();
    }
  }

  private drawSectors(context: CanvasRenderingContext2D, colours: MapColours, pixel: number): void {
    context.strokeStyle = colours.marking;
    context.lineWidth = 1.5 * pixel;
    context.setLineDash([4 * pixel, 4 * pixel]);
    for (const progress of this.course.sectorLines) {
      const sample = this.course.sampleAt(progress);
      if (sample !== 0) strokeBetween(context, ...this.across(sample));
    }
    context.setLineDash([]);
  }

  /** The timing line as a chequered band, and the places behind it. */
  private drawStart(context: CanvasRenderingContext2D, colours: MapColours, pixel: number): void {
    const [left, right] = this.across(0);
    const cells = 12;
    const size = Math.max(Math.hypot(left.x - right.x, left.y - right.y) / cells, 1e-3);
    const heading = this.course.heading(0);
    for (let row = 0; row < 2; row++) {
      for (let cell = 0; cell < cells; cell++) {
        const share = (cell + 0.5) / cells;
        context.save();
        context.translate(
          right.x + share * (left.x - right.x) + (row - 0.5) * size * Math.cos(heading),
          right.y + share * (left.y - right.y) + (row - 0.5) * size * Math.sin(heading),
        );
        context.rotate(heading);
        context.fillStyle = (row + cell) % 2 ? '#ffffff' : '#111111';
        context.fillRect(-0.5 * size, -0.5 * size, size, size);
        context.restore();
      }
    }
    this.drawGrid(context, colours, pixel);
  }

  private drawGrid(context: CanvasRenderingContext2D, colours: MapColours, pixel: number): void {
    const { grid, kartLength, kartWidth } = this.course.frame;
    const [length, width] = [kartLength || 0.45, kartWidth || 0.19];
    context.strokeStyle = colours.marking;
    context.globalAlpha = 0.55;
    context.lineWidth = pixel;
    for (let i = 0; i + 2 < Math.min(grid.length, 3 * this.places); i += 3) {
      context.save();
      context.translate(grid[i]!, grid[i + 1]!);
      context.rotate(grid[i + 2]!);
      context.beginPath();
      context.moveTo(0.3 * length, 0.7 * width);
      context.lineTo(0.6 * length, 0.7 * width);
      context.lineTo(0.6 * length, -0.7 * width);
      context.lineTo(0.3 * length, -0.7 * width);
      context.stroke();
      context.restore();
    }
    context.globalAlpha = 1;
  }

  private drawZones(context: CanvasRenderingContext2D, pixel: number): void {
    context.lineWidth = 2.2 * pixel;
    context.globalAlpha = 0.85;
    for (const [zone, way] of this.zones) {
      context.strokeStyle = ZONE_COLOURS[zone];
      // Dashes in braking zones, so that zones do not differ only in colour.
      context.setLineDash(zone === 'brake' ? [5 * pixel, 4 * pixel] : []);
      context.stroke(way);
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  private across(sample: number): [Point, Point] {
    return [this.course.edge(sample, 'left'), this.course.edge(sample, 'right')];
  }

  private addZones(line: ReferenceLine): void {
    const { x, y } = line.frame;
    let last: Zone | null = null;
    for (let i = 0; i <= line.count; i++) {
      const at = i % line.count;
      const zone = line.zones[at]!;
      const way = this.zones.get(zone) ?? new Path2D();
      this.zones.set(zone, way);
      const before = (at - 1 + line.count) % line.count;
      if (zone !== last) way.moveTo(x[before]!, y[before]!);
      way.lineTo(x[at]!, y[at]!);
      last = zone;
    }
  }
}

function addWay(path: Path2D, points: readonly Point[]): void {
  points.forEach(({ x, y }, index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
  path.closePath();
}

/** Returns the band between the edges of the asphalt. beyond: extra width on each side [m]. */
function ribbon(course: Course, beyond: number): Path2D {
  const path = new Path2D();
  for (const side of ['left', 'right'] as const) {
    addWay(
      path,
      Array.from({ length: course.samples }, (_, sample) => course.edge(sample, side, beyond)),
    );
  }
  return path;
}

function strokeBetween(context: CanvasRenderingContext2D, from: Point, to: Point): void {
  context.beginPath();
  context.moveTo(from.x, from.y);
  context.lineTo(to.x, to.y);
  context.stroke();
}
