import { expect, test } from 'vitest';

import { type Cast, messageOf, whoOf } from '../src/race/control';
import { EventKind } from '../src/wire/tables';
import { en } from '../src/i18n/en';
import { clockText, deltaText, gapText, lapText } from '../src/i18n/figures';
import { fr } from '../src/i18n/fr';
import { event } from './frames';

const cast: Cast = {
  name: (seat) => `Ada ${seat}`,
  item: (number) => (number === 1 ? 'boost' : 'oil'),
  startTick: 60,
};

test('times are read as people read them', () => {
  expect(lapText(62_345_600)).toBe('1:02.346');
  expect(lapText(59_999_900)).toBe('1:00.000');
  expect(lapText(0)).toBe('–');
  expect(clockText(125.37)).toBe('2:05.3');
  expect(gapText(1.2345)).toBe('+1.234');
  expect(deltaText(-0.424)).toBe('−0.42');
});

test('race control says what happened, in both languages', () => {
  const lap = event({ kind: EventKind.LAP, kart: 3, tick: 660, other: 2, value: 9_870_000 });
  expect(messageOf(lap, cast, en)).toMatchObject({ text: 'Ada 3: lap 2 in 9.870', at: '0:10.0' });
  expect(messageOf(lap, cast, fr)?.text).toBe('Ada 3 : tour 2 en 9.870');
});

test('a yellow flag is a warning, and around whom is told', () => {
  const flag = event({ kind: EventKind.FLAG, kart: 5, other: 1 });
  expect(messageOf(flag, cast, en)).toMatchObject({
    tone: 'warning',
    text: 'yellow flag around Ada 5',
  });
});

test('who is parked is told with the slot, if it has a number', () => {
  const parked = event({ kind: EventKind.PARKED, kart: 3, other: 7 });
  expect(messageOf(parked, cast, en)).toMatchObject({
    tone: 'good',
    text: 'Ada 3 is parked in slot 7',
  });
  const anywhere = event({ kind: EventKind.PARKED, kart: 3, other: -1 });
  expect(messageOf(anywhere, cast, fr)?.text).toBe('Ada 3 est garé');
});

test('a person who is hit is a danger', () => {
  const hit = event({ kind: EventKind.HIT_PERSON, kart: 3, other: 0 });
  expect(messageOf(hit, cast, en)).toMatchObject({ tone: 'danger', text: 'Ada 3 hits a person' });
  const out = event({ kind: EventKind.RETIRED, kart: 3, other: 9 });
  expect(messageOf(out, cast, en)?.text).toBe('Ada 3 is out (hit a person)');
});

test('why stewards removed a kart is told', () => {
  const out = event({ kind: EventKind.RETIRED, kart: 3, other: 12, value: 3 });
  expect(messageOf(out, cast, en)?.text).toBe('Ada 3 is out (removed by the stewards: ramming)');
});

test('sectors are not told one by one', () => {
  expect(messageOf(event({ kind: EventKind.SECTOR }), cast, en)).toBeNull();
});

test('a name that is written from right to left does not turn the sentence around it', () => {
  const reads = messageOf(
    event({ kind: EventKind.LAP, kart: 3, other: 2, value: 9_870_000 }),
    { ...cast, name: (seat) => whoOf('أحمد', seat) },
    en,
  )!;
  expect(reads.text).toContain('\u2068أحمد\u2069 3');
  expect(whoOf('', 3)).toBe('3');
});
