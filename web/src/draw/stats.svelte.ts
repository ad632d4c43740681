// What tests read of the page at window.__race, where the address says #stats=1.

import type { Visit } from '../race/visit.svelte';
import type { Meter } from './meter';

export interface Stats {
  frame_ms: { p50: number; p95: number };
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
    progress: number;
    laps: number;
    rank: number;
    item: number;
  }[];
  /** The reference line: x, y, speed of each point. */
  line: () => [number, number, number][];
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
    delay_ms: meter.delayMs,
    frames: meter.frameCount,
    tick: newest?.tick ?? -1,
    phase: newest?.phase ?? 0,
    lap_length: race.course?.length ?? 0,
    karts: (newest?.karts ?? []).map(
      ({ seat, x, y, heading, speed, progress, laps, rank, item }) => ({
        seat,
        x,
        y,
        heading,
        speed,
        progress,
        laps,
        rank,
        item,
      }),
    ),
    line: () => {
      const line = race.line?.frame;
      if (!line) return [];
      return Array.from(line.x, (x, i) => [x, line.y[i]!, line.speed[i]!]);
    },
  };
}
