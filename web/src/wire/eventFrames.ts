// Messages of an event of several races as plain data. SI units.

import type { EventPhase } from './tables';

/** An attempt or a race of an event. */
export interface CallFrame {
  title: string;
  teams: string[];
}

export interface DeletedLapFrame {
  attempt: number; // from 1
  lap: number; // from 1
  why: string;
}

/** How a team fares in an event. */
export interface TeamFrame {
  name: string; // its number and name
  seat: number;
  place: number; // in the classification so far, from 1; 0: not classified
  points: number;
  timeUs: number; // that counts in the time trial that is on, or was last; 0: none yet
  attemptsUs: number[]; // in it; 0: failed
  attemptsLeft: number; // in it, with the one that is driven
  deleted: DeletedLapFrame[];
  remark: string;
  canChange: boolean; // its last result: others may protest against it
}

/** A protest of a team, or a decision that the stewards took by themselves. */
export interface ProtestFrame {
  number: number;
  title: string; // of the attempt or race
  by: string; // empty for the stewards
  against: string;
  why: string;
  outcome: string; // empty while it is open
}

/** An event as it stands. */
export interface ProgrammeFrame {
  kind: 'programme';
  event: string;
  title: string; // of its format
  stage: string;
  phase: EventPhase;
  now: CallFrame | null; // what is called, driven or was driven last
  limitS: number; // of it from the lights, 0 for none
  untilMs: number; // of the server's clock: when the call or the review ends, 0 if unknown
  driven: number; // attempts and races so far
  drives: number;
  hasPoints: boolean;
  attempts: number; // of each team in the time trial that is on, 0 in races
  coming: CallFrame[];
  teams: TeamFrame[]; // best place first
  protests: ProtestFrame[]; // oldest first
}

/** A lap, or all of an attempt, to drive against. */
export interface GhostFrame {
  team: string;
  seat: number;
  isBest: boolean; // of all; else the own best of the team that drives
  fromLights: boolean; // it begins with the lights, else at the timing line
  timeUs: number;
  seconds: ArrayLike<number>; // since its beginning, of each sample
  x: ArrayLike<number>; // [m]
  y: ArrayLike<number>; // [m]
  distance: ArrayLike<number>; // [m] from the timing line, over all laps
}

export interface GhostsFrame {
  kind: 'ghosts';
  epoch: number;
  ghosts: GhostFrame[];
}
