// Names under the karts: those further in front first, and none over another.

import { Status } from '../wire/tables';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import type { Race } from '../race/race.svelte';
import { type KartStyle, lengthOn, middleOf, opacityOf } from './karts';

// With more karts than this only the first and the followed are named, to stay readable.
const MOST_NAMES = 12;
const FIRST_NAMES = 3;
const FONT = '600 12px system-ui, sans-serif';
const LINE_PIXELS = 14;
const GAP_PIXELS = 4;

interface Box {
  middle: number;
  left: number;
  right: number;
  top: number;
}

/** Returns the names to be drawn, by seat. */
export function namesOn(race: Race, frame: SnapshotFrame, followed: number): Map<number, string> {
  const isCrowd = frame.karts.length > MOST_NAMES;
  const named = frame.karts.filter(
    ({ seat, rank, status }) =>
      status !== Status.ABSENT && (!isCrowd || rank <= FIRST_NAMES || seat === followed),
  );
  return new Map(named.map(({ seat }) => [seat, race.driver(seat)]));
}

/** Draws each name below its kart, above it where another is in the way, or not at all. */
export function drawNames(
  context: CanvasRenderingContext2D,
  karts: readonly KartFrame[],
  names: ReadonlyMap<number, string>,
  style: KartStyle,
): void {
  const { ratio, colours } = style;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.font = FONT;
  context.textAlign = 'center';
  context.textBaseline = 'top';
  context.lineWidth = 3;
  context.lineJoin = 'round';
  context.strokeStyle = colours.halo;
  context.fillStyle = colours.ink;
  const taken: Box[] = [];
  for (const kart of inOrder(karts, style.followed)) {
    const name = names.get(kart.seat);
    if (!name) continue;
    const box = placeFor(context.measureText(name).width, kart, style, taken);
    if (!box) continue;
    taken.push(box);
    context.globalAlpha = opacityOf(kart);
    context.strokeText(name, box.middle, box.top);
    context.fillText(name, box.middle, box.top);
  }
  context.globalAlpha = 1;
}

function inOrder(karts: readonly KartFrame[], followed: number): KartFrame[] {
  const place = (kart: KartFrame) => (kart.seat === followed ? 0 : kart.rank);
  return [...karts].sort((one, other) => place(one) - place(other));
}

function placeFor(width: number, kart: KartFrame, style: KartStyle, taken: Box[]): Box | null {
  const { x, y } = style.camera.toPicture(middleOf(kart, style.body.ahead));
  const away = 0.5 * lengthOn(style) + GAP_PIXELS;
  const [left, right] = [x - 0.5 * width, x + 0.5 * width];
  for (const top of [y + away, y - away - LINE_PIXELS]) {
    const box = { middle: x, left, right, top };
    if (!taken.some((other) => overlap(box, other))) return box;
  }
  return null;
}

function overlap(one: Box, other: Box): boolean {
  const isBeside = one.right < other.left || other.right < one.left;
  return !isBeside && Math.abs(one.top - other.top) < LINE_PIXELS;
}
