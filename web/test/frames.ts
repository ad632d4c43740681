// Plain karts and snapshots for tests.

import type {
  CourseFrame,
  EventFrame,
  KartFrame,
  SnapshotFrame,
  StandingFrame,
} from '../src/wire/frames';

export function kart(changes: Partial<KartFrame> = {}): KartFrame {
  return {
    seat: 0,
    x: 0,
    y: 0,
    heading: 0,
    speed: 10,
    lateralSpeed: 0,
    yawRate: 0,
    steering: 0,
    progress: 0,
    speedCap: 40,
    acknowledged: 0,
    laps: 0,
    rank: 1,
    status: 1,
    item: 0,
    effects: 0,
    flags: 0,
    ...changes,
  };
}

export function snapshot(changes: Partial<SnapshotFrame> = {}): SnapshotFrame {
  return {
    kind: 'snapshot',
    serverMs: 0,
    epoch: 1,
    tick: 0,
    lights: 0,
    phase: 2,
    flag: 0,
    karts: [kart()],
    boxes: new Uint8Array(),
    hazards: [],
    walkers: [],
    trailers: [],
    ...changes,
  };
}

export function standing(seat: number, changes: Partial<StandingFrame> = {}): StandingFrame {
  return {
    driver: `driver ${seat}`,
    seat,
    rank: seat + 1,
    laps: 0,
    status: 1,
    lastLapUs: 0,
    bestLapUs: 0,
    raceTimeUs: 0,
    gapUs: 0,
    penalties: 0,
    penaltyUs: 0,
    lapTimesUs: [],
    parking: null,
    planned: null,
    timing: null,
    ...changes,
  };
}

export function event(changes: Partial<EventFrame>): EventFrame {
  return { sequence: 1, tick: 0, kind: 0, kart: 0, other: 0, value: 0, ...changes };
}

/** Returns a round course with samples a metre apart. */
export function roundCourse(samples = 100): CourseFrame {
  const radius = samples / (2 * Math.PI);
  const line = new Float64Array(4 * samples);
  for (let i = 0; i < samples; i++) {
    const angle = (2 * Math.PI * i) / samples;
    line.set(
      [radius * Math.cos(angle), radius * Math.sin(angle), angle + Math.PI / 2, 1 / radius],
      4 * i,
    );
  }
  return {
    kind: 'course',
    name: 'round',
    title: 'Round',
    spacing: 1,
    line,
    halfWidths: new Float64Array(2 * samples).fill(1),
    kerb: 0,
    grass: 0,
    borders: new Float64Array([0, 0, 1, 0, 1, 0, 0, 1, 0, 1, 0, 0, 5, 5, 6, 5, 6, 5, 5, 5]),
    gates: new Float64Array([0, 50]),
    sectors: [1, 0],
    grid: new Float64Array(),
    boxes: new Float64Array(),
    obstacles: new Float64Array(),
    kartLength: 0.45,
    kartWidth: 0.19,
    kartAhead: 0,
    slots: [],
  };
}
