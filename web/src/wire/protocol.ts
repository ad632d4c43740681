// The texts between the page and the gateway; see docs/gateway.md.

export type Role = 'spectate' | 'drive' | 'steward' | 'companion';

export interface Hello {
  role: Role;
  token: string;
  seat: number; // -1 for any
  name: string;
  source: string; // live, or recording:NAME
  rate: number; // snapshots a second
}

export interface Welcome {
  type: 'welcome';
  role: Role;
  session: string;
  seat?: number;
  ready?: boolean; // what a driver who comes back asked for, and what still holds
  park?: boolean;
  sequence?: number; // of a driver's newest control that the server accepted
  source: string;
  resume: string; // token for one reconnection
  preset?: string;
  delay_ms?: number;
  version: string;
  may?: string[];
}

export interface Refused {
  type: 'refused';
  code: string;
  reason: string;
}

export interface Notice {
  type: 'notice';
  code: string;
  reason?: string;
}

export interface Acted {
  type: 'acted';
  id: number;
  accepted: boolean;
  reason: string;
}

export interface Log {
  type: 'log';
  lines: string[];
  reason?: string; // if they are not available
}

export interface Pong {
  type: 'pong';
  t: number;
  server_us?: number; // not before the first snapshot
}

export interface Position {
  type: 'position';
  tick: number;
  first: number;
  last: number;
  playing: boolean;
  speed: number;
  sought?: boolean; // the next data replace all others
}

export interface ReadyAnswer {
  type: 'ready';
  ready: boolean;
  accepted: boolean;
  reason: string;
}

export interface ParkAnswer {
  type: 'park';
  park: boolean;
  accepted: boolean;
  reason: string;
}

export interface UseAnswer {
  type: 'use';
  accepted: boolean;
  reason: string;
}

export interface ProtestAnswer {
  type: 'protest';
  accepted: boolean;
  reason: string;
}

export type Told =
  | Welcome
  | Refused
  | Notice
  | ReadyAnswer
  | ParkAnswer
  | UseAnswer
  | ProtestAnswer
  | Acted
  | Log
  | Pong
  | Position;

export type Request =
  | { type: 'follow'; seat: number; rays: boolean }
  | { type: 'rate'; rate: number }
  | { type: 'ready'; ready: boolean }
  | { type: 'park'; park: boolean }
  | { type: 'use' }
  | { type: 'leave' }
  | {
      type: 'act';
      act: string;
      seat: number;
      value: number;
      id: number;
      protest?: number;
      note?: string;
    }
  | { type: 'protest'; against: number; why: string }
  | { type: 'log' }
  | { type: 'ping'; t: number }
  | { type: 'play'; speed: number }
  | { type: 'pause' }
  | { type: 'seek'; tick: number }
  | { type: 'step'; ticks: number };

/** Refusals after which the page retries by itself. */
const PASSING = new Set(['full', 'late', 'too-fast', 'slow', 'no-race']);

export function isPassing(code: string): boolean {
  return PASSING.has(code);
}

export interface RecordingEntry {
  name: string;
  course: string;
  started: string;
  seconds: number;
  karts: number;
  finished: boolean;
}
