// What a coach says to the driver of this page, from bytes to plain data.

import type { ByteBuffer } from 'flatbuffers';

import type { HintFrame } from './frames';
import { Hint } from './generated/drive/hint.js';
import { rowsOf } from './rows';

export function readHint(buffer: ByteBuffer): HintFrame {
  const table = Hint.getRootAsHint(buffer);
  return {
    kind: 'hint',
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
}
