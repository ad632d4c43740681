// Time and speed of each kart at equal steps of each lap, the basis of
// gaps, speed traces and deltas.

import type { KartFrame } from '../wire/frames';
import { TICKS_PER_SECOND } from './clock';
import type { LapTrace } from './line';

/** Steps of a lap. */
export const BINS = 240;

export class Pace {
  /** Distance since the start [m], negative on the grid; NaN without data. */
  distance = NaN;
  private ticks: number[] = []; // at which each step was reached
  private speeds: number[] = [];
  private tick = 0;
  private speed = 0;
  private hasCrossed = false;

  constructor(readonly lapLength: number) {}

  /** Records the position of the kart at a tick. isEarly: shortly after the start. */
  note(kart: KartFrame, tick: number, isEarly: boolean): void {
    const distance = this.distanceOf(kart, isEarly);
    const step = this.lapLength / BINS;
    const gained = distance - this.distance;
    if (gained > 0 && gained < 0.25 * this.lapLength && tick > this.tick) {
      const first = Math.max(Math.floor(this.distance / step) + 1, 0);
      for (let bin = first; bin <= Math.floor(distance / step); bin++) {
        const share = (bin * step - this.distance) / gained;
        this.ticks[bin] = this.tick + share * (tick - this.tick);
        this.speeds[bin] = this.speed + share * (kart.speed - this.speed);
      }
    }
    // Backwards, or put back: the steps ahead will be driven again.
    if (!(gained < 0 && gained > -0.25 * this.lapLength)) this.distance = distance;
    this.tick = tick;
    this.speed = kart.speed;
  }

  /** Returns the tick at which a distance was reached, NaN if unknown. */
  tickAt(distance: number): number {
    const place = (distance / this.lapLength) * BINS;
    const bin = Math.floor(place);
    const before = this.ticks[bin] ?? NaN;
    const after = this.ticks[bin + 1] ?? NaN;
    return before + (place - bin) * (after - before);
  }

  /** Returns lap `lap`, counted from 0, as far as it was received. */
  trace(lap: number): LapTrace {
    const seconds = new Float64Array(BINS).fill(NaN);
    const speeds = new Float64Array(BINS).fill(NaN);
    const begin = this.ticks[lap * BINS] ?? NaN;
    for (let bin = 0; bin < BINS; bin++) {
      const tick = this.ticks[lap * BINS + bin];
      if (tick === undefined) continue;
      seconds[bin] = (tick - begin) / TICKS_PER_SECOND;
      speeds[bin] = this.speeds[lap * BINS + bin]!;
    }
    return { seconds, speeds };
  }

  /** The lap that is being driven, counted from 0; -1 before the timing line. */
  get lap(): number {
    return Number.isNaN(this.distance) ? -1 : Math.floor(this.distance / this.lapLength);
  }

  /** Returns the fastest complete lap, -1 if there is none. */
  get bestLap(): number {
    let best = -1;
    let least = Infinity;
    for (let lap = 0; lap < this.lap; lap++) {
      const time = (this.ticks[(lap + 1) * BINS] ?? NaN) - (this.ticks[lap * BINS] ?? NaN);
      if (time < least) [best, least] = [lap, time];
    }
    return best;
  }

  /** Returns a distance [m] in laps. */
  lapsOf(distance: number): number {
    return distance / this.lapLength;
  }

  /** Laps with data. */
  get laps(): number {
    return Math.ceil(this.ticks.length / BINS);
  }

  private distanceOf(kart: KartFrame, isEarly: boolean): number {
    const isBehindLine = kart.laps === 0 && kart.progress > 0.5 * this.lapLength;
    const onGrid = isBehindLine && !this.hasCrossed && (isEarly || this.distance < 0);
    if (!onGrid) this.hasCrossed = true;
    return kart.laps * this.lapLength + kart.progress - (onGrid ? this.lapLength : 0);
  }
}

/** Returns by how many seconds `behind` follows `ahead`, NaN if unknown. */
export function gapBetween(ahead: Pace, behind: Pace, tick: number): number {
  return (tick - ahead.tickAt(behind.distance)) / TICKS_PER_SECOND;
}

/** Returns how much later than in `other` a lap is at its newest step [s], NaN if unknown. */
export function deltaTo(other: LapTrace, lap: LapTrace): number {
  for (let bin = BINS - 1; bin > 0; bin--) {
    const mine = lap.seconds[bin]!;
    if (!Number.isNaN(mine)) return mine - other.seconds[bin]!;
  }
  return NaN;
}
