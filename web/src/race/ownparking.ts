// How one vehicle fares on its way to its slot, for the page's counters.

import type { PlannedFrame } from '../wire/frames';
import { Ending, Status } from '../wire/tables';
import { wrap } from './buffer';
import type { Race } from './race.svelte';
import { hitchAngles, noReturn } from './rig';

// From this share of the limit on the driver is warned, whatever reversing could still mend.
const NEAR = 0.85;

/** The angle at a hitch [rad]. */
export interface OwnHitch {
  angle: number;
  limit: number; // beyond it is a jack-knife
  noReturn: number; // beyond it reversing makes it larger; Infinity where it is not known
  isDanger: boolean;
}

export interface OwnParking {
  seat: number;
  driver: string;
  ending: number;
  slot: number; // -1 where it has no number
  seconds: number; // since the lights went out, until it ended
  way: number; // [m]
  reversed: number; // [m]
  moves: number;
  toSlot: number; // [m] of the middle of the body from that of the slot
  offDegrees: number; // of its heading against that of the slot
  clearance: number; // to what is nearest now [m], NaN if unknown
  least: number; // the least so far [m]
  planned: PlannedFrame | null; // of the same task, where a driver from outside has parked
  speed: number; // [m/s]
  hitches: OwnHitch[]; // the nearest one first
}

/** A figure of a drive, of the plan for the same task, and the former as a multiple of the latter. */
export interface Compared {
  name: 'time' | 'way' | 'moves';
  driven: number;
  planned: number;
  ratio: number; // NaN where the plan has none
}

/** Returns how a drive compares with the plan for the same task; nothing without one. */
export function comparedWithPlan(own: OwnParking): Compared[] {
  const { planned } = own;
  if (!planned) return [];
  const pairs = [
    ['time', own.seconds, planned.seconds],
    ['way', own.way, planned.way],
    ['moves', own.moves, planned.moves],
  ] as const;
  return pairs.map(([name, driven, plan]) => {
    return { name, driven, planned: plan, ratio: plan > 0 ? driven / plan : NaN };
  });
}

/** Returns the figures of the vehicle of a seat, null where it has none. */
export function ownParking(race: Race, seat: number): OwnParking | null {
  const row = race.standings?.rows.find((one) => one.seat === seat);
  const kart = race.kart(seat);
  if (!row?.parking || !race.standings) return null;
  const goal = race.lot?.goals.find((one) => one.seat === seat);
  const { ahead } = race.body;
  const tick = race.buffer.newest?.tick ?? race.standings.tick;
  const isOpen = kart?.status === Status.RACING && row.parking.ending === Ending.OPEN;
  // Of a way that ended unseen it is not known when.
  const until = isOpen ? tick : (race.drivenUntil.get(seat) ?? NaN);
  const since = Math.max(until - race.standings.startTick, 0) / 60;
  return {
    seat,
    driver: row.driver,
    ending: row.parking.ending,
    slot: row.parking.slot,
    seconds: row.raceTimeUs ? row.raceTimeUs / 1e6 : since,
    way: row.parking.way,
    reversed: row.parking.reversed,
    moves: row.parking.moves,
    toSlot:
      goal && kart
        ? Math.hypot(
            goal.x - kart.x - ahead * Math.cos(kart.heading),
            goal.y - kart.y - ahead * Math.sin(kart.heading),
          )
        : NaN,
    offDegrees:
      goal && kart ? (Math.abs(wrap(kart.heading - goal.heading)) * 180) / Math.PI : NaN,
    clearance: race.clearances.get(seat)?.now ?? NaN,
    least: race.clearances.get(seat)?.least ?? NaN,
    planned: row.planned,
    speed: kart?.speed ?? 0,
    hitches: hitchesOf(race, seat),
  };
}

/** Returns what the dials of the hitches of a vehicle show; none without a trailer. */
export function hitchesOf(race: Race, seat: number): OwnHitch[] {
  const [frame, kart] = [race.buffer.newest, race.kart(seat)];
  if (!frame || !kart) return [];
  const trailers = frame.trailers.filter((trailer) => trailer.seat === seat);
  return hitchAngles(kart, trailers).map((angle, row) => {
    const { limit } = trailers[row]!;
    const last = row === 0 && race.rig ? noReturn(race.rig) : Infinity;
    return { angle, limit, noReturn: last, isDanger: Math.abs(angle) > Math.min(last, NEAR * limit) };
  });
}
