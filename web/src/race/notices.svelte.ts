// What the gateway says, each until it is over: notices of the server, and refusals.

import type { Notice } from '../wire/protocol';

// A refusal is read by then [ms].
const REFUSED_MS = 6000;
// Of these one ends the other.
const ABOUT: Readonly<Record<string, string>> = {
  'no-race': 'race',
  race: 'race',
  'dead-man': 'wheel',
  driving: 'wheel',
};

export class Notices {
  private shown = $state.raw<ReadonlyMap<string, Notice>>(new Map());
  private readonly timers = new Map<string, number>();

  /** What is shown about the race, the wheel, or what was asked for; null for nothing. */
  about(what: string): Notice | null {
    return this.shown.get(what) ?? null;
  }

  take(notice: Notice): void {
    this.show(ABOUT[notice.code] ?? notice.code, notice.reason ? notice : null);
  }

  /** Takes the answer to what was asked for; reason: '' where it was accepted. */
  takeAnswer(code: string, reason: string): void {
    this.take({ type: 'notice', code, reason });
    clearTimeout(this.timers.get(code));
    if (!reason) return;
    const timer = window.setTimeout(() => this.show(code, null), REFUSED_MS);
    this.timers.set(code, timer);
  }

  clear(): void {
    for (const timer of this.timers.values()) clearTimeout(timer);
    this.shown = new Map();
  }

  private show(what: string, notice: Notice | null): void {
    const shown = new Map(this.shown);
    shown.delete(what);
    if (notice) shown.set(what, notice);
    this.shown = shown;
  }
}
