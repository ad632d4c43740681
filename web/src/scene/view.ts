// A picture of the race on a canvas, seen with one of the cameras.

import {
  NeutralToneMapping,
  PCFShadowMap,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';

import type { Eye } from '../draw/space';
import type { Race } from '../race/race.svelte';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import { Above, Chase, lookFromSeat, newLook, postsAlong, Trackside } from './eyes';
import { QUALITIES, QualityKeeper } from './quality';
import { Sky } from './sky';
import { settingOf } from './surroundings';
import { type Shown, World } from './world';

// In lengths of a kart.
const FAR = 620;
const SHADOW_REACH: Record<Eye, number> = { driver: 22, chase: 20, trackside: 20, above: 0 };
// Longest step of what moves by itself, after a pause [s].
const LONGEST_S = 0.1;

export interface SceneChoice {
  eye: Eye;
  followed: number; // seat, -1 for the first of the race
  line: boolean;
  names: boolean;
}

export class SceneView {
  readonly quality = new QualityKeeper();
  readonly above = new Above();
  readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera();
  private readonly eye = new Vector3();
  private readonly look = newLook();
  private chase = new Chase();
  private trackside = new Trackside([]);
  private world: World | null = null;
  private sky: Sky | null = null;
  private width = 1;
  private height = 1;
  private lastMs = NaN;
  private readonly shown: Shown = { line: false, names: false, within: -1 };
  private isLent = false;

  /** Throws where the canvas gives no WebGL. isQuick: a graphics card draws. */
  constructor(canvas: HTMLCanvasElement, isQuick: boolean) {
    this.renderer = new WebGLRenderer({
      canvas,
      antialias: isQuick,
      powerPreference: 'high-performance',
    });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.toneMappingExposure = 0.95;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.camera.up.set(0, 0, 1);
    this.quality.level = isQuick ? 0 : QUALITIES.length - 1;
    this.applyQuality();
  }

  /** Sets the size of the picture [pixels]. */
  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    if (!this.isLent) this.renderer.setSize(width, height, false);
  }

  /** Holds a level of quality, 0 for the best, in place of one that follows the machine. */
  hold(level: number): void {
    this.quality.hold(level);
    this.applyQuality();
  }

  draw(frame: SnapshotFrame | null, race: Race, choice: SceneChoice): void {
    const seconds = this.goOn();
    if (!frame || !race.course || this.isLent) return;
    const world = this.worldOf(race);
    const kart = followedIn(frame, choice.followed);
    const eye = kart || choice.eye === 'above' ? choice.eye : 'above';
    const within = eye === 'driver' && kart ? kart.seat : -1;
    this.shown.line = choice.line;
    this.shown.names = choice.names;
    this.shown.within = within;
    world.update(frame, race, this.shown);
    this.aim(eye, kart, choice.followed, world, seconds);
    if (world.guide && kart && eye === 'driver') world.guide.showAhead(kart.x, kart.y);
    else world.guide?.showAll();
    this.renderer.render(this.scene, this.camera);
  }

  /** Lends what draws to a headset: until it is given back, nothing is drawn on the canvas. */
  lend(): void {
    this.isLent = true;
    this.renderer.shadowMap.enabled = false;
  }

  giveBack(): void {
    this.isLent = false;
    if (this.world) this.scene.add(this.world.group);
    if (this.sky) this.scene.add(this.sky.group);
    this.applyQuality();
  }

  /** Returns the world and the sky of a race, made if need be; null while its course is unknown. */
  prepare(race: Race): { world: World; sky: Sky } | null {
    if (!race.course) return null;
    const world = this.worldOf(race);
    return { world, sky: this.sky! };
  }

  /** What drawing the last picture took. */
  get calls(): number {
    return this.renderer.info.render.calls;
  }

  get triangles(): number {
    return this.renderer.info.render.triangles;
  }

  dispose(): void {
    this.world?.dispose();
    this.sky?.dispose();
    this.renderer.dispose();
  }

  private goOn(): number {
    const nowMs = performance.now();
    const sinceMs = nowMs - this.lastMs;
    this.lastMs = nowMs;
    if (Number.isNaN(sinceMs)) return 0;
    if (this.quality.note(sinceMs)) this.applyQuality();
    return Math.min(sinceMs / 1000, LONGEST_S);
  }

  private worldOf(race: Race): World {
    const places = race.standings?.rows.length ?? 0;
    if (this.world?.fits(race, places)) return this.world;
    if (this.world) {
      this.scene.remove(this.world.group);
      this.world.dispose();
    }
    const course = race.course!;
    if (this.world?.course !== course) this.setPlace(race);
    const made = new World(course, race.line, race.body, places);
    this.world = made;
    this.scene.add(made.group);
    return made;
  }

  /** Prepares sky, haze and cameras for another course. */
  private setPlace(race: Race): void {
    const course = race.course!;
    if (this.sky) {
      this.scene.remove(this.sky.group);
      this.sky.dispose();
    }
    this.sky = new Sky(settingOf(course));
    this.scene.add(this.sky.group);
    this.chase = new Chase();
    this.trackside = new Trackside(course.isLot ? [] : postsAlong(course, race.body.length));
    this.applyQuality();
  }

  private aim(
    eye: Eye,
    kart: KartFrame | null,
    followed: number,
    world: World,
    seconds: number,
  ): void {
    const { look, camera } = this;
    const { course, body, fleet } = world;
    const aspect = this.width / this.height;
    if (eye === 'driver') {
      const scale = body.length / fleet.model.length;
      const [x, y, z] = fleet.model.eye;
      lookFromSeat(look, kart!, body.ahead, [x * scale, y * scale, z * scale], aspect);
    } else if (eye === 'chase') this.chase.look(look, kart!, body.length, seconds);
    else if (eye === 'trackside') this.trackside.look(look, kart!, body.length);
    else this.above.look(look, course, followed < 0 ? null : kart, aspect);
    this.eye.set(look.x, look.y, look.z);
    camera.position.copy(this.eye);
    camera.lookAt(look.atX, look.atY, look.atZ);
    camera.fov = (look.angle * 180) / Math.PI;
    camera.aspect = aspect;
    camera.near = look.near;
    camera.far = Math.max(FAR * body.length, 6 * look.z);
    camera.updateProjectionMatrix();
    world.badges.tangent = Math.tan(0.5 * look.angle);
    this.light(eye, kart, world);
  }

  private light(eye: Eye, kart: KartFrame | null, { course, body }: World): void {
    const sky = this.sky!;
    const { far } = this.camera;
    sky.surround(this.eye, 0.9 * far);
    // From above all of the course is clear, and what lies around it fades.
    const nearest = eye === 'above' ? 1.1 * this.eye.z : 0.2 * far;
    sky.haze(this.scene, nearest, eye === 'above' ? far : 0.8 * far);
    const { left, right, bottom, top } = course.box;
    if (eye === 'above' || !kart) {
      sky.shade(
        0.5 * (left + right),
        0.5 * (bottom + top),
        0.55 * Math.hypot(right - left, top - bottom),
      );
    } else {
      // Shadows are needed where the eye looks: ahead of the kart.
      const lead = eye === 'driver' ? 0.6 : 0.2;
      const reach = SHADOW_REACH[eye] * body.length;
      sky.shade(
        kart.x + lead * reach * Math.cos(kart.heading),
        kart.y + lead * reach * Math.sin(kart.heading),
        reach,
      );
    }
  }

  private applyQuality(): void {
    if (this.isLent) return;
    const { ratio, shadows } = this.quality.now;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, ratio));
    this.renderer.setSize(this.width, this.height, false);
    this.renderer.shadowMap.enabled = shadows;
    if (this.sky) this.sky.sun.castShadow = shadows;
  }
}

/** Returns the kart of a seat, or without one the first of the race. */
function followedIn(frame: SnapshotFrame, seat: number): KartFrame | null {
  let first: KartFrame | null = null;
  for (const kart of frame.karts) {
    if (kart.seat === seat) return kart;
    if (kart.status !== Status.ABSENT && (!first || kart.rank < first.rank)) first = kart;
  }
  return first;
}
