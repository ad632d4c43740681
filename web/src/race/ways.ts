// What vehicles have driven in a car park: the whole way, and where they changed direction.

import type { SnapshotFrame } from '../wire/frames';
import type { Point } from './course';

// A point is kept after so many metres [m].
const STEP_M = 0.15;
// Slower than this [m/s] a vehicle drives neither forward nor back, as in the server's count.
const CREEP = 0.02;
// No way has more points: 3 km.
const MOST_POINTS = 20_000;

export interface Way {
  points: Point[]; // of the middle of the body
  turns: Point[]; // where it changed direction
  gear: number; // sign of the last motion
}

export class Ways {
  readonly ways = new Map<number, Way>();

  /** Adds where all vehicles are. ahead: from the centre of gravity to the middle [m]. */
  note(frame: SnapshotFrame, ahead: number): void {
    for (const kart of frame.karts) {
      const point = {
        x: kart.x + ahead * Math.cos(kart.heading),
        y: kart.y + ahead * Math.sin(kart.heading),
      };
      const way = this.ways.get(kart.seat) ?? { points: [], turns: [], gear: 0 };
      this.ways.set(kart.seat, way);
      const gear = Math.abs(kart.speed) > CREEP ? Math.sign(kart.speed) : 0;
      if (gear && way.gear === -gear) way.turns.push(point);
      if (gear) way.gear = gear;
      const last = way.points.at(-1);
      const isNear = last && Math.hypot(point.x - last.x, point.y - last.y) < STEP_M;
      if (!isNear && way.points.length < MOST_POINTS) way.points.push(point);
    }
  }

  clear(): void {
    this.ways.clear();
  }
}
