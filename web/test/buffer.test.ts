import { expect, test } from 'vitest';

import { SnapshotBuffer, between, wrap } from '../src/race/buffer';
import { kart, snapshot } from './frames';

function filled(buffer: SnapshotBuffer, lateMs: (index: number) => number): void {
  for (let i = 0; i < 30; i++) {
    const frame = snapshot({ serverMs: 1000 + i * 40, tick: i, karts: [kart({ x: i })] });
    buffer.push(frame, 5000 + i * 40 + lateMs(i));
  }
}

test('karts are drawn the stated delay after they were there', () => {
  const buffer = new SnapshotBuffer();
  filled(buffer, () => 0);
  // The newest was made 1160 ms after the first; 100 ms before that x was 29 - 2.5.
  expect(buffer.sample(5000 + 29 * 40)!.karts[0]!.x).toBeCloseTo(26.5);
});

test('an uneven network does not shake the karts', () => {
  const buffer = new SnapshotBuffer();
  filled(buffer, (index) => (index % 3) * 15);
  expect(buffer.sample(5000 + 29 * 40)!.karts[0]!.x).toBeCloseTo(26.5);
});

test('beyond the newest snapshot a kart goes straight on, but not for long', () => {
  const buffer = new SnapshotBuffer();
  buffer.push(snapshot({ serverMs: 1000 }), 5000);
  expect(buffer.sample(5150)!.karts[0]!.x).toBeCloseTo(0.5); // 50 ms at 10 m/s
  expect(buffer.sample(9000)!.karts[0]!.x).toBeCloseTo(1.0);
});

test('a heading turns the short way', () => {
  const early = snapshot({ karts: [kart({ heading: 3.1 })] });
  const late = snapshot({ karts: [kart({ heading: -3.1 })] });
  expect(wrap(between(early, late, 0.5).karts[0]!.heading - Math.PI)).toBeCloseTo(0);
});

test('a kart that was put elsewhere is not drawn on the way', () => {
  const early = snapshot({ karts: [kart({ speed: 0 })] });
  const late = snapshot({ karts: [kart({ speed: 0, x: 50 })] });
  expect(between(early, late, 0.5).karts[0]!.x).toBe(50);
});

test('a recording that stands shows its newest snapshot', () => {
  const buffer = new SnapshotBuffer(true);
  buffer.setRate(0);
  buffer.push(snapshot({ tick: 60, karts: [kart({ x: 1 })] }), 0);
  buffer.push(snapshot({ tick: 61, karts: [kart({ x: 2 })] }), 900);
  expect(buffer.sample(10_000)!.karts[0]!.x).toBe(2);
});

test('another epoch begins the buffer anew', () => {
  const buffer = new SnapshotBuffer();
  filled(buffer, () => 0);
  buffer.push(snapshot({ serverMs: 2200, epoch: 2, karts: [kart({ x: 99 })] }), 6200);
  expect(buffer.sample(6200)!.karts[0]!.x).toBe(99);
});
