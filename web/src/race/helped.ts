// Where help that fades is given: a coach withdraws it corner by corner.

/** Returns whether a place of a course lies in one of some stretches. All in [m]. */
export function isHelped(
  stretches: readonly (readonly [number, number])[],
  progress: number,
  length: number,
): boolean {
  const place = ((progress % length) + length) % length;
  return stretches.some(([begin, end]) =>
    begin <= end ? begin <= place && place < end : place >= begin || place < end,
  );
}
