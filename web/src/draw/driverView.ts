// The driver's view: the track in perspective from its own kart, drawn to the kart's scale, so
// that a 1/10 car and a rental kart look alike from behind the wheel.

import type { Race } from '../race/race.svelte';
import type { Course } from '../race/course';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import { Perspective, type Place } from './perspective';
import { drawBackdrop, drawBands, drawIdealLine, drawPuddles, drawSurfaces } from './road';
import { type Sign, drawSign } from './signs';
import { type Solid, drawLabel, kartSolid, solidOf } from './solids';
import { type Wall, wallSolids, wallsOf } from './walls';

// All in lengths of a kart: with its driver it is about 0.65 as high, and the eye at 0.9 of that.
const EYE_HEIGHT = 0.9 * 0.65;
const NEAR = 0.25;
const REACH = 70;
const LINE_REACH = 32;
const WALL_HEIGHT = 0.36;
const WALL_PIECE = 2;
const BAND_STEP = 2;
const EDGE_STEP = 0.4;
const LINE_WIDTH = 0.22;
const MOST_RATIO = 2;

export class DriverView {
  private readonly context: CanvasRenderingContext2D;
  private course: Course | null = null;
  private walls: Wall[] = [];
  private view = new Perspective(1, 1);
  private length = 1;
  private width = 1;
  private height = 1;

  constructor(canvas: HTMLCanvasElement) {
    this.context = canvas.getContext('2d', { alpha: false })!;
  }

  resize(width: number, height: number): void {
    const ratio = Math.min(devicePixelRatio || 1, MOST_RATIO);
    this.width = width;
    this.height = height;
    this.context.canvas.width = Math.round(width * ratio);
    this.context.canvas.height = Math.round(height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  draw(frame: SnapshotFrame | null, seat: number, race: Race, showsLine: boolean): void {
    const { context, view } = this;
    this.prepare(race);
    const own = frame?.karts.find((kart) => kart.seat === seat) ?? null;
    if (own) view.look(own.x, own.y, own.heading, this.width, this.height);
    else view.look(1e6, 1e6, 0, this.width, this.height);
    drawBackdrop(context, view, this.width, this.height);
    if (!own || !frame || !race.course) return;
    this.drawGround(own, frame, race, showsLine);
    const solids = this.solidsOf(own, frame, race);
    solids.sort((one, other) => other.distance - one.distance);
    for (const solid of solids) solid.draw(context);
  }

  private prepare(race: Race): void {
    const { length } = race.body;
    if (race.course === this.course && length === this.length) return;
    this.course = race.course;
    this.length = length;
    this.view = new Perspective(NEAR * length, EYE_HEIGHT * length);
    this.walls = race.course ? wallsOf(race.course, WALL_PIECE * length) : [];
  }

  private drawGround(own: KartFrame, frame: SnapshotFrame, race: Race, showsLine: boolean): void {
    const { context, view, length } = this;
    const course = race.course!;
    drawSurfaces(context, course, view, EDGE_STEP * length);
    const sample = course.sampleAt(own.progress);
    drawBands(context, course, view, sample, BAND_STEP * length, REACH * length);
    if (showsLine && race.line) {
      const { line } = race;
      const [width, reach] = [LINE_WIDTH * length, LINE_REACH * length];
      drawIdealLine(context, line, view, line.nearest(own.x, own.y), width, reach);
    }
    drawPuddles(context, frame.hazards, view);
  }

  private solidsOf(own: KartFrame, frame: SnapshotFrame, race: Race): Solid[] {
    const { view, length } = this;
    const rivals = frame.karts.filter(
      (kart) => kart !== own && kart.status !== Status.ABSENT,
    );
    return [
      ...wallSolids(this.walls, own, view, WALL_HEIGHT * length, REACH * length),
      ...rivals.map((kart) => kartSolid(kart, race.body, view)),
      ...this.obstaclesOf(race.course!),
      ...this.boxesOf(race.course!, frame),
      ...this.signsOf(frame),
    ].filter((solid): solid is Solid => solid !== null && solid.distance < REACH * length);
  }

  private obstaclesOf(course: Course): (Solid | null)[] {
    const all = Array.from(course.frame.obstacles);
    return Array.from({ length: Math.floor(all.length / 5) }, (_, row) => {
      const [x, y, heading, long, wide] = all.slice(5 * row, 5 * row + 5) as [
        number,
        number,
        number,
        number,
        number,
      ];
      const size = { length: long, width: wide, base: 0, top: 0.3 * this.length };
      return solidOf([{ x, y, heading, ...size, colour: '#d29a3a' }], this.view, null);
    });
  }

  /** Item boxes that are ready: cubes that float above the road. */
  private boxesOf(course: Course, frame: SnapshotFrame): (Solid | null)[] {
    const { view, length } = this;
    const { boxes } = course.frame;
    return Array.from({ length: boxes.length / 2 }, (_, index) => {
      if (frame.boxes[index] !== 1) return null;
      const place = view.place(boxes[2 * index]!, boxes[2 * index + 1]!, 0.12 * length);
      if (place.ahead < view.near) return null;
      return {
        distance: Math.hypot(place.ahead, place.left),
        draw: (context: CanvasRenderingContext2D) => drawCube(context, view, place, 0.32 * length),
      };
    });
  }

  /** Signs above hazards on the road, visible from far away. */
  private signsOf(frame: SnapshotFrame): (Solid | null)[] {
    const { view, length } = this;
    return frame.hazards.map((hazard) => {
      const place = view.place(hazard.x, hazard.y, 0.25 * length);
      if (place.ahead < view.near) return null;
      const sign = { text: '!', colour: '#ffb000', ink: '#1b1200', size: 0.24 * length };
      return {
        distance: Math.hypot(place.ahead, place.left),
        draw: (context: CanvasRenderingContext2D) => drawLabel(context, view, place, sign),
      };
    });
  }
}

// Nearer than this a cube would hide the road [pixels].
const MOST_CUBE = 130;
const CUBE: Sign = { text: '?', colour: '#8b5cf6', ink: '#ffffff', isCube: true };

function drawCube(
  context: CanvasRenderingContext2D,
  view: Perspective,
  place: Place,
  size: number,
): void {
  const { x, y } = view.project(place);
  const side = Math.min(size * view.scaleAt(place.ahead), MOST_CUBE);
  drawSign(context, CUBE, x, y - 0.5 * side, side);
}
