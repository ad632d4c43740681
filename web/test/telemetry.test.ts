import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { decode } from '../src/wire/decode';
import { readTelemetry } from '../src/race/telemetry';
import { SensorState } from '../src/wire/generated/codes.js';

test('how a real kart is is read as the server writes it', () => {
  const golden = readFileSync('../tests/net/golden_messages.txt', 'utf8')
    .split('\n')
    .find((line) => line.startsWith('telemetries '))!;
  const bytes = Uint8Array.from(Buffer.from(golden.split(' ')[1]!, 'hex'));
  const frame = decode(bytes.buffer);
  expect(frame?.kind).toBe('telemetry');
  const [kart] = readTelemetry(frame?.kind === 'telemetry' ? frame.buffer : (null as never));
  expect(kart).toMatchObject({ seat: 3, speed: 3, deviation: 0.25, headingDeviation: 0.125 });
  expect(kart).toMatchObject({ link: 0.5, battery: 0.75 });
  expect(kart!.sensors).toEqual([...Array(7).fill(SensorState.WELL), SensorState.SILENT]);
});
