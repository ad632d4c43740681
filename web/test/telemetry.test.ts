import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { decode } from '../src/wire/decode';
import { type KartTelemetry, readTelemetry } from '../src/race/telemetry';
import { SensorState } from '../src/wire/generated/codes.js';

function golden(): Uint8Array<ArrayBuffer> {
  const line = readFileSync('../tests/net/golden_messages.txt', 'utf8')
    .split('\n')
    .find((line) => line.startsWith('telemetries '))!;
  return Uint8Array.from(Buffer.from(line.split(' ')[1]!, 'hex'));
}

function readFrom(bytes: Uint8Array<ArrayBuffer>): KartTelemetry[] {
  const frame = decode(bytes.buffer);
  if (frame?.kind !== 'telemetry') throw new Error('no telemetry');
  return readTelemetry(frame.buffer);
}

test('how a real kart is is read as the server writes it', () => {
  const [kart] = readFrom(golden());
  expect(kart).toMatchObject({ seat: 3, speed: 3, deviation: 0.25, headingDeviation: 0.125 });
  expect(kart).toMatchObject({ link: 0.5, battery: 0.75 });
  expect(kart!.sensors).toEqual([...Array(7).fill(SensorState.WELL), SensorState.SILENT]);
});

test('wherever telemetry is damaged, no kart is shown that it does not hold', () => {
  for (let at = 8; at + 4 <= golden().length; at += 4) {
    const bytes = golden();
    new DataView(bytes.buffer).setUint32(at, 200_000, true);
    expect(readFrom(bytes).length).toBeLessThan(2);
  }
});
