// What the page knows of the race in three dimensions before it loads the code that draws it.

export const EYES = ['driver', 'chase', 'trackside', 'above'] as const;
/** The cameras. */
export type Eye = (typeof EYES)[number];

const KEPT = 'race.space';

/** Whether the race is shown in three dimensions: as chosen, else where a graphics card draws. */
export function prefersSpace(): boolean {
  const kept = localStorage.getItem(KEPT);
  return kept === null ? hasGraphicsCard() : kept === 'yes';
}

export function keepSpace(isWanted: boolean): void {
  localStorage.setItem(KEPT, isWanted ? 'yes' : 'no');
}

export function hasGraphicsCard(): boolean {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('webgl2', { failIfMajorPerformanceCaveat: true });
  context?.getExtension('WEBGL_lose_context')?.loseContext();
  return context !== null;
}
