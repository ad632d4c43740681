import { Builder, ByteBuffer } from 'flatbuffers';
import { expect, test } from 'vitest';

import { decode } from '../src/wire/decode';
import { encodeControl } from '../src/wire/encode';
import { ControlMessage, Snapshot } from '../src/wire/tables';

test('a control carries what the hands do', () => {
  const bytes = encodeControl({
    epoch: 2,
    sequence: 7,
    tick: 60,
    steering: 0.5,
    throttle: -0.25,
    brake: 1,
    buttons: 1,
  });
  expect(String.fromCharCode(...bytes.subarray(4, 8))).toBe('RCTL');
  expect(bytes.length).toBeLessThanOrEqual(256);
  const control = ControlMessage.getRootAsControlMessage(new ByteBuffer(bytes)).control()!;
  expect([control.sequence(), control.steering(), control.throttle()]).toEqual([7, 0.5, -0.25]);
});

test('an empty snapshot is read', () => {
  const builder = new Builder();
  const karts = Snapshot.createBoxesVector(builder, []);
  Snapshot.startKartsVector(builder, 0);
  const none = builder.endVector();
  Snapshot.startSnapshot(builder);
  Snapshot.addTick(builder, 90);
  Snapshot.addKarts(builder, none);
  Snapshot.addBoxes(builder, karts);
  Snapshot.addHazards(builder, none);
  builder.finish(Snapshot.endSnapshot(builder), 'RSNP');
  const bytes = builder.asUint8Array();
  expect(decode(bytes.slice().buffer)).toMatchObject({ kind: 'snapshot', tick: 90, karts: [] });
});

test('what is damaged or unknown is left out', () => {
  expect(decode(new ArrayBuffer(4))).toBeNull();
  expect(decode(new TextEncoder().encode('xxxxABCDxxxx').buffer as ArrayBuffer)).toBeNull();
});

test('a message that claims more rows than there can be is left out', () => {
  const builder = new Builder();
  Snapshot.startKartsVector(builder, 0);
  const none = builder.endVector();
  Snapshot.startSnapshot(builder);
  Snapshot.addKarts(builder, none);
  Snapshot.addBoxes(builder, none);
  Snapshot.addHazards(builder, none);
  builder.finish(Snapshot.endSnapshot(builder), 'RSNP');
  const bytes = builder.asUint8Array().slice();
  bytes.fill(0xff, bytes.length - 4); // the count of the vector, which was written first
  expect(decode(bytes.buffer)).toBeNull();
});
