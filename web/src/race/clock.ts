// The server's clock, estimated from pings.

interface Sample {
  roundTripMs: number;
  offsetMs: number;
}

export const TICKS_PER_SECOND = 60;

const SAMPLES = 8;
// A clock that is this much off [ms] is that of another server.
const JUMP_MS = 5000;

export class ServerClock {
  private samples: Sample[] = [];

  /** Records a ping that left and came back at these times of the browser's clock. */
  note(sentMs: number, receivedMs: number, serverUs: number): void {
    const offsetMs = serverUs / 1000 - 0.5 * (sentMs + receivedMs);
    const last = this.samples.at(-1)?.offsetMs ?? offsetMs;
    if (Math.abs(offsetMs - last) > JUMP_MS) this.samples = [];
    this.samples.push({ roundTripMs: receivedMs - sentMs, offsetMs });
    if (this.samples.length > SAMPLES) this.samples.shift();
  }

  get isKnown(): boolean {
    return this.samples.length > 0;
  }

  /** The newest round trip [ms]. */
  get roundTripMs(): number {
    return this.samples.at(-1)?.roundTripMs ?? 0;
  }

  /** Returns the server's clock [ms] at a time of the browser's: by the quickest ping. */
  serverMs(nowMs: number): number {
    const best = this.samples.reduce<Sample | null>(
      (quickest, sample) =>
        quickest && quickest.roundTripMs <= sample.roundTripMs ? quickest : sample,
      null,
    );
    return nowMs + (best?.offsetMs ?? 0);
  }
}
