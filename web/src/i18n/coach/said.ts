// What a coach says to the driver of this page, in the language of the page.

import { deltaText, lapText } from '../figures';
import type { Language } from '../words.svelte';
import type { HintFrame } from '../../wire/frames';
import { HintKind } from '../../wire/tables';
import { en } from './en';
import { fr } from './fr';
import type { CoachWords } from './words';

const ALL: Record<Language, CoachWords> = { en, fr };

/** Returns what a cue says. */
export function cueText({ fault, reach }: HintFrame, language: Language): string {
  const say = ALL[language];
  return fault === HintKind.EARLY_BRAKES && !reach ? say.liftLater : (say.cues[fault] ?? '');
}

/** Returns what is said of a lap: its time, and what to try. */
export function lapWords(told: HintFrame, language: Language): { lap: string; tip: string } {
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
