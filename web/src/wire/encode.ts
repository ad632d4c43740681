// A driver's control as a message.

import { Builder } from 'flatbuffers';

import { Control, ControlMessage } from './tables';

export interface ControlFrame {
  epoch: number; // of the race, from the newest snapshot
  sequence: number; // rises with every message
  tick: number; // of the snapshot that the driver saw
  steering: number; // [-1, 1], left positive
  throttle: number; // [-1, 1], negative for reverse
  brake: number; // [0, 1]
  buttons: number;
}

/** Returns a control as bytes for the gateway. */
export function encodeControl(frame: ControlFrame): Uint8Array<ArrayBuffer> {
  const builder = new Builder(128);
  ControlMessage.startControlMessage(builder);
  ControlMessage.addControl(
    builder,
    Control.createControl(
      builder,
      frame.epoch,
      frame.sequence,
      frame.tick,
      frame.steering,
      frame.throttle,
      frame.brake,
      frame.buttons,
    ),
  );
  builder.finish(ControlMessage.endControlMessage(builder), 'RCTL');
  return new Uint8Array(builder.asUint8Array()); // a copy: the builder's own bytes are larger
}
