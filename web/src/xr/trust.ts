// Whether what a driver sees may be drawn at all. A thing drawn in the wrong place is worse than none.

import { Flag, KartFlag } from '../wire/tables';

/** What is known of the pose of the own kart, and of the way by which it is known. */
export interface Evidence {
  kartFlags: number; // bits of KartFlag of the own kart
  deviation: number; // [m] of its place, as the kart estimates it; 0 where it does not
  quality: number; // of its sensors, 0 to 1; 1 where it does not say
  ageMs: number; // since the newest snapshot was made
  flag: number; // shown to this kart
  brakesItself: boolean;
}

export type Doubt = 'none' | 'pose' | 'link' | 'red' | 'brake';

export const MOST_DEVIATION = 0.5;
export const LEAST_QUALITY = 0.2;
export const MOST_AGE_MS = 300;

/** Returns why nothing may be drawn, the most urgent reason first. */
export function doubtOf(evidence: Evidence): Doubt {
  if (evidence.brakesItself) return 'brake';
  if (evidence.flag === Flag.RED) return 'red';
  if (!(evidence.ageMs <= MOST_AGE_MS)) return 'link';
  const isDoubted = (evidence.kartFlags & (KartFlag.DOUBTFUL | KartFlag.SUSPENDED)) !== 0;
  const isVague = !(evidence.deviation <= MOST_DEVIATION) || !(evidence.quality >= LEAST_QUALITY);
  return isDoubted || isVague ? 'pose' : 'none';
}

// Gone within this time, with a picture to spare at 72 Hz; back after a while of no doubt [s].
const GONE_S = 0.18;
const WAIT_S = 0.5;
const BACK_S = 0.4;

/** How much of what is drawn is seen: 0 to 1. */
export class Fade {
  share = 0;
  private goodS = 0;

  update(isTrusted: boolean, seconds: number): number {
    this.goodS = isTrusted ? this.goodS + seconds : 0;
    if (!isTrusted) this.share = Math.max(this.share - seconds / GONE_S, 0);
    else if (this.goodS > WAIT_S) this.share = Math.min(this.share + seconds / BACK_S, 1);
    return this.share;
  }
}

// At speed nothing that is not there is drawn nearer than this ahead of the driver's eye.
export const LEAST_AHEAD = 2; // [m]
const AT_SPEED = 20 / 3.6; // [m/s]

/** Returns how far ahead of the eye drawing begins [m]. */
export function drawnFrom(speed: number): number {
  return Math.abs(speed) > AT_SPEED ? LEAST_AHEAD : 0.3;
}
