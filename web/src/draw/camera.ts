// What part of the track is shown, and how large.

import type { Box, Point } from '../race/course';

const MOST_ZOOM = 60; // times the whole track
const MARGIN = 0.06; // of the whole track on each side

export class Camera {
  x = 0; // [m] in the middle of the picture
  y = 0;
  scale = 1; // [pixels/m]
  /** Whether the zoom was set by hand; then a new size of the window keeps it. */
  isHeld = false;
  private width = 1;
  private height = 1;
  private box: Box = { left: 0, right: 1, bottom: 0, top: 1 };

  /** Sets the size of the picture [pixels] and the area to show. */
  fit(width: number, height: number, box: Box): void {
    this.width = width;
    this.height = height;
    this.box = box;
    if (!this.isHeld) this.showAll();
  }

  showAll(): void {
    const { left, right, bottom, top } = this.box;
    this.x = 0.5 * (left + right);
    this.y = 0.5 * (bottom + top);
    this.scale = this.leastScale;
    this.isHeld = false;
  }

  /** Zooms by a factor; what lies at a place of the picture stays there. */
  zoom(factor: number, at: Point = { x: 0.5 * this.width, y: 0.5 * this.height }): void {
    const before = this.toTrack(at);
    const wanted = this.scale * factor;
    this.scale = Math.min(Math.max(wanted, this.leastScale), MOST_ZOOM * this.leastScale);
    const after = this.toTrack(at);
    this.x += before.x - after.x;
    this.y += before.y - after.y;
    this.isHeld = true;
  }

  /** Moves the picture by some pixels. */
  pan(right: number, down: number): void {
    const { left, right: end, bottom, top } = this.box;
    this.x = Math.min(Math.max(this.x - right / this.scale, left), end);
    this.y = Math.min(Math.max(this.y + down / this.scale, bottom), top);
    this.isHeld = true;
  }

  /** Brings a point nearer to the middle of the picture. share: of the way, 1 for at once. */
  follow(point: Point, share: number): void {
    this.x += share * (point.x - this.x);
    this.y += share * (point.y - this.y);
  }

  toTrack(at: Point): Point {
    return {
      x: this.x + (at.x - 0.5 * this.width) / this.scale,
      y: this.y - (at.y - 0.5 * this.height) / this.scale,
    };
  }

  toPicture(point: Point): Point {
    return {
      x: 0.5 * this.width + (point.x - this.x) * this.scale,
      y: 0.5 * this.height - (point.y - this.y) * this.scale,
    };
  }

  /** Sets a canvas to metres. ratio: of its pixels to those of the picture. */
  apply(context: CanvasRenderingContext2D, ratio: number): void {
    const scale = this.scale * ratio;
    context.setTransform(
      scale,
      0,
      0,
      -scale,
      ratio * 0.5 * this.width - scale * this.x,
      ratio * 0.5 * this.height + scale * this.y,
    );
  }

  /** A text that differs between different views. */
  get stamp(): string {
    return `${this.x} ${this.y} ${this.scale} ${this.width} ${this.height}`;
  }

  private get leastScale(): number {
    const { left, right, bottom, top } = this.box;
    const room = 1 + 2 * MARGIN;
    return Math.min(
      this.width / (room * Math.max(right - left, 1e-3)),
      this.height / (room * Math.max(top - bottom, 1e-3)),
    );
  }
}
