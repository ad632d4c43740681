// What a coach says to the driver of this page, read from its message.

import type { ByteBuffer } from 'flatbuffers';
import { rowsOf } from '../wire/rows';
import { Hint } from '../wire/generated/drive/hint.js';
import type { HintKind } from '../wire/generated/codes/hint-kind.js';

export interface Told {
  epoch: number; // of the race
  lap: number; // that ended; 0 for a cue on the way
  timeUs: number; // of the lap
  behindUs: number | null; // behind the limit, null where the lap is not compared with it
  reason: string; // why it is not, in English
  fault: HintKind;
  corner: string;
  size: number; // [m], of a slow bend [m/s]
  reach: number; // [m] from where the limit brakes to the apex; 0 if it needs no brakes
  helped: [number, number][]; // stretches in which help that fades is given, progress [m]
}

/** Returns what a message says, null if it is damaged. */
export function toldBy(buffer: ByteBuffer): Told | null {
  try {
    const table = Hint.getRootAsHint(buffer);
    return {
      epoch: table.epoch(),
      lap: table.lap(),
      timeUs: Number(table.time()),
      behindUs: table.isCompared() ? Number(table.behind()) : null,
      reason: table.reason() ?? '',
      fault: table.kind(),
      corner: table.corner() ?? '',
      size: table.size(),
      reach: table.reach(),
      helped: rowsOf(table.helpedLength(), (row) => {
        const stretch = table.helped(row)!;
        return [stretch.begin(), stretch.end()];
      }),
    };
  } catch {
    return null; // only a damaged message raises an error
  }
}
