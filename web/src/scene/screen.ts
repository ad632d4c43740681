// Instances that are half there: of a kart that is out of the race every second pixel is drawn.

import { type BufferGeometry, InstancedBufferAttribute, type Material } from 'three';

/** Adds to a geometry whether each instance is there as a whole: 1, or 0 for every second pixel. */
export function addPresence(geometry: BufferGeometry, most: number, per = 1): Float32Array {
  const presence = new InstancedBufferAttribute(new Float32Array(most), 1, false, per);
  geometry.setAttribute('presence', presence);
  return presence.array as Float32Array;
}

/** Lets a material heed the presence of its instances. */
export function screened<M extends Material>(material: M): M {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace(
        '#include <common>',
        '#include <common>\nattribute float presence;\nvarying float vPresence;',
      )
      .replace('#include <begin_vertex>', '#include <begin_vertex>\nvPresence = presence;');
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', '#include <common>\nvarying float vPresence;')
      .replace(
        '#include <clipping_planes_fragment>',
        `#include <clipping_planes_fragment>
        if (vPresence < 0.5 && mod(floor(gl_FragCoord.x) + floor(gl_FragCoord.y), 2.0) < 0.5) discard;`,
      );
  };
  return material;
}
