// Warnings for a driver.

import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { DangerStage, Flag, KartFlag, Phase, Status } from '../wire/tables';

export type Alert =
  'kartBrakes' | 'kartWarns' | 'red' | 'wrongWay' | 'link' | 'yellow' | 'stuck' | 'danger' | 'kart' | 'offTrack';

export interface Watch {
  own: KartFrame;
  frame: SnapshotFrame;
  flag: number; // shown to this kart
  lapLength: number; // [m]
  kartLength: number; // [m]
  linkMs: number; // age of what the driver sees
  stage: DangerStage; // what the kart itself says, where it is a real one
}

// Limits of what counts as ahead of a driver: time [s], and a least distance [lengths].
const AHEAD_S = 1.6;
const AHEAD_LENGTHS = 7;
// A hazard further to the side than this is no danger [lengths].
const BESIDE_LENGTHS = 2.5;
const SLOW_SHARE = 0.4;
/** Beyond this age the picture is too old to drive by [ms]. */
export const BAD_LINK_MS = 300;

/** Returns the warnings that need no race: what the kart says itself, and that nothing comes. */
export function alertsAlone(stage: DangerStage, linkMs: number): Alert[] {
  const alerts: Alert[] = [];
  if (stage >= DangerStage.EASE) alerts.push('kartBrakes');
  else if (stage === DangerStage.WARN) alerts.push('kartWarns');
  if (!(linkMs <= BAD_LINK_MS)) alerts.push('link');
  return alerts;
}

/** Returns the warnings to show, the most urgent first. */
export function alertsFor(watch: Watch): Alert[] {
  const { own, frame, flag, linkMs, stage } = watch;
  const alerts = alertsAlone(stage, linkMs);
  if (frame.phase !== Phase.RUNNING || own.status !== Status.RACING) return alerts;
  if (flag === Flag.RED) alerts.push('red');
  if (own.flags & KartFlag.WRONG_WAY) alerts.push('wrongWay');
  if (flag === Flag.YELLOW) alerts.push('yellow');
  if (own.flags & KartFlag.RESCUE_OFFERED) alerts.push('stuck');
  if (frame.lights <= 0 && hasHazard(watch)) alerts.push('danger');
  if (frame.lights <= 0 && hasSlowKart(watch)) alerts.push('kart');
  if (own.flags & KartFlag.OFF_TRACK) alerts.push('offTrack');
  return alerts;
}

function reachOf({ own, kartLength }: Watch): number {
  return Math.max(AHEAD_S * Math.abs(own.speed), AHEAD_LENGTHS * kartLength);
}

function hasHazard(watch: Watch): boolean {
  const { own, frame, kartLength } = watch;
  const reach = reachOf(watch);
  return frame.hazards.some(({ x, y, radius }) => {
    const [ahead, left] = aheadOf(own, x, y);
    return ahead > 0 && ahead < reach && Math.abs(left) < BESIDE_LENGTHS * kartLength + radius;
  });
}

function hasSlowKart(watch: Watch): boolean {
  const { own, frame, lapLength, kartLength } = watch;
  const reach = reachOf(watch);
  return frame.karts.some((kart) => {
    if (kart.seat === own.seat || kart.status === Status.ABSENT) return false;
    const gap = (((kart.progress - own.progress) % lapLength) + lapLength) % lapLength;
    const isSlow = kart.speed < SLOW_SHARE * own.speed && own.speed > 2 * kartLength;
    return isSlow && gap > 0.5 * kartLength && gap < reach;
  });
}

/** Returns how far ahead and to the left of a kart a point lies [m]. */
function aheadOf(own: KartFrame, x: number, y: number): [number, number] {
  const [east, north] = [x - own.x, y - own.y];
  const [cos, sin] = [Math.cos(own.heading), Math.sin(own.heading)];
  return [east * cos + north * sin, north * cos - east * sin];
}
