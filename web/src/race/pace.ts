// Time and speed of each kart at equal steps of each lap, the basis of
// gaps, speed traces and deltas.

import type { KartFrame } from '../wire/frames';
import { TICKS_PER_SECOND } from './clock';
import type { LapTrace } from './line';

/** Steps of a lap. */
export const BINS = 240;

/** What is known of one lap, NaN where nothing is. */
interface Steps {
  ticks: Float64Array; // at which each step was reached
  speeds: Float64Array;
}

export class Pace {
  /** Distance since the start [m], negative on the grid; NaN without data. */
  distance = NaN;
  // Of all laps only the line is kept; the steps of this one, the one before and the best.
  private readonly lines: number[] = []; // tick at which each lap began
  private readonly steps = new Map<number, Steps>(); // by lap
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
        const speed = this.speed + share * (kart.speed - this.speed);
        this.keep(bin, this.tick + share * (tick - this.tick), speed);
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
    const before = this.tickOf(bin);
    const after = this.tickOf(bin + 1);
    return before + (place - bin) * (after - before);
  }

  /** Returns lap `lap`, counted from 0, as far as it was received and is kept. */
  trace(lap: number): LapTrace {
    const { ticks, speeds } = this.steps.get(lap) ?? unknown();
    const begin = this.lines[lap] ?? NaN;
    const seconds = ticks.map((tick) => (tick - begin) / TICKS_PER_SECOND);
    return { seconds, speeds: speeds.slice() };
  }

  /** The lap that is being driven, counted from 0; -1 before the timing line. */
  get lap(): number {
    return Number.isNaN(this.distance) ? -1 : Math.floor(this.distance / this.lapLength);
  }

  /** Returns the fastest complete lap, -1 if there is none. */
  get bestLap(): number {
    return this.bestBefore(this.lap);
  }

  /** Returns a distance [m] in laps. */
  lapsOf(distance: number): number {
    return distance / this.lapLength;
  }

  private keep(bin: number, tick: number, speed: number): void {
    const lap = Math.floor(bin / BINS);
    if (bin % BINS === 0) this.lines[lap] = tick;
    if (!this.steps.has(lap)) this.begin(lap);
    const { ticks, speeds } = this.steps.get(lap)!;
    ticks[bin % BINS] = tick;
    speeds[bin % BINS] = speed;
  }

  /** Begins a lap, and forgets those that nobody asks for any more: a race may last a day. */
  private begin(lap: number): void {
    const best = this.bestBefore(lap);
    for (const known of this.steps.keys()) {
      if (known !== lap - 1 && known !== best) this.steps.delete(known);
    }
    this.steps.set(lap, unknown());
  }

  private tickOf(bin: number): number {
    const lap = Math.floor(bin / BINS);
    if (bin % BINS === 0) return this.lines[lap] ?? NaN;
    return this.steps.get(lap)?.ticks[bin % BINS] ?? NaN;
  }

  private bestBefore(end: number): number {
    let best = -1;
    let least = Infinity;
    for (let lap = 0; lap < end; lap++) {
      const time = (this.lines[lap + 1] ?? NaN) - (this.lines[lap] ?? NaN);
      if (time < least) [best, least] = [lap, time];
    }
    return best;
  }

  private distanceOf(kart: KartFrame, isEarly: boolean): number {
    const isBehindLine = kart.laps === 0 && kart.progress > 0.5 * this.lapLength;
    const onGrid = isBehindLine && !this.hasCrossed && (isEarly || this.distance < 0);
    if (!onGrid) this.hasCrossed = true;
    return kart.laps * this.lapLength + kart.progress - (onGrid ? this.lapLength : 0);
  }
}

function unknown(): Steps {
  return { ticks: new Float64Array(BINS).fill(NaN), speeds: new Float64Array(BINS).fill(NaN) };
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
