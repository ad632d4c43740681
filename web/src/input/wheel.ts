// What every device gives: the position of wheel and pedals, and when it was touched last.

export interface Wheel {
  steering: number; // [-1, 1], left positive
  throttle: number; // [-1, 1], negative drives in reverse
  brake: number; // [0, 1]
  buttons: number; // see Button
}

export type DeviceName = 'keyboard' | 'gamepad' | 'touch';

export interface Device {
  readonly name: DeviceName;
  /** When it was moved last [ms of performance.now()], -Infinity if never. */
  readonly movedMs: number;
  /** Whether it is there and held: an unplugged gamepad is not. */
  readonly isThere: boolean;
  /** Returns what it says now. speed: of the kart [m/s]. */
  read(nowMs: number, speed: number): Wheel;
  /** Lets everything go, as when the page is left. */
  release(): void;
}

export const NEUTRAL: Wheel = { steering: 0, throttle: 0, brake: 0, buttons: 0 };

// Slower than this a kart counts as standing: braking then becomes reverse [m/s].
const STANDS = 0.25;
const REVERSE = 0.6;

/** Returns throttle and brake for two pedals: who brakes on a standing kart wants to go back. */
export function pedals(go: number, stop: number, speed: number): Pick<Wheel, 'throttle' | 'brake'> {
  if (stop > 0.05 && go < 0.05 && speed < STANDS) return { throttle: -REVERSE * stop, brake: 0 };
  return { throttle: stop > 0.05 ? 0 : go, brake: stop };
}

const GRAVITY = 9.81; // [m/s²]
// Tyres slip a little before they give way, so the wheel may be turned somewhat further.
const SLIP = 1.25;

/** Returns how far [0, 1] a wheel may be turned at a speed [m/s] before the tyres give way. */
export function tyreLock(vehicle: ReadonlyMap<string, number>, speed: number): number {
  const number = (name: string) => vehicle.get(name) ?? NaN;
  const wheelbase = number('front_axle') + number('rear_axle');
  const curvature = (number('grip') * GRAVITY) / Math.max(speed, 0.1) ** 2;
  const lock = (SLIP * Math.atan(wheelbase * curvature)) / number('steering_limit');
  return Number.isNaN(lock) ? 1 : clamp(lock, 0.05, 1);
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
