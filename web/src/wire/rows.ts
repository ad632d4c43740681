// Rows of a message.

// No valid message has more rows.
const MOST_ROWS = 100_000;

/** What stands for numbers that a message does not have. */
export const NOTHING = new Float64Array();

/** Returns what `read` makes of each row. */
export function rowsOf<Row>(count: number, read: (row: number) => Row): Row[] {
  if (count > MOST_ROWS) throw new RangeError(`${count} rows`);
  return Array.from({ length: count }, (_, row) => read(row));
}
