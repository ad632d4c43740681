// Colours of karts: Okabe and Ito, 2008, which people who cannot distinguish red from green can tell
// apart. Every second eight has a stripe; the number is always there too.

const COLOURS = [
  '#e69f00',
  '#56b4e9',
  '#009e73',
  '#f0e442',
  '#0072b2',
  '#d55e00',
  '#cc79a7',
  '#c8ccd0',
] as const;
const DARK_INK = '#0b0f14';
const LIGHT_INK = '#ffffff';

export interface Livery {
  colour: string;
  ink: string; // of the number
  hasStripe: boolean;
}

/** Returns the colours of the kart of a seat. */
export function liveryOf(seat: number): Livery {
  const colour = COLOURS[seat % COLOURS.length]!;
  return {
    colour,
    ink: colour === '#0072b2' ? LIGHT_INK : DARK_INK,
    hasStripe: Math.floor(seat / COLOURS.length) % 2 === 1,
  };
}

/** Returns the colour of a seat's line in a chart, darker on paper so that it can be seen. */
export function chartColour(seat: number): string {
  const { colour } = liveryOf(seat);
  return isDay() ? `color-mix(in srgb, ${colour}, black 30%)` : colour;
}

/** Colours of speed, slow to fast: dark violet to yellow, readable on asphalt and without red. */
export const SPEED_COLOURS = [
  '#5b3fa0',
  '#4a5fc1',
  '#3b86c4',
  '#35a8b0',
  '#4fc48a',
  '#a5d857',
  '#f4e84a',
] as const;

export interface MapColours {
  around: string;
  grass: string;
  asphalt: string;
  kerb: string;
  border: string;
  marking: string;
  ink: string;
  halo: string;
  obstacle: string;
}

const NIGHT: MapColours = {
  around: '#0d1218',
  grass: '#1f3326',
  asphalt: '#30363f',
  kerb: '#a8433f',
  border: '#dfe5ea',
  marking: '#8d97a3',
  ink: '#f2f5f8',
  halo: '#0d1218',
  obstacle: '#b98a3a',
};

const DAY: MapColours = {
  around: '#eef1f4',
  grass: '#cfe3c4',
  asphalt: '#9aa1aa',
  kerb: '#d9534f',
  border: '#20242a',
  marking: '#eef1f4',
  ink: '#12161b',
  halo: '#ffffff',
  obstacle: '#c98f2a',
};

export function mapColours(): MapColours {
  return isDay() ? DAY : NIGHT;
}

function isDay(): boolean {
  return matchMedia('(prefers-color-scheme: light)').matches;
}
