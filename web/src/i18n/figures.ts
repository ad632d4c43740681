// Numbers as people read them at a race.

/** Returns a lap time, such as 1:02.345 or 9.870. us: [µs]. */
export function lapText(us: number): string {
  if (!(us > 0)) return '–';
  const thousandths = Math.round(us / 1000);
  const minutes = Math.floor(thousandths / 60_000);
  const seconds = ((thousandths % 60_000) / 1000).toFixed(3);
  return minutes ? `${minutes}:${seconds.padStart(6, '0')}` : seconds;
}

/** Returns a time of the race, such as 2:05.3. */
export function clockText(seconds: number): string {
  if (Number.isNaN(seconds)) return '–';
  const sign = seconds < 0 ? '−' : '';
  const tenths = Math.floor(Math.abs(seconds) * 10);
  const rest = (tenths % 600) / 10;
  return `${sign}${Math.floor(tenths / 600)}:${rest.toFixed(1).padStart(4, '0')}`;
}

/** Returns a gap, such as +1.234. */
export function gapText(seconds: number): string {
  if (Number.isNaN(seconds)) return '';
  return `+${seconds.toFixed(seconds < 100 ? 3 : 1)}`;
}

/** Returns a count of places with its sign, nothing for none. */
export function gainedText(places: number): string {
  if (!places) return '';
  return `${places < 0 ? '−' : '+'}${Math.abs(places)}`;
}

/** Returns a difference with its sign, such as −0.42. */
export function deltaText(seconds: number): string {
  if (Number.isNaN(seconds)) return '–';
  return `${seconds < 0 ? '−' : '+'}${Math.abs(seconds).toFixed(2)}`;
}

/** Returns microseconds as seconds without needless digits, such as 5 or 2.5. */
export function secondsText(us: number): string {
  return String(Number((us / 1e6).toFixed(2)));
}

/** Returns a speed in km/h. speed: [m/s]. */
export function kmh(speed: number): string {
  return Number.isNaN(speed) ? '–' : Math.round(Math.abs(speed) * 3.6).toString();
}
