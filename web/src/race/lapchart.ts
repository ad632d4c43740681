// The places at the end of each lap.

import type { StandingFrame } from '../wire/frames';

export interface LapPlaces {
  seat: number;
  driver: string;
  places: number[]; // after lap 1, 2, …; from 1
}

/** Returns the place of each kart after each of its laps. */
export function lapPlaces(rows: readonly StandingFrame[]): LapPlaces[] {
  const sums = rows.map((row) => runningSum(row.lapTimesUs));
  return rows.map((row, index) => ({
    seat: row.seat,
    driver: row.driver,
    places: sums[index]!.map(
      (time, lap) => 1 + sums.filter((other) => (other[lap] ?? Infinity) < time).length,
    ),
  }));
}

function runningSum(values: readonly number[]): number[] {
  let sum = 0;
  return values.map((value) => (sum += value));
}
