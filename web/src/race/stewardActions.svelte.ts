// Pending decisions of the steward: each has a number, which its answer repeats.

import type { Visit } from './visit.svelte';

export interface Answer {
  what: string; // in words
  accepted: boolean;
  reason: string;
}

/** What a decision in an event says besides: the number of a protest, or why. */
export interface Reasons {
  protest?: number;
  note?: string;
}

export class StewardActions {
  private asked = $state.raw<readonly { id: number; what: string }[]>([]);
  private next = 1;

  constructor(private readonly visit: Visit) {}

  /** The newest answered decision. */
  get answer(): Answer | null {
    for (const { id, what } of [...this.asked].reverse()) {
      const acted = this.visit.acted.get(id);
      if (acted) return { what, accepted: acted.accepted, reason: acted.reason };
    }
    return null;
  }

  act(act: string, what: string, seat = -1, value = 0, more: Reasons = {}): void {
    const id = this.next++;
    this.asked = [...this.asked.slice(-20), { id, what }];
    this.visit.send({ type: 'act', act, seat, value, id, ...more });
    this.askForLog();
  }

  askForLog(): void {
    this.visit.send({ type: 'log' });
  }
}
