// What a kart sounds like, and which tones tell what happens to it. Pure.

import type { Alert } from '../race/danger';
import type { EventFrame, KartFrame } from '../wire/frames';
import { EventKind, Status } from '../wire/tables';

export interface Mix {
  pitch: number; // of the motor [Hz]
  motor: number; // loudness, 0 to 1
  squeal: number; // of the tyres, 0 to 1
}

// The motor turns so fast at rest and at top speed.
const [IDLE_HZ, TOP_HZ] = [42, 190];
const [IDLE_LOUD, TOP_LOUD] = [0.25, 0.8];
// Tyres begin to be heard at this angle of slip, and are loudest at that one [rad].
const [SLIP_HEARD, SLIP_LOUD] = [0.06, 0.3];
// Below this share of the top speed they do not squeal.
const SQUEAL_FROM = 0.12;

/** Returns how a kart sounds. topSpeed: of its vehicle [m/s]. */
export function mixOf(kart: KartFrame, topSpeed: number): Mix {
  if (kart.status !== Status.RACING) return { pitch: IDLE_HZ, motor: 0, squeal: 0 };
  const share = Math.min(Math.abs(kart.speed) / Math.max(topSpeed, 1e-3), 1.3);
  const slip = Math.abs(Math.atan2(kart.lateralSpeed, Math.max(Math.abs(kart.speed), 1e-3)));
  const heard = (slip - SLIP_HEARD) / (SLIP_LOUD - SLIP_HEARD);
  return {
    pitch: IDLE_HZ + (TOP_HZ - IDLE_HZ) * share,
    motor: IDLE_LOUD + (TOP_LOUD - IDLE_LOUD) * Math.min(share, 1),
    squeal: share < SQUEAL_FROM ? 0 : Math.min(Math.max(heard, 0), 1),
  };
}

/** A tone that glides from one pitch to another. */
export interface Tone {
  from: number; // [Hz]
  to: number;
  seconds: number;
  after: number; // [s] until it begins
}

const PICK_UP: Tone[] = [
  { from: 660, to: 660, seconds: 0.08, after: 0 },
  { from: 990, to: 990, seconds: 0.14, after: 0.09 },
];
const USE: Tone[] = [{ from: 300, to: 900, seconds: 0.22, after: 0 }];
const HIT: Tone[] = [{ from: 520, to: 110, seconds: 0.4, after: 0 }];
const BLOCKED: Tone[] = [{ from: 900, to: 900, seconds: 0.2, after: 0 }];
const LAP: Tone[] = [
  { from: 880, to: 880, seconds: 0.07, after: 0 },
  { from: 880, to: 880, seconds: 0.07, after: 0.11 },
];
const OF_EVENTS: Partial<Record<EventKind, Tone[]>> = {
  [EventKind.PICK_UP]: PICK_UP,
  [EventKind.USE]: USE,
  [EventKind.HIT]: HIT,
  [EventKind.BLOCKED_HIT]: BLOCKED,
  [EventKind.LAP]: LAP,
};
const URGENT: Tone[] = [0, 0.14, 0.28].map((after) => ({
  from: 1250,
  to: 1250,
  seconds: 0.08,
  after,
}));
const MILD: Tone[] = [{ from: 760, to: 760, seconds: 0.12, after: 0 }];
const URGENT_ALERTS: readonly Alert[] = ['kartBrakes', 'kartWarns', 'red', 'wrongWay', 'danger', 'kart', 'link'];

/** Returns the tones for what happened to a kart. */
export function tonesOfEvent(event: EventFrame, seat: number): readonly Tone[] {
  return event.kart === seat ? (OF_EVENTS[event.kind as EventKind] ?? []) : [];
}

/** Returns the tones for warnings that were not there before. */
export function tonesOfAlerts(before: readonly Alert[], now: readonly Alert[]): readonly Tone[] {
  const fresh = now.filter((alert) => !before.includes(alert));
  if (!fresh.length) return [];
  return fresh.some((alert) => URGENT_ALERTS.includes(alert)) ? URGENT : MILD;
}
