// What the gateway takes of what people type; see docs/gateway.md.

export const MAX_SEAT = 63;
export const MOST_TOKEN = 128; // characters
/** For the pattern of an input: a seat's number. */
export const SEAT_PATTERN = '0*([0-9]|[1-5][0-9]|6[0-3])';

/** Whether this is the number of a seat; an empty number input holds none. */
export function isSeat(value: number | null | undefined): value is number {
  return Number.isInteger(value) && value! >= 0 && value! <= MAX_SEAT;
}

/** Returns a name as the gateway takes it: without what cannot be seen. */
export function tidyName(name: string): string {
  return name
    .replace(/[\s\p{Z}]+/gu, ' ')
    .replace(/\p{C}/gu, '')
    .trim();
}
