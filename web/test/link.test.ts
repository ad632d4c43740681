import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { Link, type LinkState } from '../src/wire/link';
import type { Hello } from '../src/wire/protocol';

class Socket {
  static readonly OPEN = 1;
  static made: Socket[] = [];
  readyState = Socket.OPEN;
  bufferedAmount = 0;
  sent: string[] = [];
  onopen = () => {};
  onmessage: (message: { data: string }) => void = () => {};
  onclose = () => {};

  constructor() {
    Socket.made.push(this);
  }

  send(data: string): void {
    this.sent.push(data);
  }

  close(): void {
    this.onclose();
  }

  tell(words: object): void {
    this.onmessage({ data: JSON.stringify(words) });
  }

  /** What it said first: pings before that go nowhere. */
  get hello(): Record<string, unknown> {
    const told = this.sent.map((text) => JSON.parse(text) as Record<string, unknown>);
    return told.find(({ type }) => type !== 'ping')!;
  }
}

const HELLO: Hello = {
  role: 'drive',
  token: 'secret',
  seat: 3,
  name: 'Ada',
  source: 'live',
  rate: 60,
};
let states: LinkState[] = [];

function opened(hello = HELLO): Link {
  const link = new Link('ws://here/ws', hello, {
    onState: (state) => states.push(state),
    onFrame: () => {},
    onTold: () => {},
  });
  link.open();
  newest().onopen();
  return link;
}

function newest(): Socket {
  return Socket.made.at(-1)!;
}

beforeEach(() => {
  vi.useFakeTimers();
  const kept = new Map<string, string>();
  vi.stubGlobal('WebSocket', Socket);
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('sessionStorage', {
    getItem: (name: string) => kept.get(name) ?? null,
    setItem: (name: string, value: string) => kept.set(name, value),
    removeItem: (name: string) => kept.delete(name),
  });
  Socket.made = [];
  states = [];
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('a link that was lost comes back with the word of its last welcome, once', () => {
  opened();
  expect(newest().hello).toMatchObject({ token: 'secret', seat: 3 });
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  newest().close();
  vi.advanceTimersByTime(1000);
  newest().onopen();
  expect(newest().hello).toMatchObject({ resume: 'word one', token: '' });
  expect(Socket.made).toHaveLength(2);
  newest().close(); // before it was welcomed: the word is used up
  vi.advanceTimersByTime(2000);
  newest().onopen();
  expect(newest().hello).not.toHaveProperty('resume');
});

/** The newest socket says hello, and is refused. */
function knock(code: string): Record<string, unknown> {
  vi.advanceTimersByTime(6000);
  newest().onopen();
  const { hello } = newest();
  newest().tell({ type: 'refused', code, reason: 'so it is' });
  newest().close();
  return hello;
}

test('a driver shows its word again while the gateway holds the line that was lost for it', () => {
  opened();
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  newest().close();
  const hellos = [knock('used'), knock('used'), knock('used'), knock('used')];
  expect(hellos.map(({ resume }) => resume)).toEqual([...Array(3).fill('word one'), undefined]);
  expect(hellos[3]).toMatchObject({ token: 'secret' });
  expect(states.at(-1)).toBe('refused');
});

test('where its word was used already a spectator comes in by the door', () => {
  opened({ ...HELLO, role: 'spectate' });
  newest().tell({ type: 'welcome', role: 'spectate', resume: 'word one' });
  newest().close();
  expect(knock('used')).toMatchObject({ resume: 'word one' });
  expect(states.at(-1)).toBe('waiting');
  expect(knock('full')).toMatchObject({ token: 'secret' });
});

test('who is refused for good does not knock again', () => {
  opened();
  newest().tell({ type: 'refused', code: 'token', reason: 'it does not fit' });
  newest().close();
  vi.advanceTimersByTime(60_000);
  expect(states.at(-1)).toBe('refused');
  expect(Socket.made).toHaveLength(1);
});

test('who finds no race waits longer each time', () => {
  opened();
  const count = () => Socket.made.length;
  for (const longest of [700, 1300, 2600, 5100]) {
    const before = count();
    newest().tell({ type: 'refused', code: 'no-race', reason: 'no server answers' });
    newest().close();
    vi.advanceTimersByTime(longest);
    expect(count()).toBe(before + 1);
    newest().onopen();
  }
  expect(states).not.toContain('refused');
});

test('an old control does not queue behind others', () => {
  const link = opened();
  const bytes = new Uint8Array(60);
  expect(link.sendBytes(bytes)).toBe(true);
  newest().bufferedAmount = 1000;
  expect(link.sendBytes(bytes)).toBe(false);
});

test('another driver in the same tab does not come back as the one before', () => {
  opened();
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word of Ada' });
  for (const other of [{ name: 'Bea' }, { token: 'of Cleo' }]) {
    opened({ ...HELLO, ...other });
    expect(newest().hello).toMatchObject(other);
    expect(newest().hello).not.toHaveProperty('resume');
  }
});

test('who has left the seat takes it anew', () => {
  const link = opened();
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  link.leave();
  expect(newest().sent.at(-1)).toBe('{"type":"leave"}');
  opened();
  expect(newest().hello).not.toHaveProperty('resume');
});

test('a link on which no ping is answered is lost within eight seconds', () => {
  opened();
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  const dead = newest();
  dead.close = () => {}; // no network: the browser waits for an answer
  vi.advanceTimersByTime(5000);
  expect(states.at(-1)).toBe('open');
  vi.advanceTimersByTime(3000);
  expect(states).toContain('waiting');
  expect(dead.onmessage).toBeNull();
  vi.advanceTimersByTime(1000);
  expect(Socket.made).toHaveLength(2);
});

test('a link on which something comes now and then is not lost', () => {
  opened();
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  for (let seconds = 0; seconds < 60; seconds += 5) {
    vi.advanceTimersByTime(5000);
    newest().tell({ type: 'pong', t: 0 });
  }
  expect(Socket.made).toHaveLength(1);
});

test('a gateway that takes ten seconds to find a seat is waited for', () => {
  opened();
  vi.advanceTimersByTime(10_000);
  newest().tell({ type: 'welcome', role: 'drive', resume: 'word one' });
  expect(states.at(-1)).toBe('open');
});
