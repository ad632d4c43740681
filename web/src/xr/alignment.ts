// The track where it really is: two of its points are touched with a controller.

import type { Point } from '../race/course';
import { byTwoPoints, type Matrix, type Spot } from './frames';

export class Alignment {
  matrix: Matrix | null = null;
  hasRefused = false; // the points touched last
  private readonly spots: Spot[] = [];

  /** How many points are touched: 0 or 1, or 2 once the track is aligned. */
  get touched(): number {
    return this.matrix ? 2 : this.spots.length;
  }

  /** Takes a place in the room; every second one completes a pair. track: the points meant. */
  touch(at: Spot, track: [Point, Point]): void {
    this.hasRefused = false;
    this.matrix = null;
    this.spots.push(at);
    const [first, second] = this.spots;
    if (!first || !second) return;
    this.matrix = byTwoPoints(track, [first, second]);
    this.hasRefused = this.matrix === null;
    this.spots.length = 0;
  }
}
