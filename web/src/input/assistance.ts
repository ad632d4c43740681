// How much a driver is helped: from an empty road to a kart that brakes and accelerates by itself.
// Help follows the reference line; where a race has none, nobody is helped. The driver steers, and
// a foot on the brake always counts.

import type { ReferenceLine } from '../race/line';
import { Flag, KartFlag, Phase, Status } from '../wire/tables';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { clamp, type Wheel } from './wheel';

/** From the least to the most: each has what the one before it has. */
export const LEVELS = ['none', 'line', 'brakes', 'pedals'] as const;
export type Level = (typeof LEVELS)[number];

export interface Helped {
  wheel: Wheel;
  does: 'accelerate' | 'brake' | null; // what the driver did not
}

export interface Situation {
  own: KartFrame;
  frame: SnapshotFrame;
  flag: number; // shown to this kart
  line: ReferenceLine | null;
}

// In the slowest bend a driver is held to so much of the line's speed, on the fastest straight to
// all of it: people miss the line by a metre, and bends are tighter there.
const BEND_SHARE = 0.85;
// From what one sees to brakes that bite [s].
const LATE_S = 0.2;
// So much too fast, as a share, is braked for fully; so much too slow is full throttle.
const RANGE = 0.1;
const LEAST_SPEED = 0.1; // [m/s]
const PRESSED = 0.05; // of a pedal

/** Returns what goes to the kart when a driver who is helped holds the wheel so. */
export function help(level: Level, wheel: Wheel, situation: Situation): Helped {
  const { own, line } = situation;
  const alone = { wheel, does: null };
  const isHelped = level === 'brakes' || level === 'pedals';
  // Who reverses, or stands across the track, has to get out alone.
  if (!isHelped || !line || wheel.throttle < 0 || !isRacing(situation)) return alone;
  const near = line.nearest(own.x, own.y);
  if (!isAlong(line, near, own.heading)) return alone;
  const left = Math.min(allowedSpeed(line, near, own.speed), own.speedCap);
  const allowed = Math.max(left, LEAST_SPEED);
  const over = (own.speed - allowed) / (RANGE * allowed);
  if (over > 0) {
    const brake = Math.max(wheel.brake, Math.min(over, 1));
    const does = wheel.brake < PRESSED ? 'brake' : null;
    return { wheel: { ...wheel, throttle: 0, brake }, does };
  }
  if (level === 'brakes' || wheel.brake > PRESSED) return alone;
  const throttle = clamp(-over, 0, 1);
  const isOwn = wheel.throttle > PRESSED;
  return { wheel: { ...wheel, throttle, brake: 0 }, does: isOwn ? null : 'accelerate' };
}

/** Returns the speed [m/s] that a driver is left at a point of the line, and a moment later. */
export function allowedSpeed(line: ReferenceLine, near: number, speed: number): number {
  const samples = Math.round((LATE_S * Math.max(speed, 0)) / line.frame.spacing);
  const later = (near + samples) % line.count;
  return Math.min(withMargin(line, near), withMargin(line, later));
}

function withMargin(line: ReferenceLine, index: number): number {
  const speed = line.frame.speed[index]!;
  const span = line.fastest - line.slowest;
  const share = span > 0 ? (speed - line.slowest) / span : 1;
  return speed * (BEND_SHARE + (1 - BEND_SHARE) * share);
}

function isRacing({ own, frame, flag }: Situation): boolean {
  const isOut = own.flags & (KartFlag.WRONG_WAY | KartFlag.RESCUE_OFFERED);
  const isOn = frame.phase === Phase.RUNNING && frame.lights <= 0 && flag !== Flag.RED;
  return isOn && own.status === Status.RACING && !isOut;
}

/** Returns whether a heading [rad] is within 60° of the line's direction. */
function isAlong(line: ReferenceLine, near: number, heading: number): boolean {
  const { x, y } = line.frame;
  const next = (near + 1) % line.count;
  const [dx, dy] = [x[next]! - x[near]!, y[next]! - y[near]!];
  return dx * Math.cos(heading) + dy * Math.sin(heading) > 0.5 * Math.hypot(dx, dy);
}
