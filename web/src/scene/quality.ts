// How much is drawn: less where pictures come too slowly. Never more again, or it would swing.

export interface Quality {
  ratio: number; // most pixels of the canvas in one of the picture
  shadows: boolean;
}

export const QUALITIES: readonly Quality[] = [
  { ratio: 2, shadows: true },
  { ratio: 1, shadows: true },
  { ratio: 1, shadows: false },
  { ratio: 0.7, shadows: false },
];

// A picture in this time [ms] is too slow; so is the average over so many pictures.
const SLOW_MS = 26;
const PICTURES = 90;
// Pictures further apart than this were not asked for: the page was not in front [ms].
const PAUSE_MS = 400;

export class QualityKeeper {
  level = 0;
  isHeld = false;
  private sum = 0;
  private count = 0;

  get now(): Quality {
    return QUALITIES[this.level]!;
  }

  /** Sets the level for good. */
  hold(level: number): void {
    this.level = Math.min(Math.max(level, 0), QUALITIES.length - 1);
    this.isHeld = true;
  }

  /** Takes the time since the picture before [ms]; returns whether the quality has changed. */
  note(intervalMs: number): boolean {
    if (this.isHeld || intervalMs > PAUSE_MS || this.level === QUALITIES.length - 1) return false;
    this.sum += intervalMs;
    if (++this.count < PICTURES) return false;
    const isSlow = this.sum / this.count > SLOW_MS;
    this.sum = this.count = 0;
    if (isSlow) this.level++;
    return isSlow;
  }
}
