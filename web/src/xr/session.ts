// A headset that shows the race, from when it is put on until it is taken off.

import { type Material, type Mesh, Group, PerspectiveCamera, Plane, Scene, Vector3 } from 'three';

import type { HeadsetMode, HeadsetView } from '../draw/headset';
import type { Visit } from '../race/visit.svelte';
import type { Sky } from '../scene/sky';
import type { SceneView } from '../scene/view';
import type { World } from '../scene/world';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { DangerStage, KartFlag } from '../wire/tables';
import { Alignment } from './alignment';
import { Curtain } from './curtain';
import { fromSeat, type Matrix, onTable } from './frames';
import { Panel } from './panel';
import { Plinth } from './plinth';
import { displayMs, raceAt } from './predict';
import { Room } from './room';
import { type Doubt, doubtOf, drawnFrom, Fade } from './trust';

/** Texts of the panel in the language of the page. */
export interface HeadsetTexts {
  unit: string;
  touch: readonly [left: string, right: string]; // ends of the timing line
  refused: string; // the points touched do not fit
  doubts: Record<Doubt, string>;
  item: (number: number) => string;
}

export interface HeadsetChoice {
  view: HeadsetView;
  mode: HeadsetMode;
  seat: number; // whose the driver's view is, -1 for none
  line: boolean;
  texts: HeadsetTexts;
}

const TABLE = { size: 1.6, height: 0.8, away: 1.1 };
const FAR_TRUE = 900; // [m]
const USUAL_RATE = 72; // pictures a second, where the headset does not say
const SKY_RADIUS = 800; // [m]
// Without a room to align with, a spectator stands this far beside the timing line [m].
const BESIDE = 3;

export class Headset {
  pictures = 0;
  doubt: Doubt = 'none';
  readonly fade = new Fade();
  readonly alignment = new Alignment();
  readonly root = new Group(); // the track, in the room
  readonly camera = new PerspectiveCamera();
  private readonly scene = new Scene();
  private readonly curtain: Curtain;
  private readonly panel = new Panel();
  private readonly plane = new Plane(new Vector3(0, 0, -1), 0);
  private plinth: Plinth | null = null;
  private readonly room: Room | null;
  private world: World | null = null;
  private lastMs = NaN;

  private constructor(
    private readonly session: XRSession,
    private readonly stage: SceneView,
    private readonly visit: Visit,
    private readonly choice: HeadsetChoice,
  ) {
    this.curtain = new Curtain(this.isRoomReal);
    this.root.matrixAutoUpdate = false;
    const needsRoom = !this.isRoomReal && choice.view === 'table';
    this.room = needsRoom ? new Room(this.scene) : null;
    this.scene.add(this.root, this.curtain.mesh, this.panel.mesh);
  }

  /** Begins to show the race. ended: called when the headset was taken off, for whatever reason. */
  static async enter(
    stage: SceneView,
    visit: Visit,
    choice: HeadsetChoice,
    ended: () => void,
  ): Promise<Headset> {
    const floor = choice.view === 'driver' ? 'local' : 'local-floor';
    const session = await navigator.xr!.requestSession(choice.mode, {
      optionalFeatures: [floor],
    });
    const headset = new Headset(session, stage, visit, choice);
    try {
      await headset.begin(floor, ended);
    } catch (error) {
      // Some have no floor, or no room for the picture: the page draws on.
      await session.end().catch(() => {});
      headset.finish(ended);
      throw error;
    }
    return headset;
  }

  /** What drawing the last picture took, both eyes together. */
  get calls(): number {
    return this.stage.calls;
  }

  get triangles(): number {
    return this.stage.triangles;
  }

  async leave(): Promise<void> {
    await this.session.end();
  }

  private get isRoomReal(): boolean {
    return this.choice.mode === 'immersive-ar';
  }

  /** In a real room only what does not exist is drawn; but on a table nothing of it exists. */
  private get drawsWhatExists(): boolean {
    return !this.isRoomReal || this.choice.view === 'table';
  }

  private async begin(floor: XRReferenceSpaceType, ended: () => void): Promise<void> {
    const { renderer } = this.stage;
    this.session.addEventListener('select', (event) => this.touch(event));
    this.stage.lend();
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType(floor);
    await renderer.xr.setSession(this.session);
    // After the renderer's own listener: it must have left the session.
    this.session.addEventListener('end', () => this.finish(ended), { once: true });
    renderer.setAnimationLoop((ms, frame) => {
      if (frame) this.draw(ms, frame);
    });
  }

  private finish(ended: () => void): void {
    const { renderer } = this.stage;
    renderer.setAnimationLoop(null);
    renderer.xr.enabled = false;
    renderer.localClippingEnabled = false;
    if (this.world) this.release(this.world);
    this.curtain.dispose();
    this.panel.dispose();
    this.plinth?.dispose();
    this.room?.dispose();
    this.stage.giveBack();
    ended();
  }

  private draw(ms: number, xr: XRFrame): void {
    const seconds = this.goOn(ms);
    const { visit, choice } = this;
    const { race } = visit;
    const seenMs = displayMs(ms, xr.predictedDisplayTime, this.session.frameRate ?? USUAL_RATE);
    // On a table a tenth of a second does not matter, and what comes in between is smooth.
    const isNow = choice.view !== 'table' && !visit.isRecording;
    const frame = race.withGhost(
      isNow ? raceAt(race.buffer, visit.clock, seenMs) : race.buffer.sample(seenMs),
    );
    const prepared = this.stage.prepare(race);
    if (!frame || !prepared) return;
    const { world, sky } = prepared;
    this.take(world, sky);
    const own = choice.view === 'driver' ? kartOf(frame, choice.seat) : null;
    const within = own?.seat ?? -1;
    world.update(frame, race, { line: choice.line, names: false, within });
    this.obey(world, frame, own);
    const place = this.placeOf(world, own);
    if (place) this.root.matrix.fromArray(place as number[]);
    this.judge(frame, own, place !== null, seconds);
    this.look(world, sky, own);
    this.stage.renderer.render(this.scene, this.camera);
    this.pictures++;
  }

  private goOn(ms: number): number {
    const seconds = (ms - this.lastMs) / 1000 || 0;
    this.lastMs = ms;
    return seconds;
  }

  /** Brings a world into the room, the first time it is drawn. */
  private take(world: World, sky: Sky): void {
    if (world === this.world) return;
    if (this.world) this.release(this.world);
    this.world = world;
    this.root.add(world.group, sky.group);
    world.still.visible = this.drawsWhatExists;
    world.around.visible = sky.isDomeShown = this.choice.view !== 'table' && !this.isRoomReal;
    if (this.choice.view === 'table') {
      this.plinth?.dispose();
      this.plinth = new Plinth(world.course, world.body.length);
      this.root.add(this.plinth.mesh);
    }
    if (this.choice.view === 'driver' && this.isRoomReal) {
      this.stage.renderer.localClippingEnabled = true;
      clip(world, [this.plane]);
    }
  }

  private release(world: World): void {
    world.still.visible = world.around.visible = true;
    world.badges.mesh.visible = true;
    clip(world, null);
    const sky = this.stage.prepare(this.visit.race)?.sky;
    if (sky) sky.isDomeShown = true;
  }

  /** Leaves out the karts that are there anyway, and the one that the driver sits in. */
  private obey(world: World, frame: SnapshotFrame, own: KartFrame | null): void {
    if (this.drawsWhatExists) return;
    world.fleet.keepOnly(frame, (kart) => (kart.flags & KartFlag.REAL) === 0 && kart !== own);
  }

  private placeOf(world: World, own: KartFrame | null): Matrix | null {
    const { course, fleet, body } = world;
    const { view } = this.choice;
    if (view === 'table') return onTable(course.box, TABLE);
    if (view === 'driver') {
      const scale = body.length / fleet.model.length;
      const [ahead, left, up] = fleet.model.head;
      const eye = [body.ahead + ahead * scale, left * scale, up * scale] as const;
      return own && fromSeat(own, eye, this.scaleOf(world));
    }
    if (this.alignment.matrix || this.isRoomReal) return this.alignment.matrix;
    const heading = course.heading(0) - 0.5 * Math.PI;
    return fromSeat({ ...course.edge(0, 'left', BESIDE), heading }, [0, 0, 0]);
  }

  /** In a virtual room the vehicle has the size of what it is a model of. */
  private scaleOf({ fleet, body }: World): number {
    return this.isRoomReal ? 1 : fleet.model.length / body.length;
  }

  /** Decides how much is seen, and what the panel says. */
  private judge(
    frame: SnapshotFrame,
    own: KartFrame | null,
    isPlaced: boolean,
    seconds: number,
  ): void {
    const { texts, view } = this.choice;
    const { race } = this.visit;
    this.doubt = view === 'driver' ? this.findDoubt(frame, own) : 'none';
    const share = this.fade.update(isPlaced && this.doubt === 'none', seconds);
    this.curtain.share = view === 'driver' ? share : 1;
    this.root.visible = isPlaced && (view !== 'driver' || share > 0);
    const prompt = this.alignment.hasRefused ? texts.refused : texts.touch[this.alignment.touched];
    const alert = isPlaced || view === 'driver' ? texts.doubts[this.doubt] : (prompt ?? '');
    this.panel.mesh.visible = own !== null || alert !== '';
    this.panel.show({
      speed: own ? Math.abs(3.6 * own.speed).toFixed(0) : '',
      unit: texts.unit,
      flag: race.flagIn(frame),
      item: own?.item ? texts.item(own.item) : '',
      alert,
    });
  }

  private findDoubt(frame: SnapshotFrame, own: KartFrame | null): Doubt {
    const { race } = this.visit;
    const nowMs = performance.now();
    const pose = race.ownKart.pose(nowMs);
    return doubtOf({
      kartFlags: own ? own.flags : KartFlag.DOUBTFUL,
      deviation: pose?.deviation ?? 0,
      quality: pose?.quality ?? 1,
      brakesItself:
        own !== null && race.alertOfOwn(own.seat, nowMs)?.stage === DangerStage.FULL,
      ageMs: this.ageMs(),
      flag: race.flagIn(frame),
    });
  }

  /** How old the newest snapshot is [ms], NaN without one. */
  private ageMs(): number {
    const { race, clock, isRecording } = this.visit;
    const { newest, newestAtMs } = race.buffer;
    if (isRecording) return 0;
    if (!newest) return NaN;
    const nowMs = performance.now();
    return clock.isKnown ? clock.serverMs(nowMs) - newest.serverMs : nowMs - newestAtMs;
  }

  private look(world: World, sky: Sky, own: KartFrame | null): void {
    const { renderer } = this.stage;
    const isTable = this.choice.view === 'table';
    this.camera.near = isTable ? 0.02 : 0.05;
    this.camera.far = isTable ? 30 : FAR_TRUE;
    // The projection of the headset, as far as it is known yet.
    const up = renderer.xr.getCamera().projectionMatrix.elements[5]!;
    if (up > 0) world.badges.tangent = 1 / up;
    if (own) {
      this.plane.constant = -drawnFrom(own.speed);
      sky.surround(this.camera.position.set(own.x, own.y, 0), SKY_RADIUS / this.scaleOf(world));
      world.guide?.showAhead(own.x, own.y);
    } else world.guide?.showAll();
    this.camera.position.set(0, 0, 0);
  }

  private touch(event: XRInputSourceEvent): void {
    const space = this.stage.renderer.xr.getReferenceSpace();
    const course = this.visit.race.course;
    if (this.choice.view !== 'trackside' || !space || !course || course.isLot) return;
    const source = event.inputSource.gripSpace ?? event.inputSource.targetRaySpace;
    const at = event.frame.getPose(source, space)?.transform.position;
    if (!at) return;
    const line = [course.edge(0, 'left'), course.edge(0, 'right')] as const;
    this.alignment.touch([at.x, at.y, at.z], [line[0], line[1]]);
  }
}

function kartOf(frame: SnapshotFrame, seat: number): KartFrame | null {
  for (const kart of frame.karts) if (kart.seat === seat) return kart;
  return null;
}

/** Lets planes cut all that is in a world. */
function clip(world: World, planes: Plane[] | null): void {
  world.group.traverse((part) => {
    const material = (part as Mesh).material as Material | undefined;
    if (material) material.clippingPlanes = planes;
  });
}
