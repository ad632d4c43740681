import { expect, test } from 'vitest';

import { liveryOf } from '../src/draw/palette';

/** Returns the contrast of two colours as WCAG 2.2 defines it. */
function contrastOf(one: string, other: string): number {
  const [low, high] = [lightOf(one), lightOf(other)].sort((a, b) => a - b);
  return (high! + 0.05) / (low! + 0.05);
}

function lightOf(colour: string): number {
  const shares = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
  const [red, green, blue] = shares.map((share) =>
    share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4,
  );
  return 0.2126 * red! + 0.7152 * green! + 0.0722 * blue!;
}

test('the number of a kart can be read on its colour', () => {
  for (let seat = 0; seat < 8; seat++) {
    const { colour, ink } = liveryOf(seat);
    expect(contrastOf(colour, ink), colour).toBeGreaterThan(4.5);
  }
});
