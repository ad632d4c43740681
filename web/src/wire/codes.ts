// The numbers of race_server/core/messages.py.

export const Phase = { lobby: 0, countdown: 1, running: 2, finished: 3 } as const;
export const Flag = { green: 0, yellow: 1, red: 2 } as const;
export const Status = { absent: 0, racing: 1, finished: 2, retired: 3 } as const;
export const Button = { useItem: 1, acceptRescue: 2 } as const;

/** Bits of a kart's flags in a snapshot. */
export const KartFlag = {
  wrongWay: 1,
  offTrack: 2,
  rescueOffered: 4,
  immune: 8,
  real: 16,
  doubtful: 32,
  parked: 64,
} as const;

export const EventKind = {
  green: 1,
  lap: 2,
  sector: 3,
  finish: 4,
  retired: 5,
  pickUp: 6,
  use: 7,
  hit: 8,
  blockedHit: 9,
  effectEnd: 10,
  contactKart: 11,
  contactWall: 12,
  falseStart: 13,
  shortCut: 14,
  wrongWay: 15,
  offTrack: 16,
  stuck: 17,
  rescued: 18,
  penalty: 19,
  flag: 20,
  phase: 21,
  raceOver: 22,
  warning: 23,
  pose: 24,
} as const;

export const TICKS_PER_SECOND = 60;
