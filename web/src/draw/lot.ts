// A car park from above: slots, what stands in them, people, and what vehicles have driven.

import type { Race } from '../race/race.svelte';
import { predict } from '../race/rig';
import type { Block, Disc, Goal, LotFrame, Rectangle, SnapshotFrame } from '../wire/frames';
import { RayHit } from '../wire/tables';
import { type MapColours, liveryOf } from './palette';

const TAU = 2 * Math.PI;
const PERSON = '#f27ba5';
const PARKED = '#5d6874';
const MINE = '#3fbf7f';

/** Draws all slots as open rectangles: the side that one drives in through has no line. */
export function drawSlots(
  context: CanvasRenderingContext2D,
  slots: readonly Rectangle[],
  colours: MapColours,
  pixel: number,
): void {
  context.strokeStyle = colours.marking;
  context.lineWidth = 1.2 * pixel;
  for (const slot of slots) within(context, slot, () => context.stroke());
}

/** Draws the slots that vehicles go to, in their colours; the followed one's is filled. */
export function drawGoals(
  context: CanvasRenderingContext2D,
  goals: readonly Goal[],
  followed: number,
  pixel: number,
): void {
  for (const goal of goals) {
    const isMine = goal.seat === followed;
    const { colour } = liveryOf(goal.seat);
    within(context, goal, () => {
      context.globalAlpha = isMine ? 0.5 : 0.16;
      context.fillStyle = isMine ? MINE : colour;
      context.fill();
      context.globalAlpha = 1;
      context.strokeStyle = isMine ? MINE : colour;
      context.lineWidth = (isMine ? 3 : 1.6) * pixel;
      context.setLineDash(isMine ? [] : [5 * pixel, 3 * pixel]);
      context.stroke();
      context.setLineDash([]);
      drawArrow(context, goal, pixel);
    });
  }
}

/** Draws an arrow in the direction of a rectangle, at its far end. */
function drawArrow(
  context: CanvasRenderingContext2D,
  { length, width }: Rectangle,
  pixel: number,
): void {
  const [tip, wing] = [0.42 * length, 0.16 * Math.min(length, width)];
  context.beginPath();
  context.moveTo(tip - wing, wing);
  context.lineTo(tip, 0);
  context.lineTo(tip - wing, -wing);
  context.lineWidth = 2 * pixel;
  context.stroke();
}

/** Draws parked vehicles and loose obstacles. */
export function drawBlocks(
  context: CanvasRenderingContext2D,
  blocks: readonly Block[],
  colours: MapColours,
  pixel: number,
): void {
  context.lineWidth = pixel;
  context.strokeStyle = colours.halo;
  for (const block of blocks) {
    context.fillStyle = block.kind === RayHit.KART ? PARKED : colours.obstacle;
    within(context, block, () => {
      context.fill();
      context.stroke();
    });
  }
}

export function drawPeople(
  context: CanvasRenderingContext2D,
  walkers: readonly Disc[],
  colours: MapColours,
  pixel: number,
): void {
  context.lineWidth = 1.5 * pixel;
  for (const { x, y, radius } of walkers) {
    context.beginPath();
    context.arc(x, y, Math.max(radius, 4 * pixel), 0, TAU);
    context.fillStyle = PERSON;
    context.fill();
    context.strokeStyle = colours.halo;
    context.stroke();
  }
}

/** Draws the driven ways in the vehicles' colours, and a dot where one changed direction. */
export function drawWays(
  context: CanvasRenderingContext2D,
  race: Race,
  followed: number,
  colours: MapColours,
  pixel: number,
): void {
  for (const [seat, { points, turns }] of race.ways.ways) {
    const { colour } = liveryOf(seat);
    context.globalAlpha = followed < 0 || seat === followed ? 0.9 : 0.35;
    context.strokeStyle = colour;
    context.lineWidth = (seat === followed ? 2.5 : 1.6) * pixel;
    context.beginPath();
    points.forEach(({ x, y }, index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.fillStyle = colour;
    context.strokeStyle = colours.ink;
    context.lineWidth = 1.2 * pixel;
    for (const { x, y } of turns) {
      context.beginPath();
      context.arc(x, y, 4 * pixel, 0, TAU);
      context.fill();
      context.stroke();
    }
  }
  context.globalAlpha = 1;
}

/** Draws the ways that are planned: dashed, in the colour of writing, which no vehicle has. */
export function drawPlans(
  context: CanvasRenderingContext2D,
  lot: LotFrame,
  followed: number,
  colours: MapColours,
  pixel: number,
): void {
  context.strokeStyle = colours.ink;
  context.setLineDash([6 * pixel, 4 * pixel]);
  for (const { seat, points } of lot.ways) {
    context.globalAlpha = followed < 0 || seat === followed ? 0.9 : 0.3;
    context.lineWidth = (seat === followed ? 2.2 : 1.4) * pixel;
    context.beginPath();
    points.forEach(({ x, y }, index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

// Of the vehicle's rear axle, of trailers' axles, and where the prediction ends in a jack-knife.
const AHEAD = '#ffd43b';
const BEHIND = '#74c0fc';
const KNIFE = '#ff4d4d';

/** Draws where a vehicle with trailers goes with the wheels as they are. */
export function drawPrediction(
  context: CanvasRenderingContext2D,
  race: Race,
  frame: SnapshotFrame,
  seat: number,
  pixel: number,
): void {
  const kart = frame.karts.find((one) => one.seat === seat);
  if (!kart || !race.rig) return;
  const { paths, isKnife } = predict(race.rig, kart, frame.trailers, wayOf(race, seat));
  paths.forEach((path, row) => {
    context.beginPath();
    path.forEach(({ x, y }, index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.strokeStyle = row ? BEHIND : AHEAD;
    context.lineWidth = 3 * pixel;
    context.setLineDash([8 * pixel, 5 * pixel]);
    context.stroke();
    context.setLineDash([]);
    const end = path.at(-1)!;
    context.beginPath();
    context.arc(end.x, end.y, (isKnife ? 7 : 4) * pixel, 0, TAU);
    context.fillStyle = isKnife ? KNIFE : context.strokeStyle;
    context.fill();
  });
}

/** Returns in which direction a vehicle drives, or did before it stood. */
function wayOf(race: Race, seat: number): 1 | -1 {
  return race.ways.ways.get(seat)?.gear === -1 ? -1 : 1;
}

/** Draws what was drawn for a round, below the vehicles. */
export function drawRound(
  context: CanvasRenderingContext2D,
  lot: LotFrame,
  followed: number,
  colours: MapColours,
  pixel: number,
): void {
  drawGoals(context, lot.goals, followed, pixel);
  drawBlocks(context, lot.blocks, colours, pixel);
}

/** Calls `paint` with the path of a rectangle, in its own frame. */
function within(context: CanvasRenderingContext2D, one: Rectangle, paint: () => void): void {
  const { x, y, heading, length, width } = one;
  context.save();
  context.translate(x, y);
  context.rotate(heading);
  context.beginPath();
  context.rect(-0.5 * length, -0.5 * width, length, width);
  paint();
  context.restore();
}
