// A gamepad in the standard layout: left stick steers, triggers are the pedals.

import { Button } from '../wire/tables';
import { type Device, type Wheel, clamp, pedals } from './wheel';

const DEAD_ZONE = 0.08;
const MOVED = 0.12;
const [A, B, X, LEFT_TRIGGER, RIGHT_TRIGGER] = [0, 1, 2, 6, 7];

/** The used part of the browser's Gamepad. */
export interface PadState {
  axes: readonly number[];
  buttons: readonly { value: number; pressed: boolean }[];
}

export class Pad implements Device {
  readonly name = 'gamepad';
  movedMs = -Infinity;
  isThere = false;
  private last: Wheel | null = null;

  constructor(private readonly find: () => PadState | null = firstPad) {}

  read(nowMs: number, speed: number): Wheel {
    const pad = this.find();
    this.isThere = pad !== null;
    const wheel = pad ? wheelOf(pad, speed) : { steering: 0, throttle: 0, brake: 0, buttons: 0 };
    if (pad && (!this.last || hasMoved(this.last, wheel))) {
      // An untouched gamepad does not count as moved.
      if (this.last || hasMoved({ steering: 0, throttle: 0, brake: 0, buttons: 0 }, wheel)) {
        this.movedMs = nowMs;
      }
      this.last = wheel;
    }
    return wheel;
  }

  release(): void {
    this.last = null;
  }
}

function wheelOf(pad: PadState, speed: number): Wheel {
  const value = (button: number) => pad.buttons[button]?.value ?? 0;
  const pressed = (button: number) => pad.buttons[button]?.pressed ?? false;
  return {
    steering: shaped(-(pad.axes[0] ?? 0)),
    ...pedals(value(RIGHT_TRIGGER!), value(LEFT_TRIGGER!), speed),
    buttons:
      (pressed(A!) || pressed(X!) ? Button.USE_ITEM : 0) | (pressed(B!) ? Button.ACCEPT_RESCUE : 0),
  };
}

/** Returns a stick's share without its dead zone, finer in the middle. */
function shaped(value: number): number {
  const beyond = clamp((Math.abs(value) - DEAD_ZONE) / (1 - DEAD_ZONE), 0, 1);
  return Math.sign(value) * beyond ** 1.5;
}

function hasMoved(before: Wheel, after: Wheel): boolean {
  return (
    Math.abs(before.steering - after.steering) > MOVED ||
    Math.abs(before.throttle - after.throttle) > MOVED ||
    Math.abs(before.brake - after.brake) > MOVED ||
    before.buttons !== after.buttons
  );
}

function firstPad(): PadState | null {
  return navigator.getGamepads?.().find((pad) => pad?.connected) ?? null;
}
