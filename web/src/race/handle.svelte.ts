// The handle of a recording's time line: what it asks the gateway for, and how often.

import type { Position, Request } from '../wire/protocol';

// A key that is held asks faster than the gateway accepts requests.
const ASK_MS = 150;

export class Handle {
  // Where it is while it is held, and then until the gateway is there: a handle that goes back
  // meanwhile would be moved on from the wrong place.
  tick = $state<number | null>(null);
  private sent: number | null = null;
  private steps = 0;
  private timer = 0;

  constructor(private readonly send: (request: Request) => void) {}

  move(tick: number): void {
    [this.tick, this.steps] = [tick, 0];
  }

  /** Goes on by some ticks; a recording that plays pauses. */
  step(ticks: number): void {
    [this.tick, this.sent] = [null, null];
    this.steps += ticks;
    this.ask();
  }

  /** Asks for where it is by now, unless it has just asked; then a little later. */
  ask(): void {
    if (this.timer) return;
    if (this.steps) this.send({ type: 'step', ticks: this.steps });
    else if (this.tick === null || this.tick === this.sent) return;
    else this.send({ type: 'seek', tick: (this.sent = this.tick) });
    this.steps = 0;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.ask();
    }, ASK_MS);
  }

  /** The gateway is at a position. */
  note(position: Position | null): void {
    if (!position?.sought || position.tick !== this.sent) return;
    if (this.tick === this.sent) this.tick = null;
    this.sent = null;
  }

  /** Lets go. */
  release(): void {
    [this.tick, this.sent, this.steps] = [null, null, 0];
  }

  close(): void {
    clearTimeout(this.timer);
  }
}
