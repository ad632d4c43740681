import { expect, test } from 'vitest';

import { mixOf, tonesOfAlerts, tonesOfEvent } from '../src/sound/mix';
import { EventKind, Status } from '../src/wire/tables';
import { event, kart } from './frames';

test('the faster a kart, the higher and louder its motor', () => {
  const [slow, fast] = [mixOf(kart({ speed: 2 }), 10), mixOf(kart({ speed: 10 }), 10)];
  expect(fast.pitch).toBe(190);
  expect(slow.pitch).toBeCloseTo(42 + 0.2 * 148);
  expect(slow.motor).toBeLessThan(fast.motor);
  expect(mixOf(kart({ speed: -2 }), 10)).toEqual(slow);
});

test('tyres are silent where they roll, and squeal where they slide', () => {
  expect(mixOf(kart({ speed: 10, lateralSpeed: 0.5 }), 10).squeal).toBe(0);
  expect(mixOf(kart({ speed: 10, lateralSpeed: -10 * Math.tan(0.18) }), 10).squeal).toBeCloseTo(
    0.5,
  );
  expect(mixOf(kart({ speed: 10, lateralSpeed: 6 }), 10).squeal).toBe(1);
  expect(mixOf(kart({ speed: 0.5, lateralSpeed: 0.5 }), 10).squeal).toBe(0);
});

test('a kart that is not in the race is silent', () => {
  const { motor, squeal } = mixOf(kart({ status: Status.RETIRED, lateralSpeed: 9 }), 10);
  expect([motor, squeal]).toEqual([0, 0]);
});

test('a driver hears what happens to the own kart only', () => {
  const picked = event({ kind: EventKind.PICK_UP, kart: 3, other: 1 });
  expect(tonesOfEvent(picked, 3)).toHaveLength(2);
  expect(tonesOfEvent(picked, 4)).toEqual([]);
  expect(tonesOfEvent(event({ kind: EventKind.GREEN, kart: -1 }), -1)).toEqual([]);
  const hit = tonesOfEvent(event({ kind: EventKind.HIT, kart: 3 }), 3)[0]!;
  expect(hit.to).toBeLessThan(hit.from);
});

test('a warning is told once, an urgent one three times as insistently', () => {
  expect(tonesOfAlerts([], ['yellow'])).toHaveLength(1);
  expect(tonesOfAlerts(['yellow'], ['yellow'])).toEqual([]);
  expect(tonesOfAlerts(['yellow'], ['red', 'yellow'])).toHaveLength(3);
});
