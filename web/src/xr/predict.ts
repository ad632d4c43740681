// What is drawn is seen a little later. Karts are drawn for then.

import type { SnapshotBuffer } from '../race/buffer';
import type { ServerClock } from '../race/clock';
import type { SnapshotFrame } from '../wire/frames';

/** Returns when a picture will be seen [ms]; browsers that do not say show it one period later. */
export function displayMs(frameMs: number, predictedMs: number | undefined, rate: number): number {
  return predictedMs ?? frameMs + 1000 / rate;
}

/**
 * Returns the race as it will be when the picture is seen: karts driven on from the newest
 * snapshot. Until the server's clock is known, as the buffer shows it.
 */
export function raceAt(
  buffer: SnapshotBuffer,
  clock: ServerClock,
  seenMs: number,
): SnapshotFrame | null {
  return clock.isKnown ? buffer.sampleAt(clock.serverMs(seenMs)) : buffer.sample(seenMs);
}
