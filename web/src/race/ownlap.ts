// A driver's own lap against its best and against the reference line.

import { KartFlag, Phase, Status } from '../wire/tables';
import type { KartFrame } from '../wire/frames';
import type { Zone } from './line';
import { deltaTo } from './pace';
import type { Race } from './race.svelte';

export interface OwnLap {
  speed: number; // [m/s]
  lap: number; // from 1
  place: number;
  karts: number;
  lastUs: number;
  bestUs: number;
  toBestS: number; // NaN if unknown
  toReferenceS: number;
  toGhostS: number;
  item: number;
  zone: Zone | null; // of the reference line here; null before the start
  isImmune: boolean;
  isHome: boolean;
  isOut: boolean;
}

/** Returns the state of a kart's lap. */
export function ownLap(race: Race, kart: KartFrame): OwnLap {
  const row = race.standings?.rows.find(({ seat }) => seat === kart.seat);
  const laps = race.standings?.laps ?? 0;
  const isStuck = (kart.flags & KartFlag.RESCUE_OFFERED) !== 0;
  const isOnTheWay =
    race.headline?.phase === Phase.RUNNING && kart.status === Status.RACING && !isStuck;
  return {
    speed: kart.speed,
    lap: laps ? Math.min(kart.laps + 1, laps) : kart.laps + 1,
    place: kart.rank,
    karts: race.rows.length,
    lastUs: row?.lastLapUs ?? 0,
    bestUs: row?.bestLapUs ?? 0,
    ...deltasOf(race, kart.seat),
    toGhostS: race.toGhostS(kart.seat),
    item: kart.item,
    zone: isOnTheWay ? (race.line?.zones[race.line.nearest(kart.x, kart.y)] ?? null) : null,
    isImmune: (kart.flags & KartFlag.IMMUNE) !== 0,
    isHome: kart.status === Status.FINISHED,
    isOut: kart.status === Status.RETIRED,
  };
}

function deltasOf(race: Race, seat: number): { toBestS: number; toReferenceS: number } {
  const pace = race.paces.get(seat);
  if (!pace || pace.lap < 0) return { toBestS: NaN, toReferenceS: NaN };
  const lap = pace.trace(pace.lap);
  const best = pace.bestLap;
  return {
    toBestS: best >= 0 ? deltaTo(pace.trace(best), lap) : NaN,
    toReferenceS: race.reference ? deltaTo(race.reference, lap) : NaN,
  };
}
