import { Builder } from 'flatbuffers';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { Visit } from '../src/race/visit.svelte';
import { EventPhase, Hud, Phase, Programme, Standings, Status } from '../src/wire/tables';
import { Call } from '../src/wire/generated/spectate/call.js';
import { Standing } from '../src/wire/generated/spectate/standing.js';

class Socket {
  static readonly OPEN = 1;
  static newest: Socket;
  readyState = Socket.OPEN;
  onopen = () => {};
  onmessage: (message: { data: string | ArrayBuffer }) => void = () => {};
  onclose = () => {};

  constructor() {
    Socket.newest = this;
  }

  sent: string[] = [];

  send(text: string): void {
    this.sent.push(text);
  }

  close(): void {}

  tell(words: object): void {
    this.onmessage({ data: JSON.stringify(words) });
  }

  /** Tells how the race stands, in which seat 3 has a status. */
  stand(phase: number, status: Status = Status.RACING): void {
    const builder = new Builder(64);
    const course = builder.createString('round');
    const driver = builder.createString('Ada');
    Standing.startStanding(builder);
    Standing.addDriver(builder, driver);
    Standing.addSeat(builder, 3);
    Standing.addStatus(builder, status);
    const rows = Standings.createRowsVector(builder, [Standing.endStanding(builder)]);
    Standings.startStandings(builder);
    Standings.addCourse(builder, course);
    Standings.addRows(builder, rows);
    Standings.addPhase(builder, phase);
    this.show(builder, Standings.endStandings(builder), 'RSTD');
  }

  /** Tells who is called in an event, until when by the server's clock. */
  call(team: string, untilUs: bigint): void {
    const builder = new Builder(64);
    const name = builder.createString(team);
    const names = Call.createTeamsVector(builder, [name]);
    Call.startCall(builder);
    Call.addTitle(builder, name);
    Call.addTeams(builder, names);
    const now = Call.endCall(builder);
    const coming = Programme.createComingVector(builder, []);
    const teams = Programme.createTeamsVector(builder, []);
    Programme.startProgramme(builder);
    for (const add of [Programme.addEvent, Programme.addTitle, Programme.addStage]) add(builder, name);
    Programme.addPhase(builder, EventPhase.CALLED);
    Programme.addNow(builder, now);
    Programme.addUntilUs(builder, untilUs);
    Programme.addComing(builder, coming);
    Programme.addTeams(builder, teams);
    this.show(builder, Programme.endProgramme(builder), 'RPRG');
  }

  /** Tells who has the wheel of the vehicle. */
  lead(isLed: boolean): void {
    const builder = new Builder(64);
    Hud.startHud(builder);
    Hud.addLed(builder, isLed);
    this.show(builder, Hud.endHud(builder), 'RHUD');
  }

  private show(builder: Builder, table: number, identifier: string): void {
    builder.finish(table, identifier);
    this.onmessage({ data: builder.asUint8Array().slice().buffer });
  }
}

beforeEach(() => {
  vi.stubGlobal('WebSocket', Socket);
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('location', { protocol: 'http:', host: 'here' });
  vi.stubGlobal('sessionStorage', { getItem: () => null, setItem: () => {}, removeItem: () => {} });
});

afterEach(() => vi.unstubAllGlobals());

function driving(): Visit {
  const hello = { role: 'drive', token: '', seat: 3, name: 'Ada', source: 'live', rate: 60 } as const;
  const visit = new Visit(hello);
  Socket.newest.tell({ type: 'welcome', role: 'drive', resume: 'word', seat: 3 });
  Socket.newest.stand(Phase.LOBBY);
  return visit;
}

test('who was ready for one race is asked again before the next', () => {
  const visit = driving();
  Socket.newest.tell({ type: 'ready', ready: true, accepted: true, reason: '' });
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.isReady).toBe(true);
  Socket.newest.stand(Phase.RUNNING);
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.isReady).toBe(false);
});

test('each call of an event asks again, also that of a server that was started again', () => {
  const visit = driving();
  const answer = { type: 'ready', ready: true, accepted: true, reason: '' };
  for (const untilUs of [30_000_000n, 60_000_000n]) {
    Socket.newest.call('Ada', untilUs);
    Socket.newest.tell(answer);
    Socket.newest.call('Ada', untilUs);
    expect(visit.isReady).toBe(true);
  }
  Socket.newest.call('Ada', 90_000_000n);
  expect(visit.isReady).toBe(false);
});

test('in a lobby, and while others drive, nobody is told that the server brakes the kart', () => {
  const visit = driving();
  Socket.newest.stand(Phase.RUNNING);
  Socket.newest.tell({ type: 'notice', code: 'dead-man', reason: 'no control' });
  expect(visit.note?.code).toBe('dead-man');
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.note).toBeNull();
  Socket.newest.stand(Phase.RUNNING, Status.ABSENT);
  expect(visit.note).toBeNull();
});

test('an event is shown no more once the gateway says that there is none', () => {
  const visit = driving();
  Socket.newest.call('Ada', 30_000_000n);
  expect(visit.race.programme).not.toBeNull();
  Socket.newest.tell({ type: 'notice', code: 'no-event', reason: '' });
  expect([visit.race.programme, visit.note]).toEqual([null, null]);
});

test('an event that ended while the line was cut is shown no more', () => {
  const visit = driving();
  Socket.newest.call('Ada', 30_000_000n);
  Socket.newest.tell({ type: 'welcome', role: 'drive', resume: 'word', seat: 3 });
  expect(visit.race.programme).toBeNull();
});

test('the clock of a server is unknown until the gateway tells it', () => {
  const visit = driving();
  Socket.newest.tell({ type: 'pong', t: 0 });
  expect(visit.clock.isKnown).toBe(false);
  Socket.newest.tell({ type: 'pong', t: 0, server_us: 5_000_000 });
  expect(visit.clock.isKnown).toBe(true);
});

test('a recording goes on after a break where it was, and as it was', () => {
  const hello = { role: 'spectate', token: '', seat: -1, name: '', rate: 30 } as const;
  new Visit({ ...hello, source: 'recording:one' });
  const asked = () => Socket.newest.sent.splice(0).filter((text) => !text.includes('ping'));
  const welcome = { type: 'welcome', role: 'spectate', resume: 'word' };
  Socket.newest.tell(welcome);
  expect(asked()).toEqual(['{"type":"play","speed":1}']);
  const position = { type: 'position', tick: 900, first: 0, last: 1000, playing: true, speed: 4 };
  Socket.newest.tell(position);
  Socket.newest.tell(welcome);
  expect(asked()).toEqual(['{"type":"seek","tick":900}', '{"type":"play","speed":4}']);
  Socket.newest.tell({ ...position, playing: false });
  Socket.newest.tell(welcome);
  expect(asked()).toEqual(['{"type":"seek","tick":900}']);
});

test('a refusal is gone once what was asked for is accepted, or after a while', () => {
  vi.useFakeTimers();
  const visit = driving();
  const refused = { type: 'ready', ready: true, accepted: false, reason: 'no answer' };
  Socket.newest.tell(refused);
  expect(visit.note?.reason).toBe('no answer');
  Socket.newest.tell({ ...refused, accepted: true, reason: '' });
  expect(visit.note).toBeNull();
  Socket.newest.tell({ type: 'park', park: true, accepted: false, reason: 'no slot' });
  expect(visit.parkRefusal).toBe('no slot');
  vi.advanceTimersByTime(10_000);
  expect(visit.parkRefusal).toBe('');
  vi.useRealTimers();
});

test('that no race is there is said until one is, whatever is said about the wheel', () => {
  const visit = driving();
  Socket.newest.stand(Phase.RUNNING);
  Socket.newest.tell({ type: 'notice', code: 'no-race', reason: 'no race yet' });
  Socket.newest.tell({ type: 'notice', code: 'dead-man', reason: 'no control' });
  expect(visit.note?.code).toBe('no-race');
  Socket.newest.tell({ type: 'notice', code: 'driving', reason: '' });
  expect(visit.note?.code).toBe('no-race');
  Socket.newest.tell({ type: 'notice', code: 'race', reason: '' });
  expect(visit.note).toBeNull();
});

test('who was ready is so after a reload, until the next race', () => {
  const visit = driving();
  const welcome = { type: 'welcome', role: 'drive', resume: 'word', seat: 3 };
  Socket.newest.tell({ ...welcome, ready: true, park: false });
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.isReady).toBe(true);
  Socket.newest.stand(Phase.RUNNING);
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.isReady).toBe(false);
});

test('who was ready for a call is so after a reload, until the next call', () => {
  const visit = driving();
  Socket.newest.tell({ type: 'welcome', role: 'drive', resume: 'word', seat: 3, ready: true });
  Socket.newest.call('Ada', 30_000_000n);
  expect(visit.isReady).toBe(true);
  Socket.newest.call('Ada', 60_000_000n);
  expect(visit.isReady).toBe(false);
});

test('who has the vehicle parked reads so after a reload', () => {
  const visit = driving();
  Socket.newest.tell({ type: 'welcome', role: 'drive', resume: 'word', seat: 3, park: true });
  Socket.newest.stand(Phase.RUNNING);
  expect(visit.isParking).toBe(true);
});

test('a vehicle that a steward has parked is shown so, and one whose wheel comes back is not', () => {
  const visit = driving();
  Socket.newest.lead(false);
  Socket.newest.tell({ type: 'park', park: true, accepted: true });
  Socket.newest.lead(false); // asked in a race, it waits for the finish
  expect(visit.isParking).toBe(true);
  Socket.newest.lead(true);
  Socket.newest.lead(false);
  expect(visit.isParking).toBe(false);
  Socket.newest.lead(true);
  expect(visit.isParking).toBe(true);
});
