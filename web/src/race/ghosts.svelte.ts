// The earlier laps that a driver of a time trial may drive against, and the one that is chosen.

import type { GhostsFrame } from '../wire/eventFrames';
import { Ghost, type GhostChoice, chosenGhost } from './ghost';

export class Ghosts {
  choice = $state<GhostChoice>('best');
  private all = $state.raw<readonly Ghost[]>([]);
  private epoch = $state(-1); // of the race that they are for

  take(frame: GhostsFrame): void {
    this.all = frame.ghosts.map((ghost) => new Ghost(ghost));
    this.epoch = frame.epoch;
  }

  forget(): void {
    this.all = [];
  }

  /** Returns whether there is one to choose in a race. */
  areFor(epoch: number): boolean {
    return this.epoch === epoch && this.all.length > 0;
  }

  /** Returns the one that is chosen in a race. */
  chosenFor(epoch: number): Ghost | null {
    return this.areFor(epoch) ? chosenGhost(this.all, this.choice) : null;
  }
}
