// An earlier lap, or attempt, that a driver of a time trial drives against.

import type { GhostFrame } from '../wire/eventFrames';
import type { KartFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import { TICKS_PER_SECOND } from './clock';
import type { Course } from './course';
import type { Pace } from './pace';

/** Which one is shown: the best of all, the own best of the driver, or none. */
export const GHOST_CHOICES = ['best', 'own', 'none'] as const;
export type GhostChoice = (typeof GHOST_CHOICES)[number];

// It is drawn behind all karts.
const LAST = 1000;

/** Where a kart is on the lap, or the attempt, that it drives against a ghost. */
interface Stand {
  seconds: number; // since its beginning
  distance: number; // [m] since its beginning
}

export class Ghost {
  constructor(readonly frame: GhostFrame) {}

  /** Returns when the ghost had come this far [s], NaN beyond its samples. */
  secondsAt(distance: number): number {
    return interpolated(this.frame.distance, this.frame.seconds, distance);
  }

  /** Returns the ghost as a kart at a tick of a race, null where it is not on the track. */
  kartAt(tick: number, pace: Pace, startTick: number): KartFrame | null {
    const begun = this.beginOf(pace, startTick);
    const seconds = (tick - begun) / TICKS_PER_SECOND;
    const { x, y, seconds: times, seat, timeUs } = this.frame;
    if (!(seconds >= 0) || seconds > timeUs / 1e6) return null;
    const at = interpolated(times, x, seconds);
    const across = interpolated(times, y, seconds);
    const back = Math.max(seconds - 0.1, 0);
    const ahead = back + 0.1;
    const dx = interpolated(times, x, ahead) - interpolated(times, x, back);
    const dy = interpolated(times, y, ahead) - interpolated(times, y, back);
    if (Number.isNaN(at + across)) return null;
    return {
      ...NOTHING,
      seat,
      x: at,
      y: across,
      heading: Number.isNaN(dx + dy) ? 0 : Math.atan2(dy, dx),
      speed: Math.hypot(dx, dy) / 0.1 || 0,
    };
  }

  /** Returns how much later than the ghost a kart is [s], NaN if unknown. */
  deltaOf(pace: Pace, tick: number, startTick: number): number {
    const begun = this.beginOf(pace, startTick);
    const { seconds, distance }: Stand = {
      seconds: (tick - begun) / TICKS_PER_SECOND,
      distance: this.frame.fromLights ? pace.distance : pace.distance - pace.lap * pace.lapLength,
    };
    return seconds - this.secondsAt(distance);
  }

  /**
   * Returns by how much each sector of a lap was slower than the ghost's [s]; undefined for those
   * to come. lap: from 0; sectors: [µs] of the sectors so far, 0 for those to come.
   */
  sectorDeltas(course: Course, lap: number, sectors: readonly number[]): (number | undefined)[] {
    const lines = course.sectorLines.map((line) => line || course.length);
    const begin = this.frame.fromLights ? lap * course.length : 0;
    let before = begin > 0 ? this.secondsAt(begin) : 0;
    return lines.map((line, sector) => {
      const at = this.secondsAt(begin + line);
      const own = sectors[sector];
      const took = at - before;
      before = at;
      return !own || Number.isNaN(took) ? undefined : own / 1e6 - took;
    });
  }

  /** The tick at which the kart began what is compared. */
  private beginOf(pace: Pace, startTick: number): number {
    if (this.frame.fromLights) return startTick;
    return pace.lap < 0 ? NaN : pace.tickAt(pace.lap * pace.lapLength);
  }
}

/** Returns the ghost that a choice means; without an own best it is the best of all. */
export function chosenGhost(
  ghosts: readonly Ghost[],
  choice: GhostChoice,
): Ghost | null {
  if (choice === 'none') return null;
  const own = ghosts.find(({ frame }) => !frame.isBest);
  const best = ghosts.find(({ frame }) => frame.isBest);
  return (choice === 'own' ? (own ?? best) : (best ?? own)) ?? null;
}

/** Returns `values` at `at` among `keys`, which rise; NaN outside of them. */
function interpolated(keys: ArrayLike<number>, values: ArrayLike<number>, at: number): number {
  const last = keys.length - 1;
  if (last < 1 || !(at >= keys[0]!) || at > keys[last]! + 1e-3) return NaN;
  let [low, high] = [0, last];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (keys[middle]! <= at) low = middle;
    else high = middle;
  }
  const span = keys[high]! - keys[low]!;
  const share = span > 0 ? Math.min((at - keys[low]!) / span, 1) : 0;
  return values[low]! + share * (values[high]! - values[low]!);
}

const NOTHING: KartFrame = {
  seat: 0,
  x: 0,
  y: 0,
  heading: 0,
  speed: 0,
  lateralSpeed: 0,
  yawRate: 0,
  steering: 0,
  progress: 0,
  speedCap: 0,
  acknowledged: 0,
  laps: 0,
  rank: LAST,
  status: Status.RACING,
  item: 0,
  effects: 0,
  flags: 0,
  isGhost: true,
};
