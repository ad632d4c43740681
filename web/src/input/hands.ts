// The device that was moved last drives. None drives while the page
// is not in front, or if the driving device is unplugged: then nothing is sent, and the server
// brakes the kart.

import { type Device, type DeviceName, NEUTRAL, type Wheel } from './wheel';

export interface Grip {
  device: DeviceName | 'none';
  wheel: Wheel;
  /** Whether a device drives: otherwise nothing may be sent. */
  isHeld: boolean;
}

export class Hands {
  private isAway = false;
  private awayMs = -Infinity;

  constructor(private readonly devices: readonly Device[]) {}

  /** The page is no longer in front: all devices are released. */
  leave(nowMs: number): void {
    this.isAway = true;
    this.awayMs = nowMs;
    for (const device of this.devices) device.release();
  }

  /** The page is in front again; the first device that moves drives. */
  comeBack(): void {
    this.isAway = false;
  }

  read(nowMs: number, speed: number): Grip {
    const read = this.devices.map((device) => ({ device, wheel: device.read(nowMs, speed) }));
    const moved = read.filter(({ device }) => device.movedMs > -Infinity);
    const newest = moved.reduce<(typeof read)[number] | null>(
      (best, one) => (best && best.device.movedMs >= one.device.movedMs ? best : one),
      null,
    );
    const isTaken = newest !== null && newest.device.isThere && newest.device.movedMs > this.awayMs;
    if (this.isAway || !isTaken) {
      return { device: newest?.device.name ?? 'none', wheel: NEUTRAL, isHeld: false };
    }
    return { device: newest.device.name, wheel: newest.wheel, isHeld: true };
  }
}
