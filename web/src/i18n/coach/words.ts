// What a coach can say.

import type { HintFrame } from '../../wire/frames';

type Figures = Pick<HintFrame, 'size' | 'reach'>;

/** The order of faults is that of `HintKind`. */
export interface CoachWords {
  cues: readonly string[]; // short, before a corner
  liftLater: string; // where the limit does not brake
  tries: readonly ((figures: Figures) => string)[]; // with figures, after a lap
  lap: (lap: number, time: string) => string;
  behind: (seconds: string) => string;
  nothing: string;
  notCompared: (why: string) => string;
  reasons: readonly (readonly [RegExp, string])[]; // what the server says in English
}

export const whole = (metres: number): string => metres.toFixed(0);
export const fine = (value: number): string => value.toFixed(1);
