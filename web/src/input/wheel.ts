// What every device gives: steering and pedals, and when it was moved last.

export interface Wheel {
  steering: number; // [-1, 1], left positive
  throttle: number; // [-1, 1], negative for reverse
  brake: number; // [0, 1]
  buttons: number; // see Button
}

export type DeviceName = 'keyboard' | 'gamepad' | 'touch';

export interface Device {
  readonly name: DeviceName;
  /** When it was moved last [ms of performance.now()], -Infinity if never. */
  readonly movedMs: number;
  /** Whether it is connected: an unplugged gamepad is not. */
  readonly isThere: boolean;
  /** Returns its current values. speed: of the kart [m/s]. */
  read(nowMs: number, speed: number): Wheel;
  /** Releases everything, as when the page is left. */
  release(): void;
}

export const NEUTRAL: Wheel = { steering: 0, throttle: 0, brake: 0, buttons: 0 };

// Slower than this a kart counts as standing: braking then becomes reverse [m/s].
const STANDS = 0.25;
const REVERSE = 0.6;

/** Returns throttle and brake for two pedals: braking a standing kart is reverse. */
export function pedals(go: number, stop: number, speed: number): Pick<Wheel, 'throttle' | 'brake'> {
  if (stop > 0.05 && go < 0.05 && speed < STANDS) return { throttle: -REVERSE * stop, brake: 0 };
  return { throttle: stop > 0.05 ? 0 : go, brake: stop };
}

const GRAVITY = 9.81; // [m/s²]
// Tyres slip a little before they lose grip, so steering may be somewhat larger.
const SLIP = 1.25;

/** Returns the most steering [0, 1] at a speed [m/s] before the tyres lose grip. */
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
