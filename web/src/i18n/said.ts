// Says in French what the server says in English, by the table of its sheets
// (`race_server/competition/race_day/languages.py`). Names, and what people wrote, stay as they are.

import french from '../../../race_server/competition/race_day/french.json';

const WORDS = new Map(Object.entries(french.words));
const PHRASES = french.phrases.map(([phrase = '', said = '']) => ({
  phrase: new RegExp(`^(?:${phrase})$`),
  said,
}));
const PARTS = french.parts_of_titles.map(([part = '', said = '']) => ({
  part: new RegExp(part),
  said: said.replace(/\\(\d)/g, '$$$1'),
}));

/** Returns remarks in French. */
export function remarkInFrench(text: string): string {
  return text.split('; ').map(inFrench).join('; ');
}

/** Returns the title of a stage or a race in French. */
export function headingInFrench(text: string): string {
  for (const [stage, said] of Object.entries(french.stages)) {
    if (new RegExp(`^${stage}\\b`).test(text))
      return PARTS.reduce(
        (title, { part, said }) => title.replace(part, said),
        said + text.slice(stage.length),
      );
  }
  return inFrench(text);
}

function inFrench(text: string): string {
  const word = WORDS.get(text);
  if (word !== undefined) return word;
  for (const { phrase, said } of PHRASES) {
    const found = phrase.exec(text);
    if (found)
      return said
        .replace(/\\(\d)/g, (_, group: string) => found[Number(group)] ?? '')
        .replace(/⟨(.*)⟩/, (_, inner: string) => inFrench(inner));
  }
  return text;
}
