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

export function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
