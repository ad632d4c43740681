// The path of each kart in the last seconds.

import type { SnapshotFrame } from '../wire/frames';

const LENGTH_TICKS = 150;
const STEP_TICKS = 4;

export interface Mark {
  tick: number;
  x: number;
  y: number;
  speed: number;
}

export class Trails {
  readonly marks = new Map<number, Mark[]>();
  /** The fastest that any kart was [m/s]: the end of the scale of colours. */
  fastest = 1;

  note(frame: SnapshotFrame): void {
    for (const { seat, x, y, speed } of frame.karts) {
      const marks = this.marks.get(seat) ?? [];
      this.marks.set(seat, marks);
      const last = marks.at(-1);
      if (last && frame.tick < last.tick + STEP_TICKS) continue;
      marks.push({ tick: frame.tick, x, y, speed });
      while (marks[0] && marks[0].tick < frame.tick - LENGTH_TICKS) marks.shift();
      this.fastest = Math.max(this.fastest, speed);
    }
  }

  clear(): void {
    this.marks.clear();
    this.fastest = 1;
  }
}
