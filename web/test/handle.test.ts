import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { Handle } from '../src/race/handle.svelte';
import type { Request } from '../src/wire/protocol';

let asked: Request[];
let handle: Handle;

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('window', globalThis);
  asked = [];
  handle = new Handle((request) => asked.push(request));
});

afterEach(() => {
  handle.close();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test('steps of a key that is held are asked for together, a few times a second', () => {
  for (let press = 0; press < 30; press++) {
    handle.step(-1);
    vi.advanceTimersByTime(1000 / 30);
  }
  vi.advanceTimersByTime(200);
  expect(asked.length).toBeLessThan(9);
  const ticks = asked.map((request) => (request.type === 'step' ? request.ticks : NaN));
  expect(ticks.reduce((sum, some) => sum + some)).toBe(-30);
});

test('a handle that is let go stays where it was put until the gateway is there', () => {
  handle.move(500);
  handle.ask();
  const position = { type: 'position', first: 0, last: 900, playing: false, speed: 1 } as const;
  handle.note({ ...position, tick: 20, sought: true });
  expect(handle.tick).toBe(500);
  handle.note({ ...position, tick: 500, sought: true });
  expect(handle.tick).toBeNull();
  expect(asked).toEqual([{ type: 'seek', tick: 500 }]);
});
