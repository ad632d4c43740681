// Draws at the display's rate, and measures the time.

import { currentPlace } from '../address.svelte';
import type { Visit } from '../race/visit.svelte';
import type { SnapshotFrame } from '../wire/frames';
import { Meter } from './meter';
import { publishStats } from './stats';

/** Calls `draw` with the current state for every picture, until the returned function is called. */
export function startDrawing(
  visit: Visit,
  draw: (frame: SnapshotFrame | null) => void,
): () => void {
  const meter = new Meter();
  let handle = 0;
  if (currentPlace().showsStats) publishStats(visit, meter);

  function turn(): void {
    handle = requestAnimationFrame(turn);
    const begunMs = performance.now();
    const { buffer } = visit.race;
    const frame = visit.race.withGhost(buffer.sample(begunMs));
    draw(frame);
    const doneMs = performance.now();
    if (!currentPlace().showsStats) return;
    meter.noteFrame(begunMs, doneMs);
    if (frame && visit.clock.isKnown && !visit.isRecording) {
      meter.noteDelay(visit.clock.serverMs(doneMs) - buffer.playheadMs(begunMs));
    }
  }

  handle = requestAnimationFrame(turn);
  return () => cancelAnimationFrame(handle);
}
