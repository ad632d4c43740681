// Where the eye is and where it looks, for each of the cameras. Pure: numbers in, numbers out.

import type { Course, Point } from '../race/course';
import { wrap } from '../race/buffer';
import type { KartFrame } from '../wire/frames';
import { leftOf } from './outline';

/** Written in place for every picture. */
export interface Look {
  x: number; // [m] of the eye
  y: number;
  z: number;
  atX: number; // [m] of what it looks at
  atY: number;
  atZ: number;
  angle: number; // from top to bottom of the picture [rad]
  near: number; // [m]
}

export function newLook(): Look {
  return { x: 0, y: 0, z: 1, atX: 1, atY: 0, atZ: 1, angle: 1, near: 0.1 };
}

// The driver's eye sees 75° from side to side; upright pictures see as far up and down as wide ones.
const HALF_FIELD = 0.65;
const UPRIGHT_SHARE = 0.55;
// The horizon lies above the middle of the picture by this share of its height.
const HORIZON = 0.1;

/** Returns the angle of the driver's picture from top to bottom [rad]. */
export function driverAngle(aspect: number): number {
  const focus = Math.max((0.5 * aspect) / Math.tan(HALF_FIELD), UPRIGHT_SHARE);
  return 2 * Math.atan(0.5 / focus);
}

/** Looks from a kart ahead. eye: from the middle of its body [m]. */
export function lookFromSeat(
  look: Look,
  kart: KartFrame,
  ahead: number,
  eye: readonly [number, number, number],
  aspect: number,
): void {
  const [cos, sin] = [Math.cos(kart.heading), Math.sin(kart.heading)];
  const forward = ahead + eye[0];
  look.x = kart.x + forward * cos - eye[1] * sin;
  look.y = kart.y + forward * sin + eye[1] * cos;
  look.z = eye[2];
  look.angle = driverAngle(aspect);
  const drop = 2 * HORIZON * Math.tan(0.5 * look.angle);
  look.atX = look.x + cos;
  look.atY = look.y + sin;
  look.atZ = look.z - drop;
  look.near = 0.06 * eye[2];
}

const CHASE_BACK = 2.9; // lengths
const CHASE_UP = 1.25;
const CHASE_AHEAD = 2.6;
const CHASE_TURN_S = 0.28; // time constants
const CHASE_ANGLE = 0.95;

/** Follows a kart: the way it looks turns a little later than the kart. */
export class Chase {
  private heading = NaN;

  look(look: Look, kart: KartFrame, length: number, seconds: number): void {
    const turn = wrap(kart.heading - this.heading);
    if (Number.isNaN(this.heading) || Math.abs(turn) > 2) this.heading = kart.heading;
    else this.heading = wrap(this.heading + turn * (1 - Math.exp(-seconds / CHASE_TURN_S)));
    const [cos, sin] = [Math.cos(this.heading), Math.sin(this.heading)];
    look.x = kart.x - CHASE_BACK * length * cos;
    look.y = kart.y - CHASE_BACK * length * sin;
    look.z = CHASE_UP * length;
    look.atX = kart.x + CHASE_AHEAD * length * cos;
    look.atY = kart.y + CHASE_AHEAD * length * sin;
    look.atZ = 0.15 * length;
    look.angle = CHASE_ANGLE;
    look.near = 0.12 * length;
  }
}

// In lengths of a kart.
const POST_STEP = 22;
const POST_BESIDE = 2.2;
const POST_HEIGHT = 1.6;
// A picture from a post shows this many lengths of the track, within bounds [rad].
const POST_SHOWN = 8;
const [POST_LEAST, POST_MOST] = [0.16, 0.9];
// A post is left only for one that is nearer by this share, or the picture would jump back and forth.
const POST_KEEP = 0.75;

export interface Post extends Point {
  z: number;
}

/** Returns where people with cameras stand: outside of bends, a little above the borders. */
export function postsAlong(course: Course, length: number): Post[] {
  const posts: Post[] = [];
  const count = Math.max(Math.round(course.length / (POST_STEP * length)), 3);
  const { kerb, grass, halfWidths } = course.frame;
  for (let post = 0; post < count; post++) {
    const sample = course.sampleAt(((post + 0.5) * course.length) / count);
    const isLeftBend = course.curvature(sample) > 0;
    const half = halfWidths[2 * sample + (isLeftBend ? 1 : 0)]!;
    const beside = half + kerb + grass + POST_BESIDE * length;
    const place = course.beside(sample, isLeftBend ? -beside : beside);
    if (isClear(course, place, kerb + grass)) posts.push({ ...place, z: POST_HEIGHT * length });
  }
  return posts;
}

/** Whether a place lies beyond the borders of all parts of the course. */
function isClear(course: Course, place: Point, verge: number): boolean {
  for (let sample = 0; sample < course.samples; sample += 4) {
    const away = Math.hypot(course.x(sample) - place.x, course.y(sample) - place.y);
    const side = leftOf(course, sample, place) > 0 ? 0 : 1;
    if (away < course.frame.halfWidths[2 * sample + side]! + verge) return false;
  }
  return true;
}

export class Trackside {
  private post: Post | null = null;

  constructor(private readonly posts: readonly Post[]) {}

  look(look: Look, kart: KartFrame, length: number): void {
    const best = nearest(this.posts, kart);
    if (!best) return;
    const kept = this.post ? Math.hypot(this.post.x - kart.x, this.post.y - kart.y) : Infinity;
    const away = Math.hypot(best.x - kart.x, best.y - kart.y);
    if (away < POST_KEEP * kept) this.post = best;
    const { x, y, z } = this.post!;
    const distance = Math.hypot(x - kart.x, y - kart.y, z);
    const wanted = 2 * Math.atan((0.5 * POST_SHOWN * length) / distance);
    [look.x, look.y, look.z] = [x, y, z];
    [look.atX, look.atY, look.atZ] = [kart.x, kart.y, 0.3 * length];
    look.angle = Math.min(Math.max(wanted, POST_LEAST), POST_MOST);
    look.near = 0.3 * length;
  }
}

function nearest(posts: readonly Post[], { x, y }: Point): Post | null {
  let [best, least]: [Post | null, number] = [null, Infinity];
  for (const post of posts) {
    const away = Math.hypot(post.x - x, post.y - y);
    if (away < least) [best, least] = [post, away];
  }
  return best;
}

const ABOVE_ANGLE = 0.7;
// A followed kart is seen from this share of the way from which the whole course is.
const FOLLOWED = 0.4;
const [TILT_LEAST, TILT_MOST] = [0.25, 1.5]; // above the ground [rad]
const MARGIN = 1.12;
const ZOOM_MOST = 40;
const TURNS = 24;

/** Turns around a place on the ground: the middle of the course, or a kart. */
export class Above {
  private turn = -1.05; // where the eye stands, seen from the middle [rad]
  private tilt = 0.82;
  private zoomed = 1;
  private x = 0;
  private y = 0;
  private isSet = false;
  private distance = 1;
  private readonly measured = [NaN, NaN, NaN]; // turn, tilt and aspect that it is for

  /** Turns the view by a drag [rad]. */
  drag(right: number, up: number): void {
    this.turn -= right;
    this.tilt = Math.min(Math.max(this.tilt + up, TILT_LEAST), TILT_MOST);
  }

  zoom(factor: number): void {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.6), ZOOM_MOST);
  }

  reset(): void {
    this.zoomed = 1;
  }

  look(look: Look, course: Course, kart: KartFrame | null, aspect: number): void {
    const { left, right, bottom, top } = course.box;
    this.x = kart ? kart.x : 0.5 * (left + right);
    this.y = kart ? kart.y : 0.5 * (bottom + top);
    if (!this.isSet) this.turnToFit(course, aspect);
    this.keepDistance(course, aspect);
    const distance = (kart ? FOLLOWED : 1) * (this.distance / this.zoomed);
    const flat = distance * Math.cos(this.tilt);
    look.x = this.x + flat * Math.cos(this.turn);
    look.y = this.y + flat * Math.sin(this.turn);
    look.z = distance * Math.sin(this.tilt);
    [look.atX, look.atY, look.atZ] = [this.x, this.y, 0];
    look.angle = ABOVE_ANGLE;
    look.near = 0.02 * distance;
  }

  private keepDistance(course: Course, aspect: number): void {
    const [turn, tilt, wide] = this.measured;
    if (turn === this.turn && tilt === this.tilt && wide === aspect) return;
    [this.measured[0], this.measured[1], this.measured[2]] = [this.turn, this.tilt, aspect];
    this.distance = this.distanceFor(this.turn, course, aspect);
  }

  /** Turns to where the course fills the picture best, the sun at the back if that is as good. */
  private turnToFit(course: Course, aspect: number): void {
    this.isSet = true;
    let least = Infinity;
    for (let step = 0; step < TURNS; step++) {
      const turn = -1.05 + (2 * Math.PI * step) / TURNS;
      const distance = this.distanceFor(turn, course, aspect);
      if (distance < 0.99 * least) [least, this.turn] = [distance, turn];
    }
  }

  /** Returns from how far away the whole course is in the picture [m]. */
  private distanceFor(turn: number, { loops, box }: Course, aspect: number): number {
    const [x, y] = [0.5 * (box.left + box.right), 0.5 * (box.bottom + box.top)];
    const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
    const [flat, up] = [Math.cos(this.tilt), Math.sin(this.tilt)];
    const tangent = Math.tan(0.5 * ABOVE_ANGLE) / MARGIN;
    let distance = 0;
    for (const loop of loops) {
      for (const place of loop) {
        const [east, north] = [place.x - x, place.y - y];
        const [near, across] = [east * cos + north * sin, north * cos - east * sin];
        const needed = Math.max(Math.abs(across) / aspect, Math.abs(near) * up) / tangent;
        distance = Math.max(distance, near * flat + needed);
      }
    }
    return distance;
  }
}
