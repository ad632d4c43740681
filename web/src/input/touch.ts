// Touch: the left thumb steers relative to where it touched first, the right one holds a pedal.

import { Button } from '../wire/tables';
import { type Device, type Wheel, clamp, pedals } from './wheel';

// Distance from the first touch for full lock [pixels].
const LOCK_PIXELS = 80;
const PRESS_MS = 150;

/** Returns whether this is a touch screen. */
export function hasThumbs(): boolean {
  return matchMedia('(pointer: coarse)').matches;
}

export class Touch implements Device {
  readonly name = 'touch';
  movedMs = -Infinity;
  private origin: number | null = null;
  private steering = 0;
  private go = 0;
  private stop = 0;
  private itemMs = -Infinity;
  private rescueMs = -Infinity;

  get isThere(): boolean {
    return this.movedMs > -Infinity;
  }

  /** The steering thumb is at `x` [pixels], or has left. */
  steer(x: number | null, nowMs: number): void {
    if (x === null) [this.origin, this.steering] = [null, 0];
    else {
      this.origin ??= x;
      this.steering = clamp((this.origin - x) / LOCK_PIXELS, -1, 1);
    }
    this.movedMs = nowMs;
  }

  pedal(which: 'go' | 'stop', share: number, nowMs: number): void {
    this[which] = share;
    this.movedMs = nowMs;
  }

  press(which: 'item' | 'rescue', nowMs: number): void {
    if (which === 'item') this.itemMs = nowMs;
    else this.rescueMs = nowMs;
    this.movedMs = nowMs;
  }

  read(nowMs: number, speed: number): Wheel {
    const buttons =
      (nowMs - this.itemMs < PRESS_MS ? Button.USE_ITEM : 0) |
      (nowMs - this.rescueMs < PRESS_MS ? Button.ACCEPT_RESCUE : 0);
    return { steering: this.steering, ...pedals(this.go, this.stop, speed), buttons };
  }

  release(): void {
    this.origin = null;
    [this.steering, this.go, this.stop] = [0, 0, 0];
    [this.itemMs, this.rescueMs] = [-Infinity, -Infinity];
  }
}
