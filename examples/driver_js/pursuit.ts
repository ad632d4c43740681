// Pure pursuit of the reference line, at the line's speeds.
//
// SI units; x east, y north, angles counter-clockwise, left positive. Geometry: Coulter,
// Implementation of the Pure Pursuit Path Tracking Algorithm, 1992.

import { Status } from '../../web/src/wire/generated/codes.js';
import type { Hud } from '../../web/src/wire/generated/drive.js';
import type { Briefing, Course, Line } from '../../web/src/wire/generated/session.js';
import type { Kart } from '../../web/src/wire/generated/spectate.js';

const GRAVITY = 9.81; // [m/s²]
const LOOK_S = 0.16; // aims at the point of the line this far ahead in time
const SHORTEST_LOOK = 1.5; // wheelbases
const DELAY_S = 0.1; // from a snapshot until its control acts on the wheels
// A line of minimum time takes all the grip; this driver keeps some to correct its errors.
const SPEED_SHARE = 0.86;
const BRAKE_SHARE = 0.5; // of what brakes and tyres can give
const CLOSE_S = 0.1; // pedals reach the wanted speed within this time

export interface Wishes {
  steering: number; // [-1, 1]
  throttle: number; // [0, 1]
  brake: number; // [0, 1]
}

export const STAND: Wishes = { steering: 0, throttle: 0, brake: 1 };

export class Pursuit {
  readonly #vehicle: Map<string, number>;
  readonly #line: Line;
  readonly #count: number; // of the line's samples
  readonly #beside: number[]; // the line's sample beside each sample of the centre line
  readonly #step: number; // [m] between samples of the centre line

  constructor(briefing: Briefing, course: Course, line: Line) {
    const names = Array.from({ length: briefing.vehicleNamesLength() }, (_, i) => i);
    this.#vehicle = new Map(
      names.map((i) => [briefing.vehicleNames(i), briefing.vehicleValues(i) ?? 0]),
    );
    this.#line = line;
    this.#count = line.xLength();
    this.#step = course.spacing();
    this.#beside = samplesBeside(course, line);
  }

  // Returns what to do with wheel and pedals, given all karts of a snapshot and what acts on ours.
  decide(kart: Kart, karts: Kart[], hud: Hud): Wishes {
    const speed = Math.max(kart.speed(), 0);
    const wheelbase = this.#of('front_axle') + this.#of('rear_axle');
    const step = this.#line.spacing();
    const sample = Math.floor((kart.progress() + speed * DELAY_S) / this.#step);
    const place = this.#beside[sample % this.#beside.length] ?? 0;
    const look = Math.max(SHORTEST_LOOK * wheelbase, LOOK_S * speed);
    const aim = (place + Math.round(look / step)) % this.#count;
    const [ahead, aside] = this.#seen(kart, this.#line.x(aim) ?? 0, this.#line.y(aim) ?? 0);
    const angle = Math.atan2(2 * wheelbase * aside, ahead * ahead + aside * aside);
    const limit = Math.min(
      this.#limitOfLine(place, speed, hud.gripScale()),
      this.#limitBehind(kart, karts),
      hud.speedCap(),
    );
    const force = (this.#of('mass') * (limit - speed)) / CLOSE_S;
    return {
      steering: clip(angle / this.#of('steering_limit'), -1, 1),
      throttle: clip(force / this.#of('motor_force'), 0, 1),
      brake: clip(-force / this.#of('brake_force'), 0, 1),
    };
  }

  // Returns a point as seen from the rear axle once the control acts: ahead and to the left [m].
  #seen(kart: Kart, x: number, y: number): [number, number] {
    const heading = kart.heading() + kart.yawRate() * DELAY_S;
    const forward = kart.speed() * DELAY_S - this.#of('rear_axle');
    const east = x - kart.x() - forward * Math.cos(heading);
    const north = y - kart.y() - forward * Math.sin(heading);
    return [
      east * Math.cos(heading) + north * Math.sin(heading),
      north * Math.cos(heading) - east * Math.sin(heading),
    ];
  }

  // Returns the speed from which all that the line asks for ahead can still be braked to.
  #limitOfLine(place: number, speed: number, grip: number): number {
    const braking = this.#braking();
    const step = this.#line.spacing();
    const horizon = Math.ceil((speed * speed) / (2 * braking) / step) + 1;
    let square = Infinity;
    for (let index = 0; index < Math.min(horizon, this.#count); index++) {
      const wanted = SPEED_SHARE * (this.#line.speed((place + index) % this.#count) ?? 0);
      square = Math.min(square, wanted * wanted * Math.min(grip, 1) + 2 * braking * step * index);
    }
    return Math.sqrt(square);
  }

  // Returns the speed that keeps the distance to a kart ahead: this driver does not overtake.
  #limitBehind(kart: Kart, karts: Kart[]): number {
    let square = Infinity;
    for (const other of karts) {
      const [ahead, aside] = this.#seen(kart, other.x(), other.y());
      const inWay = other.status() === Status.RACING && other.seat() !== kart.seat() && ahead > 0;
      if (!inWay || Math.abs(aside) > 1.2 * this.#of('width')) continue;
      const pace = Math.max(other.speed() * Math.cos(other.heading() - kart.heading()), 0);
      const gap = Math.max(ahead - 1.7 * this.#of('length'), 0);
      square = Math.min(square, pace * pace + 2 * this.#braking() * gap);
    }
    return Math.sqrt(square);
  }

  #braking(): number {
    const tyres = this.#of('grip') * GRAVITY;
    return BRAKE_SHARE * Math.min(tyres, this.#of('brake_force') / this.#of('mass'));
  }

  #of(name: string): number {
    const value = this.#vehicle.get(name);
    if (value === undefined) throw new Error(`the briefing does not tell the vehicle's ${name}`);
    return value;
  }
}

// Returns the line's sample nearest to each sample of the centre line; both begin side by side.
function samplesBeside(course: Course, line: Line): number[] {
  const reach = Math.ceil((3 * course.spacing()) / line.spacing()); // so far the line may go on
  let place = 0;
  return Array.from({ length: course.lineLength() / 4 }, (_, sample) => {
    const x = course.line(4 * sample) ?? 0;
    const y = course.line(4 * sample + 1) ?? 0;
    const far = (at: number): number =>
      Math.hypot((line.x(at % line.xLength()) ?? 0) - x, (line.y(at % line.xLength()) ?? 0) - y);
    let nearest = place;
    for (let at = place; at <= place + reach; at++) if (far(at) < far(nearest)) nearest = at;
    place = nearest;
    return place % line.xLength();
  });
}

function clip(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
