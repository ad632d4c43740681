// Sector times by colour, as live timing shows them.

import type { EventFrame } from '../wire/frames';
import { EventKind } from '../wire/tables';

/** Best of all, best of this kart, or neither. */
export type Merit = 'best' | 'own' | 'none';

export interface SectorTime {
  us: number;
  merit: Merit;
}

export class Sectors {
  private best: number[] = []; // [µs] by sector
  private own = new Map<number, number[]>();
  private newest = new Map<number, SectorTime[]>();

  note(event: EventFrame): void {
    if (event.kind !== EventKind.SECTOR) return;
    const sector = event.other - 1;
    const times = this.newest.get(event.kart) ?? [];
    // A new lap begins: the sectors of the last one stay until its first is through.
    if (sector === 0) times.length = 0;
    times[sector] = { us: event.value, merit: this.meritOf(event.kart, sector, event.value) };
    this.newest.set(event.kart, times);
  }

  /** Returns the sectors of a kart's lap so far. */
  of(seat: number): readonly (SectorTime | undefined)[] {
    return this.newest.get(seat) ?? [];
  }

  /** Count of sectors of a lap, as far as known. */
  get count(): number {
    return this.best.length;
  }

  private meritOf(seat: number, sector: number, us: number): Merit {
    const own = this.own.get(seat) ?? [];
    this.own.set(seat, own);
    const isOwn = us < (own[sector] ?? Infinity);
    const isBest = us < (this.best[sector] ?? Infinity);
    if (isOwn) own[sector] = us;
    if (isBest) this.best[sector] = us;
    if (isBest) return 'best';
    return isOwn ? 'own' : 'none';
  }
}
