// What the kart beside this page says by itself, whether the server is there or not.

import type { KartAlert, OwnAlertFrame, OwnPoseFrame } from '../wire/frames';

// Without a word for this long the kart's program is not there [ms]; it speaks 50 times a second.
const SILENT_MS = 500;

export class OwnKart {
  private newestPose: OwnPoseFrame | null = null;
  private newestAlert: KartAlert | null = null;
  private heardMs = -Infinity;

  take(frame: OwnAlertFrame | OwnPoseFrame, arrivedMs: number): void {
    this.heardMs = arrivedMs;
    if (frame.kind === 'own pose') this.newestPose = frame;
    else this.newestAlert = frame.alert;
  }

  isHeard(nowMs: number): boolean {
    return nowMs - this.heardMs < SILENT_MS;
  }

  /** Where it is, null where it is not heard. */
  pose(nowMs: number): OwnPoseFrame | null {
    return this.isHeard(nowMs) ? this.newestPose : null;
  }

  /** What it says, null where it is not heard. */
  alert(nowMs: number): KartAlert | null {
    return this.isHeard(nowMs) ? this.newestAlert : null;
  }
}
