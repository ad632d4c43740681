import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { cueText, lapWords } from '../src/i18n/coach/said';
import { isHelped } from '../src/race/helped';
import { Race } from '../src/race/race.svelte';
import { decode } from '../src/wire/decode';
import { snapshot } from './frames';
import type { HintFrame } from '../src/wire/frames';
import { HintKind } from '../src/wire/tables';

const KINDS = Object.values(HintKind).filter((kind) => typeof kind === 'number');

function golden(): Uint8Array<ArrayBuffer> {
  const line = readFileSync('../tests/net/golden_messages.txt', 'utf8')
    .split('\n')
    .find((line) => line.startsWith('hint '))!;
  return Uint8Array.from(Buffer.from(line.split(' ')[1]!, 'hex'));
}

function told(): HintFrame {
  const frame = decode(golden().buffer);
  if (frame?.kind !== 'hint') throw new Error('no hint');
  return frame;
}

test('what a coach says of a lap is read as it is sent, and said in both languages', () => {
  expect(told()).toMatchObject({ lap: 3, timeUs: 31_250_000, behindUs: 1_500_000, corner: 'T4' });
  expect(lapWords(told(), 'en')).toEqual({
    lap: 'Lap 3: 31.250, +1.50 s to the limit',
    tip: 'T4: brake 7 m later: the limit brakes 12 m before the apex',
  });
  expect(lapWords(told(), 'fr').tip).toContain('T4: freine 7 m plus tard');
});

test('each fault that can be acted on has a cue and a tip in each language', () => {
  for (const language of ['en', 'fr'] as const)
    for (const fault of KINDS as HintKind[]) {
      if (fault === HintKind.NONE) continue;
      expect(lapWords({ ...told(), fault }, language).tip.length).toBeGreaterThan(12);
      if (fault !== HintKind.UNKNOWN)
        expect(cueText({ ...told(), fault }, language)).not.toBe('');
    }
  expect(cueText({ ...told(), reach: 0 }, 'en')).toBe('lift later');
});

test('why a lap is not compared is said in French as well', () => {
  const lap = { ...told(), behindUs: null, reason: 'touched a kart, 3.4 s in traffic' };
  expect(lapWords(lap, 'fr').tip).toBe('pas comparé : contact avec un kart, 3.4 s dans le trafic');
});

test('help that fades is given in the stretches of the coach, also across the timing line', () => {
  const { helped } = told();
  const asked = [10, 30, 64.4, 65, 379, 381, 400 + 3, 400 + 5];
  expect(asked.map((progress) => isHelped(helped, progress, 400))).toEqual([
    ...[false, true, true, false, false, true, true, false],
  ]);
});

test('a damaged word of a coach is none', () => {
  for (let at = 8; at + 4 <= golden().length; at += 4) {
    const bytes = golden();
    new DataView(bytes.buffer).setUint32(at, 200_000, true);
    expect(() => decode(bytes.buffer)).not.toThrow();
  }
});

test('the words of a coach are gone with their race, and come too late for the next one', () => {
  const race = new Race();
  const [words, { epoch, helped }] = [decode(golden().buffer)!, told()];
  race.take(words, 0);
  expect(race.hint).toBeNull(); // of no race that is on
  race.take(snapshot({ epoch }), 0);
  race.take(words, 0);
  expect(race.hint?.told.lap).toBe(3);
  expect(race.helped).toEqual(helped);
  race.take(snapshot({ epoch: epoch + 1 }), 0);
  race.take(words, 0);
  expect(race.hint).toBeNull();
  expect(race.helped).toEqual([]);
});
