// The track from above, on two canvases: static parts are drawn only when the view moves.

import type { Race } from '../race/race.svelte';
import type { SnapshotFrame } from '../wire/frames';
import { Camera } from './camera';
import { drawKarts, drawTrailers } from './karts';
import { drawPeople, drawPlans, drawPrediction, drawRound, drawWays } from './lot';
import { drawNames, namesOn } from './names';
import { drawBoxes, drawHazards, drawRays, drawTrails } from './objects';
import { type MapColours, mapColours } from './palette';
import { drawSeen } from './seen';
import { Surface } from './surface';

// More pixels than this cost time and show no more.
const MOST_RATIO = 2;
const RAYS_OLD_TICKS = 30;

export interface MapChoice {
  followed: number; // seat, -1 for none
  trails: boolean;
  rays: boolean;
  names: boolean;
  line: boolean;
  ahead?: boolean; // where the followed vehicle goes with the wheels as they are
}

export class TrackMap {
  readonly camera = new Camera();
  private readonly ground: CanvasRenderingContext2D;
  private readonly top: CanvasRenderingContext2D;
  private surface: Surface | null = null;
  private colours: MapColours = mapColours();
  private ratio = 1;
  private drawn = '';
  private made: unknown[] = [];

  constructor(ground: HTMLCanvasElement, top: HTMLCanvasElement) {
    this.ground = ground.getContext('2d', { alpha: false })!;
    this.top = top.getContext('2d')!;
  }

  /** Sets the size of the picture [pixels]. */
  resize(width: number, height: number, race: Race): void {
    this.ratio = Math.min(devicePixelRatio || 1, MOST_RATIO);
    for (const { canvas } of [this.ground, this.top]) {
      canvas.width = Math.round(width * this.ratio);
      canvas.height = Math.round(height * this.ratio);
    }
    if (race.course) this.camera.fit(width, height, race.course.box);
    this.drawn = '';
  }

  draw(frame: SnapshotFrame | null, race: Race, choice: MapChoice): void {
    if (!race.course) return this.drawNothing();
    this.prepare(race);
    const kart = frame?.karts.find(({ seat }) => seat === choice.followed);
    if (kart) this.camera.follow(kart, 1);
    this.drawGround(choice.line);
    this.clearTop();
    if (frame) this.drawMoving(frame, race, choice);
  }

  private drawNothing(): void {
    const { ground } = this;
    ground.fillStyle = mapColours().around;
    ground.fillRect(0, 0, ground.canvas.width, ground.canvas.height);
  }

  private prepare(race: Race): void {
    const places = race.standings?.rows.length ?? 0;
    const parts = [race.course, race.line, places];
    if (parts.every((part, index) => part === this.made[index])) return;
    if (this.made[0] !== parts[0]) {
      const { width, height } = this.ground.canvas;
      this.camera.fit(width / this.ratio, height / this.ratio, race.course!.box);
    }
    this.made = parts;
    this.surface = new Surface(race.course!, race.line, places);
    this.drawn = '';
  }

  private drawGround(showLine: boolean): void {
    const stamp = `${this.camera.stamp} ${showLine}`;
    if (stamp === this.drawn || !this.surface) return;
    this.drawn = stamp;
    this.colours = mapColours();
    const { ground } = this;
    ground.setTransform(1, 0, 0, 1, 0, 0);
    ground.fillStyle = this.colours.around;
    ground.fillRect(0, 0, ground.canvas.width, ground.canvas.height);
    this.camera.apply(ground, this.ratio);
    this.surface.draw(ground, this.colours, 1 / this.camera.scale, showLine);
  }

  private clearTop(): void {
    const { top } = this;
    top.setTransform(1, 0, 0, 1, 0, 0);
    top.clearRect(0, 0, top.canvas.width, top.canvas.height);
  }

  private drawMoving(frame: SnapshotFrame, race: Race, choice: MapChoice): void {
    const { top, camera, ratio } = this;
    const pixel = 1 / camera.scale;
    const { body } = race;
    camera.apply(top, ratio);
    drawBoxes(top, race.course!, frame.boxes, Math.max(0.3 * body.length, 5 * pixel), pixel);
    drawHazards(top, frame.hazards, pixel);
    if (race.isLot) this.drawLot(frame, race, choice, pixel);
    else if (choice.trails) drawTrails(top, race.trails, frame, pixel);
    const { rays } = race;
    if (choice.rays && rays?.seat === choice.followed) {
      if (Math.abs(frame.tick - rays.tick) < RAYS_OLD_TICKS) drawRays(top, rays, pixel);
    }
    const { followed } = choice;
    const style = { body, camera, ratio, colours: this.colours, followed, isBox: race.isLot };
    drawTrailers(top, frame.trailers, style);
    drawKarts(top, frame.karts, style);
    camera.apply(top, ratio);
    drawSeen(top, frame.karts, race.alerts, body, pixel);
    if (choice.ahead) drawPrediction(top, race, frame, followed, pixel);
    if (choice.names) drawNames(top, frame.karts, namesOn(race, frame, followed), style);
  }

  private drawLot(frame: SnapshotFrame, race: Race, choice: MapChoice, pixel: number): void {
    const { top, colours } = this;
    if (race.lot) drawRound(top, race.lot, choice.followed, colours, pixel);
    if (choice.trails && race.lot) drawPlans(top, race.lot, choice.followed, colours, pixel);
    if (choice.trails) drawWays(top, race, choice.followed, colours, pixel);
    drawPeople(top, frame.walkers, colours, pixel);
  }
}
