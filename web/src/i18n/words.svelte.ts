// The language of the page: the browser's, if there is a translation, or the one chosen.

import { type Words, en } from './en';
import { fr } from './fr';

export type Language = 'en' | 'fr';

const ALL: Record<Language, Words> = { en, fr };
const KEPT = 'race.language';

function first(): Language {
  const kept = localStorage.getItem(KEPT);
  const wanted = kept ?? navigator.language;
  return wanted.startsWith('fr') ? 'fr' : 'en';
}

let language = $state<Language>(first());

export function words(): Words {
  return ALL[language];
}

export function chosenLanguage(): Language {
  return language;
}

export function chooseLanguage(wanted: Language): void {
  language = wanted;
  localStorage.setItem(KEPT, wanted);
}
