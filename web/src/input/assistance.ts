// Driving assistance: from none to a kart that brakes and accelerates by itself.
// It follows the reference line; a race without one has no assistance. The driver steers, and
// pressing the brake always counts.

import type { ReferenceLine } from '../race/line';
import { Flag, KartFlag, Phase, Status } from '../wire/tables';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { clamp, type Wheel } from './wheel';

/** From least to most: each includes the one before it. */
export const LEVELS = ['none', 'line', 'brakes', 'pedals'] as const;
export type Level = (typeof LEVELS)[number];
/** What a driver chooses from: also help with the pedals only where a coach says so, which fades. */
export const CHOICES = [...LEVELS, 'fading'] as const;
export type Choice = (typeof CHOICES)[number];

export interface Helped {
  wheel: Wheel;
  does: 'accelerate' | 'brake' | null; // what the assistance does now
}

export interface Situation {
  own: KartFrame;
  frame: SnapshotFrame;
  flag: number; // shown to this kart
  line: ReferenceLine | null;
}

// In the slowest bend the limit is this share of the line's speed, on the fastest straight
// all of it: people miss the line by a metre, and bends are tighter there.
const BEND_SHARE = 0.85;
// Delay from the picture to the action of the brakes [s].
const LATE_S = 0.2;
// Relative excess of speed for full brake, relative lack of speed for full throttle.
const RANGE = 0.1;
const LEAST_SPEED = 0.1; // [m/s]
const PRESSED = 0.05; // of a pedal

/** Returns the controls of the kart for a driver's input with assistance. */
export function help(level: Level, wheel: Wheel, situation: Situation): Helped {
  const { own, line } = situation;
  const alone = { wheel, does: null };
  const isHelped = level === 'brakes' || level === 'pedals';
  // No assistance in reverse, or across the track.
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

/** Returns the allowed speed [m/s] at a point of the line, and a moment later. */
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
