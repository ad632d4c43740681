// What a coach says, in both languages: short before a corner, with figures after a lap. The order
// of faults is that of `HintKind`.

import { deltaText, lapText } from './figures';
import type { Language } from './words.svelte';
import type { Told } from '../race/hint';

type Figures = Pick<Told, 'size' | 'reach'>;

interface CoachWords {
  cues: readonly string[];
  liftLater: string; // where the limit does not brake
  tries: readonly ((figures: Figures) => string)[];
  lap: (lap: number, time: string) => string;
  behind: (seconds: string) => string;
  nothing: string;
  notCompared: (why: string) => string;
  reasons: readonly (readonly [RegExp, string])[];
}

const whole = (metres: number): string => metres.toFixed(0);
const fine = (value: number): string => value.toFixed(1);

const en: CoachWords = {
  cues: [
    '',
    'brake later',
    'stay on it',
    'turn in earlier',
    'carry speed',
    'closer to the apex',
    'throttle sooner',
    'keep it open',
    'let it run out',
    '',
  ],
  liftLater: 'lift later',
  tries: [
    () => '',
    ({ size, reach }) =>
      reach
        ? `brake ${whole(size)} m later: the limit brakes ${whole(reach)} m before the apex`
        : `lift ${whole(size)} m later: no brakes are needed here`,
    ({ size, reach }) =>
      reach
        ? `stay on the throttle ${whole(size)} m longer, then brake`
        : `stay on the throttle ${whole(size)} m longer: no brakes are needed here`,
    ({ size }) => `turn in earlier: you are ${fine(size)} m too far outside at the entry`,
    ({ size }) => `carry ${fine(size * 3.6)} km/h more through the bend`,
    ({ size }) => `pass the apex ${fine(size)} m nearer to the inside`,
    ({ size }) => `open the throttle ${whole(size)} m sooner, from the apex on`,
    ({ size }) => `keep the throttle open on the way out: it was closed for ${whole(size)} m`,
    ({ size }) => `let the kart run out: ${fine(size)} m of road are unused at the exit`,
    () => 'no fault of driving is seen; look at the kart',
  ],
  lap: (lap, time) => `Lap ${lap}: ${time}`,
  behind: (seconds) => `${seconds} s to the limit`,
  nothing: 'no fault is seen',
  notCompared: (why) => `not compared: ${why}`,
  reasons: [],
};

const fr: CoachWords = {
  cues: [
    '',
    'freine plus tard',
    'reste au gaz',
    'braque plus tôt',
    'garde de la vitesse',
    'plus près de la corde',
    'gaz plus tôt',
    'garde les gaz',
    'laisse filer',
    '',
  ],
  liftLater: 'lève le pied plus tard',
  tries: [
    () => '',
    ({ size, reach }) =>
      reach
        ? `freine ${whole(size)} m plus tard : la limite freine ${whole(reach)} m avant la corde`
        : `lève le pied ${whole(size)} m plus tard : ici, pas besoin de freiner`,
    ({ size, reach }) =>
      reach
        ? `reste au gaz ${whole(size)} m de plus, puis freine`
        : `reste au gaz ${whole(size)} m de plus : ici, pas besoin de freiner`,
    ({ size }) => `braque plus tôt : ${fine(size)} m trop à l’extérieur à l’entrée`,
    ({ size }) => `garde ${fine(size * 3.6)} km/h de plus dans le virage`,
    ({ size }) => `passe la corde ${fine(size)} m plus à l’intérieur`,
    ({ size }) => `remets les gaz ${whole(size)} m plus tôt, dès la corde`,
    ({ size }) => `garde les gaz en sortie : coupés pendant ${whole(size)} m`,
    ({ size }) => `laisse filer le kart : ${fine(size)} m de piste restent libres en sortie`,
    () => 'aucune faute de pilotage ; regarde le kart',
  ],
  lap: (lap, time) => `Tour ${lap} : ${time}`,
  behind: (seconds) => `${seconds} s sur la limite`,
  nothing: 'aucune faute',
  notCompared: (why) => `pas comparé : ${why}`,
  reasons: [
    [/^from the start$/, 'depuis le départ'],
    [/^not clean$/, 'pas propre'],
    [/^touched a kart$/, 'contact avec un kart'],
    [/^hit by an item$/, 'touché par un objet'],
    [/^([\d.]+) s under an item's effect$/, '$1 s sous l’effet d’un objet'],
    [/^([\d.]+) s under a flag$/, '$1 s sous drapeau'],
    [/^([\d.]+) s in traffic$/, '$1 s dans le trafic'],
  ],
};

const ALL: Record<Language, CoachWords> = { en, fr };

/** Returns what a cue says. */
export function cueText({ fault, reach }: Told, language: Language): string {
  const say = ALL[language];
  return fault === 1 && !reach ? say.liftLater : (say.cues[fault] ?? '');
}

/** Returns what is said of a lap: its time, and what to try. */
export function lapWords(told: Told, language: Language): { lap: string; tip: string } {
  const say = ALL[language];
  const lap = say.lap(told.lap, lapText(told.timeUs));
  if (told.behindUs === null) {
    const why = told.reason.split(', ').map((reason) => reasonSaid(reason, say));
    return { lap, tip: say.notCompared(why.join(', ')) };
  }
  const tip = say.tries[told.fault]?.(told) || say.nothing;
  const behind = say.behind(deltaText(told.behindUs / 1e6));
  return { lap: `${lap}, ${behind}`, tip: told.corner ? `${told.corner}: ${tip}` : tip };
}

function reasonSaid(reason: string, say: CoachWords): string {
  for (const [english, said] of say.reasons)
    if (english.test(reason)) return reason.replace(english, said);
  return reason;
}
