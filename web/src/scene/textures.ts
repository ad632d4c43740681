// Surfaces that repeat, painted once: no pictures are loaded.

import { CanvasTexture, RepeatWrapping, SRGBColorSpace, type Texture } from 'three';

import { chance } from './chance';

const PIXELS = 256;

export type Grain = 'asphalt' | 'grass' | 'floor';

// Shade, its spread, and how many specks of which size: grey, as colours multiply it.
const GRAINS: Record<Grain, { base: number; spread: number; specks: number; size: number }> = {
  asphalt: { base: 238, spread: 17, specks: 9000, size: 1.6 },
  grass: { base: 234, spread: 26, specks: 7000, size: 3 },
  floor: { base: 244, spread: 9, specks: 2500, size: 2 },
};

/** Returns a texture that tiles. */
export function grain(kind: Grain): Texture {
  const { base, spread, specks, size } = GRAINS[kind];
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = PIXELS;
  const context = canvas.getContext('2d')!;
  context.fillStyle = `rgb(${base} ${base} ${base})`;
  context.fillRect(0, 0, PIXELS, PIXELS);
  const next = chance(kind.length);
  for (let speck = 0; speck < specks; speck++) {
    const shade = Math.round(base + (next() - 0.5) * 2 * spread);
    const across = size * (0.4 + next());
    const along = kind === 'grass' ? across * (1 + 2 * next()) : across;
    context.fillStyle = `rgb(${shade} ${shade} ${shade} / 55%)`;
    const [x, y] = [next() * PIXELS, next() * PIXELS];
    for (const dx of [0, -PIXELS]) {
      for (const dy of [0, -PIXELS]) context.fillRect(x + dx, y + dy, across, along);
    }
  }
  const texture = new CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 8;
  return texture;
}
