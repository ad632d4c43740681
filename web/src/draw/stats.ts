// What tests read of the page at window.__race, where the address says #stats=1.

import type { Course } from '../race/course';
import type { Visit } from '../race/visit.svelte';
import type { Meter } from './meter';

export interface Stats {
  frame_ms: { p50: number; p95: number };
  interval_ms: { p50: number; p95: number };
  delay_ms: { p50: number; p95: number };
  frames: number;
  tick: number;
  phase: number;
  lap_length: number;
  karts: {
    seat: number;
    x: number;
    y: number;
    heading: number;
    speed: number;
    steering: number;
    progress: number;
    laps: number;
    rank: number;
    item: number;
  }[];
  /** The points of the centre line. */
  way: () => [number, number][];
}

declare global {
  interface Window {
    __race?: Stats;
  }
}

export function publishStats(visit: Visit, meter: Meter): void {
  const { race } = visit;
  const newest = race.buffer.newest;
  window.__race = {
    frame_ms: meter.frameMs,
    interval_ms: meter.intervalMs,
    delay_ms: meter.delayMs,
    frames: meter.frameCount,
    tick: newest?.tick ?? -1,
    phase: newest?.phase ?? 0,
    lap_length: race.course?.length ?? 0,
    karts: (newest?.karts ?? []).map(
      ({ seat, x, y, heading, speed, steering, progress, laps, rank, item }) => ({
        seat,
        x,
        y,
        heading,
        speed,
        steering,
        progress,
        laps,
        rank,
        item,
      }),
    ),
    way: () => wayOf(race.course),
  };
}

function wayOf(course: Course | null): [number, number][] {
  if (!course) return [];
  return Array.from({ length: course.samples }, (_, i) => [course.x(i), course.y(i)]);
}
