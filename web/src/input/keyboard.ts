// Keys are pressed or not, so steering and pedals move at the speed of a hand, and
// steering is limited by the grip of the tyres.

import { Button } from '../wire/tables';
import { type Device, type Wheel, clamp, pedals } from './wheel';

const LEFT = ['ArrowLeft', 'KeyA'];
const RIGHT = ['ArrowRight', 'KeyD'];
const GO = ['ArrowUp', 'KeyW'];
const STOP = ['ArrowDown', 'KeyS', 'Space'];
const ITEM = ['KeyE', 'Enter'];
const RESCUE = ['KeyR'];
const OURS = new Set([...LEFT, ...RIGHT, ...GO, ...STOP, ...ITEM, ...RESCUE]);
// Time to full lock [s]; back to straight takes less.
const TURN_S = 0.28;
const RETURN_S = 0.16;
const PEDAL_S = 0.15;
// Shortest time for which a press is sent, so that none falls between two messages [ms].
const PRESS_MS = 120;

export class Keyboard implements Device {
  readonly name = 'keyboard';
  movedMs = -Infinity;
  private readonly down = new Set<string>();
  private readonly pressedMs = new Map<string, number>();
  private steering = 0;
  private go = 0;
  private stop = 0;
  private readMs = NaN;

  /** lockAt: most steering [0, 1] at a speed [m/s]. */
  constructor(private readonly lockAt: (speed: number) => number = () => 1) {}

  get isThere(): boolean {
    return this.movedMs > -Infinity;
  }

  /**
   * Handles a key; returns whether it is used here: a key that comes up only if it went down here.
   * code: as in KeyboardEvent.code.
   */
  take(code: string, isDown: boolean, nowMs: number): boolean {
    if (!OURS.has(code)) return false;
    if (isDown) {
      this.down.add(code);
      this.pressedMs.set(code, nowMs);
    } else if (!this.down.delete(code)) return false;
    this.movedMs = nowMs;
    return true;
  }

  read(nowMs: number, speed: number): Wheel {
    const passed = Number.isNaN(this.readMs) ? 0 : (nowMs - this.readMs) / 1000;
    this.readMs = nowMs;
    const side = Number(this.has(LEFT)) - Number(this.has(RIGHT));
    const wanted = side * this.lockAt(Math.abs(speed));
    const isTurning = wanted !== 0 && wanted * this.steering >= 0;
    this.steering = towards(this.steering, wanted, passed / (isTurning ? TURN_S : RETURN_S));
    this.go = towards(this.go, Number(this.has(GO)), passed / PEDAL_S);
    this.stop = towards(this.stop, Number(this.has(STOP)), passed / PEDAL_S);
    const buttons =
      (this.wasPressed(ITEM, nowMs) ? Button.USE_ITEM : 0) |
      (this.wasPressed(RESCUE, nowMs) ? Button.ACCEPT_RESCUE : 0);
    return { steering: this.steering, ...pedals(this.go, this.stop, speed), buttons };
  }

  release(): void {
    this.down.clear();
    this.pressedMs.clear();
    [this.steering, this.go, this.stop] = [0, 0, 0];
  }

  private has(codes: readonly string[]): boolean {
    return codes.some((code) => this.down.has(code));
  }

  private wasPressed(codes: readonly string[], nowMs: number): boolean {
    return codes.some(
      (code) => this.down.has(code) || nowMs - (this.pressedMs.get(code) ?? -Infinity) < PRESS_MS,
    );
  }
}

function towards(value: number, wanted: number, step: number): number {
  return value + clamp(wanted - value, -step, step);
}
