import { expect, test } from 'vitest';

import { isSeat, SEAT_PATTERN, tidyName } from '../src/wire/bounds';

test('a seat has a number from 0 to 63', () => {
  expect([0, 63].map(isSeat)).toEqual([true, true]);
  expect([-1, 64, 1.5, NaN, null, undefined].map(isSeat)).toEqual(Array(6).fill(false));
});

test('what is typed as a seat is one', () => {
  const pattern = new RegExp(`^(?:${SEAT_PATTERN})$`, 'v');
  expect(['0', '07', '59', '63'].every((text) => pattern.test(text))).toBe(true);
  expect(['64', '70', '100', '-1', 'a'].some((text) => pattern.test(text))).toBe(false);
});

test('a name goes without what cannot be seen', () => {
  expect(tidyName(' Dan\u00a0B\t ')).toBe('Dan B');
  expect(tidyName('\u{1f469}\u200d\u{1f680} Dan')).toBe('\u{1f469}\u{1f680} Dan');
  expect(tidyName('Dan\ud83d')).toBe('Dan');
});
