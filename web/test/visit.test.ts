import { Builder } from 'flatbuffers';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { Visit } from '../src/race/visit.svelte';
import { Phase } from '../src/wire/tables';
import { Standings } from '../src/wire/tables';

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

  send(): void {}

  close(): void {}

  tell(words: object): void {
    this.onmessage({ data: JSON.stringify(words) });
  }

  /** Tells how the race stands. */
  stand(phase: number): void {
    const builder = new Builder(64);
    const course = builder.createString('round');
    const rows = Standings.createRowsVector(builder, []);
    Standings.startStandings(builder);
    Standings.addCourse(builder, course);
    Standings.addRows(builder, rows);
    Standings.addPhase(builder, phase);
    builder.finish(Standings.endStandings(builder), 'RSTD');
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

test('in a lobby nobody is told that the server brakes the kart', () => {
  const visit = driving();
  Socket.newest.stand(Phase.RUNNING);
  Socket.newest.tell({ type: 'notice', code: 'dead-man', reason: 'no control' });
  expect(visit.note?.code).toBe('dead-man');
  Socket.newest.stand(Phase.LOBBY);
  expect(visit.note).toBeNull();
});
