// The rows of the leaderboard, from standings and snapshots.

import type { ParkingFrame, SnapshotFrame, StandingsFrame, TimingFrame } from '../wire/frames';
import { Phase, Status } from '../wire/tables';
import { TICKS_PER_SECOND } from './clock';
import { type Pace, gapBetween } from './pace';

export interface Row {
  seat: number;
  driver: string;
  place: number;
  laps: number;
  status: number;
  gapS: number; // to the leader, NaN if unknown, 0 for the leader
  lapsBehind: number; // whole laps behind the leader
  intervalS: number; // to the kart one place ahead
  lastUs: number;
  bestUs: number;
  isBest: boolean; // the fastest lap of all
  item: number;
  penalties: number;
  penaltyUs: number;
  raceUs: number; // 0 until the finish
  flags: number;
  ageMs: number; // of its newest input, NaN if unknown
  parking: ParkingFrame | null;
  timing: TimingFrame | null;
}

export interface Sources {
  snapshot: SnapshotFrame | null;
  standings: StandingsFrame;
  paces: ReadonlyMap<number, Pace>;
  ages: ReadonlyMap<number, number>;
}

/** Returns the leaderboard, best placed first. */
export function tableOf(sources: Sources): Row[] {
  const { snapshot, standings, paces, ages } = sources;
  const karts = new Map(snapshot?.karts.map((kart) => [kart.seat, kart]));
  // Penalties of stewards change the order after the last snapshot.
  const isOver = standings.phase === Phase.FINISHED;
  const best = Math.min(...standings.rows.map((row) => row.bestLapUs || Infinity));
  const rows = standings.rows.map((row): Row => {
    const kart = karts.get(row.seat);
    const { rank, laps, status } = isOver ? row : (kart ?? row);
    return {
      seat: row.seat,
      driver: row.driver,
      place: rank,
      laps,
      status,
      gapS: NaN,
      lapsBehind: 0,
      intervalS: NaN,
      lastUs: row.lastLapUs,
      bestUs: row.bestLapUs,
      isBest: row.bestLapUs > 0 && row.bestLapUs === best,
      item: kart?.item ?? 0,
      penalties: row.penalties,
      penaltyUs: row.penaltyUs,
      raceUs: row.raceTimeUs,
      flags: kart?.flags ?? 0,
      ageMs: ages.get(row.seat) ?? NaN,
      parking: row.parking,
      timing: row.timing,
    };
  });
  rows.sort((one, other) => one.place - other.place || one.seat - other.seat);
  if (rows.some((row) => row.timing)) takeGaps(rows, standings);
  else addGaps(rows, paces, snapshot?.tick ?? standings.tick);
  return rows;
}

/** Gaps and intervals as the server times them. */
function takeGaps(rows: Row[], standings: StandingsFrame): void {
  const gaps = new Map(standings.rows.map((row) => [row.seat, row.gapUs]));
  for (const row of rows) {
    row.gapS = (gaps.get(row.seat) || NaN) / 1e6;
    row.intervalS = (row.timing?.intervalUs || NaN) / 1e6;
    row.lapsBehind = row.timing?.lapsDown ?? 0;
  }
}

/** Gaps and intervals from snapshots, for a recording from before the server timed them. */
function addGaps(rows: Row[], paces: ReadonlyMap<number, Pace>, tick: number): void {
  const leader = rows[0];
  for (const [index, row] of rows.entries()) {
    const ahead = rows[index - 1];
    if (!leader || !ahead) {
      row.gapS = 0;
      continue;
    }
    row.gapS = timeBehind(leader, row, paces, tick);
    row.intervalS = timeBehind(ahead, row, paces, tick);
    const first = paces.get(leader.seat);
    const own = paces.get(row.seat);
    if (first && own && row.status === Status.RACING) row.lapsBehind = lapsBetween(first, own);
  }
}

function timeBehind(ahead: Row, row: Row, paces: ReadonlyMap<number, Pace>, tick: number): number {
  if (ahead.raceUs && row.raceUs) return (row.raceUs - ahead.raceUs) / 1e6;
  const first = paces.get(ahead.seat);
  const own = paces.get(row.seat);
  if (!first || !own || row.status !== Status.RACING) return NaN;
  const gap = gapBetween(first, own, tick);
  return gap >= -1 / TICKS_PER_SECOND ? Math.max(gap, 0) : NaN;
}

function lapsBetween(leader: Pace, own: Pace): number {
  return Math.max(Math.floor(leader.lapsOf(leader.distance - own.distance)), 0);
}
