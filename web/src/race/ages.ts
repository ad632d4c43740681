// The age of each kart's input: from the server, or since its acknowledged number rose.

import type { LinksFrame, SnapshotFrame } from '../wire/frames';

interface Heard {
  sequence: number;
  atMs: number;
}

export class InputAges {
  private heard = new Map<number, Heard>();
  private told: LinksFrame | null = null;

  take(links: LinksFrame): void {
    this.told = links;
  }

  note(frame: SnapshotFrame, nowMs: number): void {
    for (const { seat, acknowledged } of frame.karts) {
      const last = this.heard.get(seat);
      if (last && last.sequence === acknowledged) continue;
      this.heard.set(seat, { sequence: acknowledged, atMs: nowMs });
    }
  }

  /** Returns the age of each seat's input [ms]. */
  at(nowMs: number): Map<number, number> {
    if (this.told) return this.told.ages;
    return new Map([...this.heard].map(([seat, { atMs }]) => [seat, nowMs - atMs]));
  }
}
