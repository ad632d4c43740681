// The reference line: the lap of minimum time, or a substitute.

import type { LineFrame } from '../wire/frames';
import type { Course } from './course';

/** What the line requires at a point. */
export type Zone = 'accelerate' | 'hold' | 'brake';

// Accelerations below this count as constant speed [m/s²].
const HOLD = 0.35;

export class ReferenceLine {
  readonly count: number;
  readonly zones: Zone[];
  readonly lapS: number;
  readonly fastest: number; // [m/s]
  readonly slowest: number; // [m/s]

  constructor(readonly frame: LineFrame) {
    this.count = frame.x.length;
    this.zones = Array.from({ length: this.count }, (_, i) => this.zoneAt(i));
    this.lapS = frame.lapS;
    const speeds = Array.from(frame.speed);
    this.fastest = Math.max(...speeds);
    this.slowest = Math.min(...speeds);
  }

  /** Returns the index of the point nearest to (x, y), looking near `around` where it is given. */
  nearest(x: number, y: number, around = -1): number {
    const reach = around < 0 ? this.count : Math.min(this.count, 60);
    const first = around < 0 ? 0 : around - (reach >> 1);
    let best = 0;
    let least = Infinity;
    for (let step = 0; step < reach; step++) {
      const index = (((first + step) % this.count) + this.count) % this.count;
      const square = (this.frame.x[index]! - x) ** 2 + (this.frame.y[index]! - y) ** 2;
      if (square < least) {
        least = square;
        best = index;
      }
    }
    return best;
  }

  private zoneAt(index: number): Zone {
    const next = (index + 1) % this.count;
    const speed = this.frame.speed[index]!;
    const gain = (this.frame.speed[next]! ** 2 - speed ** 2) / (2 * this.frame.spacing);
    if (gain > HOLD) return 'accelerate';
    return gain < -HOLD ? 'brake' : 'hold';
  }
}

/** A lap as times and speeds at equal steps of progress, the start first. */
export interface LapTrace {
  seconds: Float64Array; // since the lap began, NaN if unknown
  speeds: Float64Array; // [m/s]
}

/** Returns the reference line's lap at `bins` steps of a course's progress. */
export function referenceTrace(line: ReferenceLine, course: Course, bins: number): LapTrace {
  const seconds = new Float64Array(bins);
  const speeds = new Float64Array(bins);
  let near = -1;
  for (let bin = 0; bin < bins; bin++) {
    const sample = course.sampleAt((bin * course.length) / bins);
    near = line.nearest(course.x(sample), course.y(sample), near);
    seconds[bin] = line.frame.time[near]!;
    speeds[bin] = line.frame.speed[near]!;
  }
  const begin = seconds[0] ?? 0;
  return {
    seconds: seconds.map((time, bin) => {
      // The point beside the timing line may be the last of the line as well as the first.
      const laps = Math.round(bin / bins - (time - begin) / line.lapS || 0);
      return time - begin + laps * line.lapS;
    }),
    speeds,
  };
}
