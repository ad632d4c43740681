// The perspective of a driver: where points of the track appear in a picture.

export interface Place {
  ahead: number; // [m]
  left: number; // [m]
  up: number; // [m] above the ground
}

export interface Pixel {
  x: number;
  y: number;
}

// Share of the picture above the horizon.
const SKY = 0.4;

export class Perspective {
  private x = 0;
  private y = 0;
  private cos = 1;
  private sin = 0;
  private focus = 1; // [pixels]
  private middle = 0;
  horizon = 0;

  /** near: least distance that is drawn [m]; height: of the eye above the ground [m]. */
  constructor(
    readonly near: number,
    readonly height: number,
  ) {}

  look(x: number, y: number, heading: number, width: number, height: number): void {
    this.x = x;
    this.y = y;
    this.cos = Math.cos(heading);
    this.sin = Math.sin(heading);
    this.middle = 0.5 * width;
    this.horizon = SKY * height;
    // 75° from side to side; upright screens see as far up and down as wide ones.
    this.focus = Math.max((0.5 * width) / Math.tan(0.65), 0.55 * height);
  }

  place(x: number, y: number, up = 0): Place {
    const [east, north] = [x - this.x, y - this.y];
    return {
      ahead: east * this.cos + north * this.sin,
      left: north * this.cos - east * this.sin,
      up,
    };
  }

  /** Returns where a place appears; it must lie ahead. */
  project({ ahead, left, up }: Place): Pixel {
    const scale = this.focus / ahead;
    return { x: this.middle - left * scale, y: this.horizon + (this.height - up) * scale };
  }

  /** Pixels of a metre at this distance ahead. */
  scaleAt(ahead: number): number {
    return this.focus / Math.max(ahead, this.near);
  }

  /** Returns a closed shape in the picture, clipped where it is too near; empty if behind. */
  shape(places: readonly Place[]): Pixel[] {
    const shown: Pixel[] = [];
    for (let i = 0; i < places.length; i++) {
      const here = places[i]!;
      const next = places[(i + 1) % places.length]!;
      if (here.ahead > this.near) shown.push(this.project(here));
      if (here.ahead > this.near !== next.ahead > this.near) {
        shown.push(this.project(this.cut(here, next)));
      }
    }
    return shown;
  }

  private cut(here: Place, next: Place): Place {
    const share = (this.near - here.ahead) / (next.ahead - here.ahead);
    return {
      ahead: this.near,
      left: here.left + share * (next.left - here.left),
      up: here.up + share * (next.up - here.up),
    };
  }
}

/** Adds a shape to a path. */
export function trace(path: Path2D | CanvasRenderingContext2D, pixels: readonly Pixel[]): void {
  pixels.forEach(({ x, y }, index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
  if (pixels.length) path.closePath();
}

export function fillShape(context: CanvasRenderingContext2D, pixels: readonly Pixel[]): void {
  context.beginPath();
  trace(context, pixels);
  context.fill();
}
