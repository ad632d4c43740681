// Messages of the gateway as plain data. SI units; angles in radians, left positive.

import type { ByteBuffer } from 'flatbuffers';
import type {
  Advice,
  DangerStage,
  Ending,
  EventKind,
  Flag,
  HintKind,
  Merit,
  Phase,
  RayHit,
  Status,
} from './tables';
import type { GhostsFrame, ProgrammeFrame } from './eventFrames';

export interface KartFrame {
  seat: number;
  x: number; // [m] east
  y: number; // [m] north
  heading: number;
  speed: number; // [m/s]
  lateralSpeed: number; // [m/s] to the left
  yawRate: number; // [rad/s]
  steering: number; // at the road wheels
  progress: number; // [m] along the centre line from the timing line
  speedCap: number; // [m/s]
  acknowledged: number; // sequence of the newest control that the server accepted
  laps: number; // completed
  rank: number; // from 1
  status: Status;
  item: number; // held, 0 for none
  effects: number; // how many act
  flags: number; // bits of KartFlag
  isGhost?: boolean; // an earlier lap, drawn beside the race
}

export interface HazardFrame {
  x: number;
  y: number;
  radius: number;
  item: number;
}

/** A person on the ground. */
export interface Disc {
  x: number; // [m]
  y: number;
  radius: number;
}

/** A rectangle on the ground. */
export interface Rectangle {
  x: number; // [m] of its middle
  y: number;
  heading: number;
  length: number; // [m]
  width: number;
}

/** The box of a trailer; those of one vehicle follow each other, the nearest one first. */
export interface TrailerFrame extends Rectangle {
  limit: number; // a larger angle at its hitch is a jack-knife
  seat: number; // of the vehicle that draws it
}

export interface SnapshotFrame {
  kind: 'snapshot';
  serverMs: number; // the server's clock
  epoch: number;
  tick: number;
  lights: number; // [s] until the start, 0 once the race runs
  phase: Phase;
  flag: Flag;
  karts: KartFrame[];
  boxes: Uint8Array; // 1 for each item box that is ready
  hazards: HazardFrame[];
  walkers: Disc[]; // people in a car park
  trailers: TrailerFrame[];
}

export interface ParkingFrame {
  ending: Ending;
  slot: number; // -1 where it has no number
  way: number; // [m] driven
  reversed: number; // [m] of it in reverse
  moves: number; // changes of direction
}

/** How the planner would park for the same task. */
export interface PlannedFrame {
  seconds: number;
  way: number; // [m]
  moves: number; // changes of direction
}

export interface StandingFrame {
  driver: string;
  seat: number;
  rank: number;
  laps: number;
  status: Status;
  lastLapUs: number;
  bestLapUs: number;
  raceTimeUs: number;
  gapUs: number;
  penalties: number;
  penaltyUs: number;
  lapTimesUs: number[];
  parking: ParkingFrame | null; // only in a car park
  planned: PlannedFrame | null; // where a driver from outside of the server has parked
  timing: TimingFrame | null; // on a course; none in recordings from before there was any
}

/** What the server's timing tells of a kart beside its laps. */
export interface TimingFrame {
  intervalUs: number; // to the kart one place ahead, 0 if unknown
  theoreticalUs: number; // sum of its best sectors, 0 until it has driven each
  lapsDown: number; // whole laps behind the leader
  gained: number; // places since the grid
  sectorsUs: number[]; // of this lap, or of the last one until its first is through; 0 not yet
  sectorMerits: Merit[];
  miniMerits: Merit[]; // of twenty equal parts of a lap
  stints: StintFrame[]; // oldest first
}

/** What a kart drives until it stands or is rescued. */
export interface StintFrame {
  firstLap: number; // from 1
  laps: number; // that it has finished
  bestUs: number; // 0: none yet
  items: number; // that it used
}

export interface StandingsFrame {
  kind: 'standings';
  epoch: number;
  tick: number;
  startTick: number; // when the lights go out
  phase: Phase;
  flag: Flag;
  laps: number;
  course: string;
  rows: StandingFrame[];
}

export interface EventFrame {
  sequence: number; // counts all events of an epoch from 1
  tick: number;
  kind: EventKind;
  kart: number; // -1 for the whole race
  other: number;
  value: number;
}

export interface EventsFrame {
  kind: 'events';
  epoch: number;
  events: EventFrame[];
}

export interface CourseFrame {
  kind: 'course';
  name: string;
  title: string;
  spacing: number; // [m] between samples of the centre line
  line: Float64Array; // x, y, heading, curvature of each sample
  halfWidths: Float64Array; // left, right [m] of each sample
  kerb: number; // [m]
  grass: number; // [m]
  borders: Float64Array; // x0, y0, x1, y1 of each wall
  gates: Float64Array; // progress [m]
  sectors: number[]; // indices of the gates that end a sector
  grid: Float64Array; // x, y, heading of each place
  boxes: Float64Array; // x, y of each item box
  obstacles: Float64Array; // x, y, heading, length, width of each
  kartLength: number; // [m], 0 if unknown
  kartWidth: number; // [m]
  kartAhead: number; // [m] from the centre of gravity forward to the middle of the body
  slots: Rectangle[]; // of a car park
}

export interface Goal extends Rectangle {
  seat: number;
  slot: number; // -1 where it has no number
}

export interface Block extends Rectangle {
  kind: RayHit;
}

/** The way that a parking driver of the server has planned. */
export interface PlannedWayFrame {
  seat: number;
  points: { x: number; y: number }[]; // of the middle of the body [m]
}

/** What was drawn for a round in a car park. */
export interface LotFrame {
  kind: 'lot';
  epoch: number;
  goals: Goal[];
  blocks: Block[];
  ways: PlannedWayFrame[];
}

export interface RulesFrame {
  kind: 'rules';
  values: Map<string, string>;
  items: string[]; // number 1 is the first
}

export interface LineFrame {
  kind: 'line';
  spacing: number; // [m] between samples
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  speed: ArrayLike<number>; // [m/s]
  time: ArrayLike<number>; // [s]
  lapS: number; // [s] of the whole lap
  note: string; // why it is not the line of the shortest lap
}

export interface RaysFrame {
  kind: 'rays';
  tick: number;
  seat: number;
  x: number;
  y: number;
  heading: number;
  lidarAhead: number; // [m] of the centre of gravity
  radarAhead: number; // [m]
  lidarField: number; // [rad] between the outermost rays
  lidar: ArrayLike<number>; // ranges, right to left, 0 without a return
  radarAngles: ArrayLike<number>;
  radar: ArrayLike<number>;
  radarKinds: ArrayLike<RayHit>;
}

export interface LinksFrame {
  kind: 'links';
  ages: Map<number, number>; // [ms] of each seat's input, -1 where none is expected
}

/** What a real kart says that it sees, and does by itself. */
export interface KartAlert {
  seat: number;
  stage: DangerStage;
  cause: number; // bits of Cause
  hit: RayHit; // what is in the way
  advice: Advice;
  bearing: number; // from straight ahead
  distance: number; // [m] from the middle of the front bumper, 0 where nothing is in the way
  time: number; // [s] until they meet, 0 where they do not
  needed: number; // [m/s²] of braking
}

/** How real karts are, as it came: only the steward's view reads it. */
export interface TelemetryFrame {
  kind: 'telemetry';
  buffer: ByteBuffer;
}

/** What a coach says to the driver of this page. */
export interface HintFrame {
  kind: 'hint';
  epoch: number; // of the race
  lap: number; // that ended; 0 for a cue on the way
  timeUs: number; // of the lap
  behindUs: number | null; // behind the limit, null where the lap is not compared with it
  reason: string; // why it is not, in English
  fault: HintKind;
  corner: string;
  size: number; // [m], of a slow bend [m/s]
  reach: number; // [m] from where the limit brakes to the apex; 0 if it needs no brakes
  helped: [number, number][]; // stretches in which help that fades is given, progress [m]
}

export interface AlertsFrame {
  kind: 'alerts';
  tick: number;
  karts: KartAlert[];
}

/** What the kart beside this page says itself, with a server or without. */
export interface OwnAlertFrame {
  kind: 'own alert';
  alert: KartAlert; // its seat is -1
}

/** Where the kart beside this page says that it is. */
export interface OwnPoseFrame {
  kind: 'own pose';
  speed: number; // [m/s]
  deviation: number; // [m] of its place
  quality: number; // of its sensors, 0 to 1
}

export interface EffectFrame {
  item: number;
  remaining: number; // [s]
}

export interface HudFrame {
  kind: 'hud';
  immune: number; // [s]
  effects: EffectFrame[];
  flag: Flag; // shown to this kart
  isLed: boolean; // the parking driver of the server has the wheel
}

export interface BriefingFrame {
  kind: 'briefing';
  seat: number;
  epoch: number;
  laps: number;
  items: string[];
  vehicle: string;
  numbers: Map<string, number>;
}

export type Frame =
  | ProgrammeFrame
  | GhostsFrame
  | SnapshotFrame
  | StandingsFrame
  | EventsFrame
  | CourseFrame
  | RulesFrame
  | LineFrame
  | RaysFrame
  | LinksFrame
  | AlertsFrame
  | TelemetryFrame
  | HintFrame
  | OwnAlertFrame
  | OwnPoseFrame
  | LotFrame
  | HudFrame
  | BriefingFrame;
