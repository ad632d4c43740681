// What the page knows of the race in three dimensions before it loads the code that draws it.

export const EYES = ['driver', 'chase', 'trackside', 'above'] as const;
/** The cameras. */
export type Eye = (typeof EYES)[number];

const KEPT = 'race.space';
const DRAWN_BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|software|basic render/i;

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
  if (!context) return false;
  // Some browsers do not count drawing by the processor as a caveat.
  const names = context.getExtension('WEBGL_debug_renderer_info');
  const name = String(context.getParameter(names?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER));
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return !DRAWN_BY_PROCESSOR.test(name);
}
