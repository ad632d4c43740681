// What tests read at window.__race, if the address has #stats=1.

import type { Course } from '../race/course';
import type { ReferenceLine } from '../race/line';
import type { Race } from '../race/race.svelte';
import type { Visit } from '../race/visit.svelte';
import type { KartFrame } from '../wire/frames';
import type { SceneView } from '../scene/view';
import type { Headset } from '../xr/session';
import type { Meter, Share } from './meter';

export interface Stats {
  readonly frame_ms: Share; // that drawing took
  readonly interval_ms: Share; // from one picture to the next
  readonly delay_ms: Share; // from a tick of the server to its picture
  readonly frames: number;
  readonly tick: number;
  readonly phase: number;
  readonly seat: number; // that this page drives, -1 for none
  readonly karts: readonly KartFrame[];
  readonly race: Race;
  /** The points of the centre line. */
  way(): [number, number][];
  /** The points of the reference line. */
  line(): [number, number][];
  scene?: SceneView; // where the race is shown in three dimensions
  headset?: Headset; // once one was put on
}

declare global {
  interface Window {
    __race?: Stats;
  }
}

/** Gives access to a visit; all values are computed on demand. */
export function publishStats(visit: Visit, meter: Meter): void {
  const { race } = visit;
  window.__race = {
    race,
    get frame_ms() {
      return meter.frameMs;
    },
    get interval_ms() {
      return meter.intervalMs;
    },
    get delay_ms() {
      return meter.delayMs;
    },
    get frames() {
      return meter.frameCount;
    },
    get tick() {
      return race.buffer.newest?.tick ?? -1;
    },
    get phase() {
      return race.buffer.newest?.phase ?? 0;
    },
    get seat() {
      return visit.welcome?.seat ?? -1;
    },
    get karts() {
      return race.buffer.newest?.karts ?? [];
    },
    way: () => wayOf(race.course),
    line: () => lineOf(race.line),
  };
}

function wayOf(course: Course | null): [number, number][] {
  if (!course) return [];
  return Array.from({ length: course.samples }, (_, i) => [course.x(i), course.y(i)]);
}

function lineOf(line: ReferenceLine | null): [number, number][] {
  return line ? Array.from(line.frame.x, (east, i) => [east, line.frame.y[i]!]) : [];
}
