// A course as it is drawn and measured: from the samples of its centre line.

import type { CourseFrame } from '../wire/frames';

export interface Point {
  x: number; // [m] east
  y: number; // [m] north
}

export interface Box {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

export class Course {
  readonly samples: number;
  readonly length: number; // [m] of the centre line
  readonly loops: Point[][]; // borders, each a closed path
  readonly box: Box; // around all borders

  private readonly edgeLines = new Map<string, readonly Point[]>();

  constructor(readonly frame: CourseFrame) {
    this.samples = frame.line.length / 4;
    this.length = this.samples * frame.spacing;
    this.loops = loopsOf(frame.borders);
    this.box = boxOf(this.loops.flat());
  }

  /** Whether it is a car park: nothing to race along. */
  get isLot(): boolean {
    return this.samples === 0;
  }

  x(sample: number): number {
    return this.frame.line[4 * sample]!;
  }

  y(sample: number): number {
    return this.frame.line[4 * sample + 1]!;
  }

  heading(sample: number): number {
    return this.frame.line[4 * sample + 2]!;
  }

  curvature(sample: number): number {
    return this.frame.line[4 * sample + 3]!;
  }

  /** Returns the sample at a progress [m], which may lie beyond a lap. */
  sampleAt(progress: number): number {
    const index = Math.round(progress / this.frame.spacing) % this.samples;
    return index < 0 ? index + this.samples : index;
  }

  /** Returns the point beside a sample. offset: to the left [m]. */
  beside(sample: number, offset: number): Point {
    const heading = this.heading(sample);
    return {
      x: this.x(sample) - offset * Math.sin(heading),
      y: this.y(sample) + offset * Math.cos(heading),
    };
  }

  /** Returns the edge of the asphalt. beyond: distance further out [m]. */
  edge(sample: number, side: 'left' | 'right', beyond = 0): Point {
    const left = this.frame.halfWidths[2 * sample]!;
    const right = this.frame.halfWidths[2 * sample + 1]!;
    return this.beside(sample, side === 'left' ? left + beyond : -right - beyond);
  }

  /** Returns an edge of the asphalt as points about `step` metres apart; cached. */
  edgeLine(side: 'left' | 'right', beyond: number, step: number): readonly Point[] {
    const name = `${side} ${beyond} ${step}`;
    let line = this.edgeLines.get(name);
    if (!line) {
      const stride = Math.max(Math.floor(step / this.frame.spacing), 1);
      const count = Math.ceil(this.samples / stride);
      line = Array.from({ length: count }, (_, i) => this.edge(i * stride, side, beyond));
      this.edgeLines.set(name, line);
    }
    return line;
  }

  /** Progress of the lines at which sectors end, the timing line last [m]. */
  get sectorLines(): number[] {
    const { gates, sectors } = this.frame;
    return sectors.map((gate) => gates[gate] ?? 0);
  }
}

/** Returns wall segments as closed paths. borders: x0, y0, x1, y1 of each. */
export function loopsOf(borders: ArrayLike<number>): Point[][] {
  const loops: Point[][] = [];
  let loop: Point[] = [];
  for (let i = 0; i + 3 < borders.length; i += 4) {
    const start = { x: borders[i]!, y: borders[i + 1]! };
    const end = { x: borders[i + 2]!, y: borders[i + 3]! };
    const last = loop.at(-1);
    if (!last || Math.hypot(last.x - start.x, last.y - start.y) > 1e-6) {
      if (loop.length) loops.push(loop);
      loop = [start];
    }
    loop.push(end);
  }
  if (loop.length) loops.push(loop);
  return loops;
}

function boxOf(points: Point[]): Box {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const { x, y } of points) {
    box.left = Math.min(box.left, x);
    box.right = Math.max(box.right, x);
    box.bottom = Math.min(box.bottom, y);
    box.top = Math.max(box.top, y);
  }
  return box;
}
