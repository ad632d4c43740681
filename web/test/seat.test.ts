import { afterEach, beforeEach, expect, test, vi } from 'vitest';

import { DrivenSeat } from '../src/input/seat.svelte';
import type { Visit } from '../src/race/visit.svelte';

type Told = Record<string, unknown>;

class Element {
  isFocused = true;

  constructor(private readonly is: string) {}

  closest(wanted: string): Element | null {
    return wanted.split(', ').includes(this.is) ? this : null;
  }

  blur(): void {
    this.isFocused = false;
  }
}

class HTMLButtonElement extends Element {}

const RACE = { kart: () => null, buffer: { newest: null }, briefing: null };
const PLAIN = { ctrlKey: false, altKey: false, metaKey: false, preventDefault: () => {} };
let heard: Map<string, (event: Told) => void>;
let seat: DrivenSeat;

beforeEach(() => {
  vi.useFakeTimers();
  heard = new Map();
  const listen = (name: string, handler: (event: Told) => void) => heard.set(name, handler);
  vi.stubGlobal('addEventListener', listen);
  vi.stubGlobal('document', { addEventListener: listen, hidden: false });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('localStorage', { getItem: () => null });
  vi.stubGlobal('navigator', {});
  vi.stubGlobal('Element', Element);
  vi.stubGlobal('HTMLButtonElement', HTMLButtonElement);
  seat = new DrivenSeat({ race: RACE } as unknown as Visit, 3);
});

afterEach(() => {
  seat.close();
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function key(kind: 'keydown' | 'keyup', code: string, more: Told = {}): void {
  heard.get(kind)!({ ...PLAIN, code, ...more });
  vi.advanceTimersByTime(1000);
}

test.each(['ctrlKey', 'altKey', 'metaKey'])('a key comes up while %s is held', (held) => {
  key('keydown', 'ArrowUp');
  expect(seat.grip.wheel.throttle).toBe(1);
  key('keyup', 'ArrowUp', { [held]: true });
  expect(seat.grip.wheel.throttle).toBe(0);
});

test('a key comes up although a form has the focus by then', () => {
  key('keydown', 'ArrowUp');
  key('keyup', 'ArrowUp', { target: new Element('input') });
  expect(seat.grip.wheel.throttle).toBe(0);
});

test('shortcuts of the browser and what is typed drive no kart', () => {
  key('keydown', 'KeyW', { ctrlKey: true });
  key('keydown', 'KeyW', { target: new Element('input') });
  key('keyup', 'KeyW', { target: new Element('input') });
  expect(seat.grip.isHeld).toBe(false);
});

test('a button that was pressed gives the focus back, as the space bar is a brake', () => {
  const button = new HTMLButtonElement('button');
  heard.get('click')!({ target: button });
  expect(button.isFocused).toBe(false);
});
