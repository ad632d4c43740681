// How long drawing takes, and how old the picture is. Tests read it at
// window.__race where the address says #stats=1.

const SAMPLES = 600;

export interface Share {
  p50: number;
  p95: number;
}

export class Meter {
  private frames: number[] = [];
  private delays: number[] = [];
  private intervals: number[] = [];
  private lastMs = NaN;
  frameCount = 0;

  /** Records a picture. */
  noteFrame(begunMs: number, doneMs: number): void {
    this.frameCount++;
    keep(this.frames, doneMs - begunMs);
    if (!Number.isNaN(this.lastMs)) keep(this.intervals, begunMs - this.lastMs);
    this.lastMs = begunMs;
  }

  noteDelay(ms: number): void {
    keep(this.delays, ms);
  }

  /** Time that drawing one picture took [ms]. */
  get frameMs(): Share {
    return shareOf(this.frames);
  }

  /** Time between pictures [ms]. */
  get intervalMs(): Share {
    return shareOf(this.intervals);
  }

  /** Delay from a tick of the server to its picture [ms]. */
  get delayMs(): Share {
    return shareOf(this.delays);
  }
}

function keep(samples: number[], value: number): void {
  samples.push(value);
  if (samples.length > SAMPLES) samples.shift();
}

function shareOf(samples: readonly number[]): Share {
  const sorted = [...samples].sort((one, other) => one - other);
  const at = (share: number) => sorted[Math.floor(share * (sorted.length - 1))] ?? NaN;
  return { p50: at(0.5), p95: at(0.95) };
}
