// A gamepad in the standard layout: left stick steers, triggers are the pedals.

import { Button } from '../wire/tables';
import { type Device, NEUTRAL, type Wheel, clamp, pedals } from './wheel';

const DEAD_ZONE = 0.08;
const MOVED = 0.12;
const [A, B, X, LEFT_TRIGGER, RIGHT_TRIGGER] = [0, 1, 2, 6, 7];

/** The used part of the browser's Gamepad. */
export interface PadState {
  index: number;
  axes: readonly number[];
  buttons: readonly { value: number; pressed: boolean }[];
}

/** All gamepads as one device: the one that was moved last counts. */
export class Pad implements Device {
  readonly name = 'gamepad';
  movedMs = -Infinity;
  isThere = false;
  private readonly lasts = new Map<number, Wheel>(); // by index
  private moved: number | null = null; // index of the one that was moved last

  constructor(private readonly find: () => readonly PadState[] = connectedPads) {}

  read(nowMs: number, speed: number): Wheel {
    let read: Wheel | null = null;
    for (const pad of this.find()) {
      const wheel = wheelOf(pad, speed);
      // An untouched gamepad does not count as moved.
      if (hasMoved(this.lasts.get(pad.index) ?? NEUTRAL, wheel)) {
        [this.moved, this.movedMs] = [pad.index, nowMs];
        this.lasts.set(pad.index, wheel);
      } else if (!this.lasts.has(pad.index)) this.lasts.set(pad.index, wheel);
      if (pad.index === this.moved) read = wheel;
    }
    this.isThere = read !== null;
    return read ?? NEUTRAL;
  }

  release(): void {
    this.lasts.clear();
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

function connectedPads(): PadState[] {
  const pads = navigator.getGamepads?.() ?? [];
  return pads.filter((pad): pad is Gamepad => pad?.connected ?? false);
}
