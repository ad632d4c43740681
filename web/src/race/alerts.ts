// What real karts say that they see, and do by themselves, as sentences.

import type { KartAlert } from '../wire/frames';
import { Advice, Cause, DangerStage } from '../wire/tables';
import type { Words } from '../i18n/en';
import type { Tone } from './control';

/** An alert that was news when it came. */
export interface ToldAlert {
  tick: number;
  number: number; // no other alert has it, and no event
  alert: KartAlert;
}

// To this side of straight ahead what a kart sees is still ahead [rad].
const AHEAD = (12 * Math.PI) / 180;

// What was told is not told again within this time [ticks].
const AGAIN = 120;

/** Returns whether an alert is told: its driver has to act, and that was not told just now. */
export function isNews(alert: KartAlert, tick: number, told: readonly ToldAlert[]): boolean {
  if (alert.stage < DangerStage.WARN) return false;
  return !told.some(({ tick: at, alert: before }) => {
    const isSame = before.seat === alert.seat && before.stage >= alert.stage;
    const isRecent = tick >= at && tick - at < AGAIN;
    return isRecent && isSame && before.hit === alert.hit && before.cause === alert.cause;
  });
}

/** Returns what a kart does: a word for the stage, or that it waits. */
export function doingOf({ stage, advice }: KartAlert, words: Words): string {
  const { doing } = words.kartAlerts;
  return advice === Advice.WAIT ? doing.waits : (doing.stages[stage] ?? '');
}

/** Returns why: what is in the way and where, or what else made the kart act. */
export function reasonOf({ hit, distance, bearing, cause }: KartAlert, words: Words): string {
  const say = words.kartAlerts;
  if (hit && (cause === 0 || cause & Cause.OBSTACLE)) {
    const side = Math.abs(bearing) < AHEAD ? say.ahead : bearing > 0 ? say.left : say.right;
    return say.seen(say.hits[hit] ?? '', distance.toFixed(distance < 10 ? 1 : 0), side);
  }
  const reasons = say.causes.filter((_, bit) => cause & (1 << (bit + 1)));
  return reasons.join(', ');
}

/** Returns what the driver of this kart reads. */
export function ownText(alert: KartAlert, words: Words): string {
  const say = words.kartAlerts;
  const reason = reasonOf(alert, words);
  if (alert.stage === DangerStage.WARN) return say.warns(say.counsels[alert.advice] ?? '', reason);
  return say.own(doingOf(alert, words), reason);
}

export function toneOf({ stage }: KartAlert): Tone {
  return stage === DangerStage.FULL ? 'danger' : stage >= DangerStage.WARN ? 'warning' : 'plain';
}

// A warning that is over is shown this long, so that it can be read [ms].
const HELD_MS = 800;

/** What a driver is shown: a milder alert replaces a more urgent one only after a while. */
export class HeldAlert {
  private shown: KartAlert | null = null;
  private shownMs = -Infinity;

  take(alert: KartAlert | null, nowMs: number): KartAlert | null {
    const warns = alert !== null && alert.stage >= DangerStage.WARN;
    const isOver = nowMs - this.shownMs > HELD_MS;
    if (warns && (isOver || !this.shown || alert.stage >= this.shown.stage)) {
      [this.shown, this.shownMs] = [alert, nowMs];
    } else if (isOver) this.shown = null;
    return this.shown;
  }
}
