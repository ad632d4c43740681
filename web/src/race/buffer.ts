// A buffer of snapshots for the display: drawn with a fixed delay after they were made, in between
// interpolated, so that an uneven network does not shake the karts.

import type { KartFrame, SnapshotFrame, TrailerFrame } from '../wire/frames';

export const WATCH_DELAY_MS = 100;
export const DRIVE_DELAY_MS = 35;
const MOST_FRAMES = 90;
// Window over which the least delayed snapshot gives the delay of the network.
const WINDOW_MS = 2000;
// Longest extrapolation beyond the newest snapshot.
const FORWARD_MS = 100;
// Time constant with which the playhead follows a change of the network.
const SLEW_MS = 400;
const JUMP_MS = 300;

interface Lead {
  atMs: number;
  leadMs: number;
}

export class SnapshotBuffer {
  delayMs = WATCH_DELAY_MS;
  newest: SnapshotFrame | null = null;
  newestAtMs = 0;
  private frames: SnapshotFrame[] = [];
  private leads: Lead[] = [];
  private shiftMs: number | null = null;
  private shownMs = 0;
  private rate = 1;

  constructor(private readonly isRecording = false) {}

  /** Rate of the snapshots' time, 0 for a paused recording. */
  setRate(rate: number): void {
    if (rate === this.rate) return;
    this.rate = rate;
    this.restart();
  }

  clear(): void {
    this.frames = [];
    this.newest = null;
    this.restart();
  }

  push(frame: SnapshotFrame, arrivedMs: number): void {
    const stamp = this.stampOf(frame);
    if (this.newest) {
      const step = stamp - this.stampOf(this.newest);
      if (frame.epoch !== this.newest.epoch || step < 0 || step > WINDOW_MS) this.clear();
      else if (step === 0) this.frames.pop();
    }
    this.frames.push(frame);
    if (this.frames.length > MOST_FRAMES) this.frames.shift();
    this.newest = frame;
    this.newestAtMs = arrivedMs;
    this.leads.push({ atMs: arrivedMs, leadMs: stamp - this.rate * arrivedMs });
    while (this.leads[0]!.atMs < arrivedMs - WINDOW_MS) this.leads.shift();
  }

  /** Returns the time of snapshots that is to be drawn now [ms]; see `stampOf`. */
  playheadMs(nowMs: number): number {
    if (!this.newest) return 0;
    if (this.rate === 0) return this.stampOf(this.newest);
    const lead = Math.max(...this.leads.map((sample) => sample.leadMs));
    const wanted = lead - this.delayMs * this.rate;
    if (this.shiftMs === null || Math.abs(wanted - this.shiftMs) > JUMP_MS * this.rate) {
      this.shiftMs = wanted;
    } else {
      this.shiftMs += (wanted - this.shiftMs) * Math.min((nowMs - this.shownMs) / SLEW_MS, 1);
    }
    this.shownMs = nowMs;
    return this.rate * nowMs + this.shiftMs;
  }

  /** Returns the snapshot to draw now, its karts interpolated. */
  sample(nowMs: number): SnapshotFrame | null {
    return this.sampleAt(this.playheadMs(nowMs));
  }

  /** Returns the race at a time of snapshots [ms], beyond the newest one extrapolated. */
  sampleAt(playhead: number): SnapshotFrame | null {
    const last = this.frames.length - 1;
    if (last < 0) return null;
    let after = last;
    while (after > 0 && this.stampOf(this.frames[after - 1]!) >= playhead) after--;
    const late = this.frames[after]!;
    const early = this.frames[Math.max(after - 1, 0)]!;
    const from = this.stampOf(early);
    const to = this.stampOf(late);
    if (playhead > to) return forward(late, Math.min(playhead - to, FORWARD_MS) / 1000);
    const share = to > from ? Math.max((playhead - from) / (to - from), 0) : 1;
    return between(early, late, share);
  }

  /** Returns when a snapshot was made [ms]: by the server's clock, or in a recording's own time. */
  stampOf(frame: SnapshotFrame): number {
    return this.isRecording ? (frame.tick * 1000) / 60 : frame.serverMs;
  }

  private restart(): void {
    this.leads = [];
    this.shiftMs = null;
    const newest = this.newest;
    if (newest) this.leads.push({ atMs: this.newestAtMs, leadMs: this.leadOf(newest) });
  }

  private leadOf(frame: SnapshotFrame): number {
    return this.stampOf(frame) - this.rate * this.newestAtMs;
  }
}

/** Returns the later of two snapshots, its karts at a share of the way to it. */
export function between(early: SnapshotFrame, late: SnapshotFrame, share: number): SnapshotFrame {
  if (early === late || share >= 1) return late;
  const before = new Map(early.karts.map((kart) => [kart.seat, kart]));
  const karts = late.karts.map((kart) => {
    const old = before.get(kart.seat);
    // A kart that was moved is not drawn in between.
    const isFar = old && Math.hypot(kart.x - old.x, kart.y - old.y) > 1 + 3 * Math.abs(old.speed);
    return old && !isFar ? blend(old, kart, share) : kart;
  });
  const lights = early.lights + share * (late.lights - early.lights);
  const tick = early.tick + share * (late.tick - early.tick);
  const walkers = late.walkers.map((walker, row) => {
    const old = early.walkers[row] ?? walker;
    return {
      ...walker,
      x: old.x + share * (walker.x - old.x),
      y: old.y + share * (walker.y - old.y),
    };
  });
  const trailers = late.trailers.map((trailer, row) => {
    const old = early.trailers[row];
    return old?.seat === trailer.seat ? blendTrailer(old, trailer, share) : trailer;
  });
  return { ...late, karts, walkers, trailers, lights, tick };
}

function blendTrailer(early: TrailerFrame, late: TrailerFrame, share: number): TrailerFrame {
  return {
    ...late,
    x: early.x + share * (late.x - early.x),
    y: early.y + share * (late.y - early.y),
    heading: early.heading + share * wrap(late.heading - early.heading),
  };
}

function blend(early: KartFrame, late: KartFrame, share: number): KartFrame {
  const turn = wrap(late.heading - early.heading);
  return {
    ...late,
    x: early.x + share * (late.x - early.x),
    y: early.y + share * (late.y - early.y),
    heading: early.heading + share * turn,
    speed: early.speed + share * (late.speed - early.speed),
    steering: early.steering + share * (late.steering - early.steering),
  };
}

/** Returns a snapshot extrapolated by `seconds`. */
function forward(frame: SnapshotFrame, seconds: number): SnapshotFrame {
  if (seconds <= 0 || frame.lights > 0) return frame;
  const karts = frame.karts.map((kart) => {
    const heading = kart.heading + 0.5 * kart.yawRate * seconds;
    const step = kart.speed * seconds;
    return {
      ...kart,
      x: kart.x + step * Math.cos(heading),
      y: kart.y + step * Math.sin(heading),
      heading: kart.heading + kart.yawRate * seconds,
    };
  });
  return { ...frame, karts };
}

/** Returns an angle in [-pi, pi). */
export function wrap(angle: number): number {
  return angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
}
