// Fingers and mouse on the map: one moves it, two zoom, the wheel zooms.

import type { Camera } from './camera';

interface Finger {
  x: number;
  y: number;
}

const WHEEL_STEP = 1.0015;

export class Gestures {
  private readonly fingers = new Map<number, Finger>();

  /** onPan: the picture is moved by hand, so it stops following a kart. */
  constructor(
    private readonly camera: Camera,
    private readonly onPan: () => void,
  ) {}

  pan(right: number, down: number): void {
    this.onPan();
    this.camera.pan(right, down);
  }

  wheel(event: WheelEvent): void {
    event.preventDefault();
    this.camera.zoom(WHEEL_STEP ** -event.deltaY, fingerOf(event));
  }

  down(event: PointerEvent): void {
    (event.currentTarget as Element).setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, fingerOf(event));
  }

  up(event: PointerEvent): void {
    this.fingers.delete(event.pointerId);
  }

  move(event: PointerEvent): void {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now = fingerOf(event);
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const spread = distance(now, other) / Math.max(distance(before, other), 1);
      this.camera.zoom(spread, { x: 0.5 * (now.x + other.x), y: 0.5 * (now.y + other.y) });
    } else if (distance(now, before) > 0) {
      this.pan(now.x - before.x, now.y - before.y);
    }
    this.fingers.set(event.pointerId, now);
  }
}

function fingerOf(event: MouseEvent): Finger {
  const box = (event.currentTarget as Element).getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

function distance(one: Finger, other: Finger): number {
  return Math.hypot(one.x - other.x, one.y - other.y);
}
