// Stints: what a kart drives without a break, and the items that it uses meanwhile.

import type { EventFrame } from '../wire/frames';
import { EventKind } from '../wire/tables';

export interface Stint {
  from: number; // its first lap, from 1
  laps: number;
  bestUs: number; // 0: no lap yet
  items: number; // used
}

const BREAKS = new Set<number>([EventKind.STUCK, EventKind.RESCUED]);

/** The stints of all karts in a race: a new one begins where a kart stands or is rescued. */
export class Stints {
  private readonly all = new Map<number, Stint[]>();

  /** Returns those of a kart now, oldest first. */
  of(seat: number): Stint[] {
    return (this.all.get(seat) ?? []).map((stint) => ({ ...stint }));
  }

  note({ kind, kart, value }: EventFrame): void {
    const stints = this.all.get(kart) ?? [{ from: 1, laps: 0, bestUs: 0, items: 0 }];
    this.all.set(kart, stints);
    const stint = stints.at(-1)!;
    if (kind === EventKind.LAP) {
      stint.laps += 1;
      stint.bestUs = Math.min(stint.bestUs || Infinity, value);
    } else if (kind === EventKind.USE) stint.items += 1;
    else if (BREAKS.has(kind) && stint.laps + stint.items > 0)
      stints.push({ from: stint.from + stint.laps, laps: 0, bestUs: 0, items: 0 });
  }
}
