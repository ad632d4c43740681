// The state of one race, which views read. What changes with every
// snapshot is plain data for the drawing loop; what people read is reactive and changes slowly.

import type { ByteBuffer } from 'flatbuffers';
import type { ProgrammeFrame } from '../wire/eventFrames';
import type {
  BriefingFrame,
  Frame,
  HintFrame,
  HudFrame,
  KartAlert,
  KartFrame,
  LotFrame,
  RaysFrame,
  RulesFrame,
  SnapshotFrame,
  StandingsFrame,
} from '../wire/frames';
import { Flag, Phase, Status } from '../wire/tables';
import { TICKS_PER_SECOND } from './clock';
import { SnapshotBuffer } from './buffer';
import { Course } from './course';
import { InputAges } from './ages';
import type { Ghost } from './ghost';
import { Ghosts } from './ghosts.svelte';
import { type LapTrace, ReferenceLine, referenceTrace } from './line';
import { News } from './news.svelte';
import { BINS, Pace } from './pace';
import { OwnKart } from './ownkart';
import { type Rig, rigOf } from './rig';
import { type Row, tableOf } from './table';
import { type Clearance, clearanceOf } from './clearance';
import { Trails } from './trails';
import { Ways } from './ways';

// Interval of updates of text and tables [ms].
const READ_MS = 250;
// Until this long after the lights karts count as before the timing line [ticks].
const EARLY_TICKS = 5 * TICKS_PER_SECOND;
// A race that a server resumes starts a few ticks earlier; further back it is another race.
const BACK_TICKS = TICKS_PER_SECOND;

export interface KartBody {
  length: number; // [m]
  width: number; // [m]
  ahead: number; // [m] from the centre of gravity forward to the middle
}

// The default: a 1/10 car.
const SMALL_BODY: KartBody = { length: 0.45, width: 0.19, ahead: 0 };

export interface Headline {
  phase: number;
  flag: number;
  lights: number;
  tick: number;
  lap: number; // of the leader, from 1
}

export class Race {
  course = $state.raw<Course | null>(null);
  line = $state.raw<ReferenceLine | null>(null);
  lot = $state.raw<LotFrame | null>(null);
  reference = $state.raw<LapTrace | null>(null);
  rules = $state.raw<RulesFrame | null>(null);
  rig: Rig | null = null; // of vehicles that draw trailers
  standings = $state.raw<StandingsFrame | null>(null);
  rows = $state.raw<readonly Row[]>([]);
  headline = $state.raw<Headline | null>(null);
  hud = $state.raw<HudFrame | null>(null);
  alerts = $state.raw<ReadonlyMap<number, KartAlert>>(new Map()); // of real karts, by seat
  telemetry = $state.raw<ByteBuffer | null>(null); // of real karts, see `telemetry.ts`
  hint = $state.raw<{ told: HintFrame; arrivedMs: number } | null>(null); // of a coach, the newest
  briefing = $state.raw<BriefingFrame | null>(null);
  programme = $state.raw<ProgrammeFrame | null>(null); // of an event

  readonly ghosts = new Ghosts();
  readonly news = new News();
  readonly buffer: SnapshotBuffer;
  readonly ownKart = new OwnKart();
  readonly trails = new Trails();
  readonly ways = new Ways(); // in a car park
  readonly clearances = new Map<number, Clearance>(); // of each seat
  readonly drivenUntil = new Map<number, number>(); // last tick of the way of a seat
  paces = new Map<number, Pace>();
  rays: RaysFrame | null = null;
  private ages = new InputAges();
  private epoch = $state(-1); // of the snapshots
  private over = -1; // epoch of the race whose lobby this is
  private readMs = -Infinity;

  constructor(private readonly isRecording = false) {
    this.buffer = new SnapshotBuffer(isRecording);
  }

  take(frame: Frame, arrivedMs: number): void {
    switch (frame.kind) {
      case 'snapshot':
        return this.takeSnapshot(frame, arrivedMs);
      case 'standings':
        return this.takeStandings(frame);
      case 'events':
        return this.news.takeEvents(frame);
      case 'course':
        this.course = new Course(frame);
        return this.forget();
      case 'rules':
        this.rules = frame;
        this.rig = rigOf(frame.values);
        return;
      case 'line':
        this.line = frame.x.length ? new ReferenceLine(frame) : null;
        return this.measureReference();
      case 'rays':
        this.rays = frame;
        return;
      case 'links':
        return this.ages.take(frame);
      case 'telemetry':
        this.telemetry = frame.buffer;
        return;
      case 'hint':
        return this.takeHint(frame, arrivedMs);
      case 'alerts':
        this.alerts = new Map(frame.karts.map((alert) => [alert.seat, alert]));
        return this.news.takeAlerts(frame);
      case 'own pose':
      case 'own alert':
        return this.ownKart.take(frame, arrivedMs);
      case 'lot':
        this.lot = frame;
        return;
      case 'programme':
        this.programme = frame;
        return;
      case 'ghosts':
        return this.ghosts.take(frame);
      case 'hud':
        this.hud = frame;
        return;
      case 'briefing':
        this.briefing = frame;
    }
  }

  get isLot(): boolean {
    return this.course?.isLot ?? false;
  }

  /** Whether karts can be parked: in a car park, or after a race. */
  get hasSlots(): boolean {
    return this.isLot || (this.course?.frame.slots.length ?? 0) > 0;
  }

  /** The body of a kart. */
  get body(): KartBody {
    const frame = this.course?.frame;
    if (!frame?.kartLength) return SMALL_BODY;
    return { length: frame.kartLength, width: frame.kartWidth, ahead: frame.kartAhead };
  }

  get items(): readonly string[] {
    return this.rules?.items ?? this.briefing?.items ?? [];
  }

  driver(seat: number): string {
    return this.standings?.rows.find((row) => row.seat === seat)?.driver ?? '';
  }

  kart(seat: number): KartFrame | null {
    return this.buffer.newest?.karts.find((kart) => kart.seat === seat) ?? null;
  }

  /** Whether there is a ghost to choose in the race that is on. */
  get hasGhosts(): boolean {
    return this.ghosts.areFor(this.epoch);
  }

  /** The ghost of the race that is on, as chosen. */
  get ghost(): Ghost | null {
    return this.ghosts.chosenFor(this.epoch);
  }

  /** Returns a snapshot with the ghost beside the kart that drives alone. */
  withGhost(frame: SnapshotFrame | null): SnapshotFrame | null {
    const { ghost } = this;
    const [kart] = frame?.karts ?? [];
    const pace = kart && this.paces.get(kart.seat);
    if (!frame || !ghost || !pace || frame.phase !== Phase.RUNNING) return frame;
    const shown = ghost.kartAt(frame.tick, pace, this.standings?.startTick ?? 0);
    return shown ? { ...frame, karts: [...frame.karts, shown] } : frame;
  }

  /** Returns how much later than the ghost a kart is [s], NaN if unknown. */
  toGhostS(seat: number): number {
    const [ghost, pace, frame] = [this.ghost, this.paces.get(seat), this.buffer.newest];
    if (!ghost || !pace || !frame) return NaN;
    return ghost.deltaOf(pace, frame.tick, this.standings?.startTick ?? 0);
  }

  /** Stretches in which help that fades is given, from and to [m] of progress. */
  get helped(): readonly [number, number][] {
    return this.hint?.told.helped ?? [];
  }

  /** What the own kart says: by itself where it is heard, else as the server tells. */
  alertOfOwn(seat: number, nowMs: number): KartAlert | null {
    return this.ownKart.alert(nowMs) ?? this.alerts.get(seat) ?? null;
  }

  /** The flag for this page's driver: that of the race, or a more severe one for its kart. */
  flagIn(frame: SnapshotFrame): number {
    return Math.max(frame.flag, this.hud?.flag ?? 0);
  }

  /** Clears the data of the track, for another race or another place in a recording. */
  forget(): void {
    this.forgetDriving();
    this.news.forget();
    this.measureReference();
  }

  /** The next data replace all others, as after seeking in a recording. */
  startOver(): void {
    this.buffer.clear();
    this.forget();
    this.epoch = -1;
    this.readMs = -Infinity;
  }

  /** There is no event any more. */
  forgetEvent(): void {
    this.programme = null;
    this.ghosts.forget();
  }

  private forgetDriving(): void {
    this.paces = new Map();
    this.ages = new InputAges();
    this.trails.clear();
    this.ways.clear();
    this.clearances.clear();
    this.drivenUntil.clear();
    this.rays = null;
    this.alerts = new Map();
    this.telemetry = null;
    this.hint = null;
  }

  private takeSnapshot(frame: SnapshotFrame, arrivedMs: number): void {
    if (frame.epoch === this.over) return; // standings may overtake the last snapshots of a race
    const last = this.buffer.newest;
    const isBack = last !== null && frame.tick < last.tick - 1;
    if (frame.epoch !== this.epoch || isBack) {
      if (this.epoch >= 0) this.forgetDriving();
      this.epoch = frame.epoch;
    }
    // A restarted server counts races and events from one again.
    if (last && frame.epoch === last.epoch && frame.tick < last.tick - BACK_TICKS) {
      this.news.forget();
    }
    this.buffer.push(frame, arrivedMs);
    this.trails.note(frame);
    this.ages.note(frame, arrivedMs);
    if (this.isLot) this.noteLot(frame);
    else this.notePaces(frame);
    const isNews = frame.flag !== this.headline?.flag || frame.phase !== last?.phase;
    if (isNews || arrivedMs - this.readMs > READ_MS) this.read(frame, arrivedMs);
  }

  /** Takes the words of a coach; those of the last lap may come when the next race is on. */
  private takeHint(told: HintFrame, arrivedMs: number): void {
    if (told.epoch === this.epoch) this.hint = { told, arrivedMs };
  }

  private noteLot(frame: SnapshotFrame): void {
    this.ways.note(frame, this.body.ahead);
    if (frame.lights > 0) return;
    for (const kart of frame.karts) {
      if (kart.status !== Status.RACING) continue;
      this.drivenUntil.set(kart.seat, frame.tick);
      const now = clearanceOf(kart, frame, this.body, this.course!, this.lot);
      const least = Math.min(this.clearances.get(kart.seat)?.least ?? Infinity, now);
      this.clearances.set(kart.seat, { now, least });
    }
  }

  private notePaces(frame: SnapshotFrame): void {
    if (!this.course || frame.phase === Phase.LOBBY) return;
    const start = this.standings?.startTick ?? 0;
    const isEarly = frame.lights > 0 || frame.tick < start + EARLY_TICKS;
    for (const kart of frame.karts) {
      let pace = this.paces.get(kart.seat);
      if (!pace) {
        pace = new Pace(this.course.length);
        this.paces.set(kart.seat, pace);
      }
      pace.note(kart, frame.tick, isEarly);
    }
  }

  private takeStandings(frame: StandingsFrame): void {
    this.standings = frame;
    const inLobby = frame.phase === Phase.LOBBY;
    this.over = inLobby ? frame.epoch : -1;
    if (inLobby) this.clearTrack(frame.epoch);
    const { newest } = this.buffer;
    if (newest) this.read(newest, this.readMs); // the last standings follow the last snapshot
    else {
      const { phase, flag, tick } = frame;
      this.headline = { phase, flag, tick, lights: 0, lap: 0 };
      this.makeRows(null, 0); // a lobby: there is nothing on the track yet
    }
  }

  /** Clears the track: a lobby sends no snapshots. */
  private clearTrack(epoch: number): void {
    if (!this.buffer.newest) return;
    this.buffer.clear();
    this.forgetDriving();
    this.epoch = -1;
    this.readMs = -Infinity;
    // Events of the previous race are shown until the next one; not those of another server.
    this.news.forgetOthers(epoch);
  }

  private read(frame: SnapshotFrame, nowMs: number): void {
    this.readMs = nowMs;
    const first = Math.max(0, ...frame.karts.map((kart) => kart.laps));
    const { flag, lights, tick } = frame;
    // The last snapshots may be lost, or skipped by a slow line.
    const phase = this.isOver ? Phase.FINISHED : frame.phase;
    this.headline = { phase, flag, lights, tick, lap: phase === Phase.LOBBY ? 0 : first + 1 };
    this.makeRows(frame, nowMs);
  }

  /** Whether the race of the snapshots is over. */
  private get isOver(): boolean {
    const { phase, epoch } = this.standings ?? {};
    return phase === Phase.FINISHED && epoch === this.epoch;
  }

  private makeRows(snapshot: SnapshotFrame | null, nowMs: number): void {
    const { standings, paces } = this;
    if (!standings) return;
    const ages = this.isRecording ? new Map<number, number>() : this.ages.at(nowMs);
    this.rows = tableOf({ snapshot, standings, paces, ages });
  }

  private measureReference(): void {
    const { line, course } = this;
    this.reference = line && course ? referenceTrace(line, course, BINS) : null;
  }
}

/** Returns whether a flag is a warning. */
export function isCaution(flag: number): boolean {
  return flag !== Flag.GREEN;
}
