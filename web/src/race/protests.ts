// Protests of an event.

import type { Words } from '../i18n/en';

/** Returns what was decided on a protest, in the reader's language. */
export function outcomeText(outcome: string, words: Words): string {
  const [verdict = '', ...more] = outcome.split(', ');
  const text = outcome ? (words.protest.outcomes[verdict] ?? verdict) : words.protest.open;
  return [text, ...more].join(', ');
}
