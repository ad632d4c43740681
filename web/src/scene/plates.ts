// Numbers on bodywork: one picture holds those of all karts, each instance shows its part of it.

import {
  BufferGeometry,
  CanvasTexture,
  Float32BufferAttribute,
  InstancedBufferAttribute,
  InstancedMesh,
  MeshLambertMaterial,
  SRGBColorSpace,
} from 'three';

import { liveryOf } from '../draw/palette';
import type { Model } from './vehicles';

const CELLS = 8; // along each side of the picture
const CELL_PIXELS = 96;
export const MOST_KARTS = CELLS * CELLS;

/** The plates of all karts; instance matrices are those of the bodies. */
export class Plates {
  readonly mesh: InstancedMesh<BufferGeometry, MeshLambertMaterial>;
  private readonly canvas = document.createElement('canvas');
  private readonly texture: CanvasTexture;
  private readonly shown = new Int16Array(MOST_KARTS).fill(-1);

  constructor(model: Model) {
    this.canvas.width = this.canvas.height = CELLS * CELL_PIXELS;
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.anisotropy = 4;
    const geometry = shapeOf(model);
    geometry.setAttribute('cell', new InstancedBufferAttribute(cellsOfRows(), 2));
    const material = new MeshLambertMaterial({
      map: this.texture,
      transparent: true,
      depthWrite: false,
    });
    material.polygonOffset = true;
    material.polygonOffsetFactor = -1;
    material.onBeforeCompile = (shader) => {
      shader.vertexShader = shader.vertexShader
        .replace('#include <common>', '#include <common>\nattribute vec2 cell;')
        .replace(
          '#include <uv_vertex>',
          '#include <uv_vertex>\nvMapUv = cell + uv * CELL;'.replace(
            'CELL',
            (1 / CELLS).toFixed(5),
          ),
        );
    };
    this.mesh = new InstancedMesh(geometry, material, MOST_KARTS);
  }

  /** Shows the number of a seat on the kart of a row. */
  show(row: number, seat: number): void {
    if (this.shown[row] === seat) return;
    this.shown[row] = seat;
    const context = this.canvas.getContext('2d')!;
    const [x, y] = [(row % CELLS) * CELL_PIXELS, Math.floor(row / CELLS) * CELL_PIXELS];
    context.clearRect(x, y, CELL_PIXELS, CELL_PIXELS);
    paintNumber(context, x, y, seat);
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
    this.mesh.dispose();
  }
}

function paintNumber(context: CanvasRenderingContext2D, x: number, y: number, seat: number): void {
  const inset = 5;
  context.beginPath();
  context.roundRect(x + inset, y + inset, CELL_PIXELS - 2 * inset, CELL_PIXELS - 2 * inset, 14);
  context.fillStyle = '#f7f8fa';
  context.fill();
  context.lineWidth = 5;
  context.strokeStyle = liveryOf(seat).hasStripe ? liveryOf(seat).ink : '#10151b';
  context.stroke();
  context.font = `800 ${CELL_PIXELS * (seat > 9 ? 0.56 : 0.7)}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = '#10151b';
  context.fillText(String(seat), x + 0.5 * CELL_PIXELS, y + 0.54 * CELL_PIXELS);
}

/** Returns the corners of the parts of the picture, the first row at its top. */
function cellsOfRows(): Float32Array {
  const cells = new Float32Array(2 * MOST_KARTS);
  for (let row = 0; row < MOST_KARTS; row++) {
    cells[2 * row] = (row % CELLS) / CELLS;
    cells[2 * row + 1] = 1 - (Math.floor(row / CELLS) + 1) / CELLS;
  }
  return cells;
}

function shapeOf(model: Model): BufferGeometry {
  const [positions, normals, uvs]: [number[], number[], number[]] = [[], [], []];
  for (const { at, turn, lean, size } of model.plates) {
    // A plate faces `ahead`; its own right hand is `right`, seen from in front of it.
    const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
    const ahead = [cos * Math.cos(lean), sin * Math.cos(lean), Math.sin(lean)] as const;
    const up = [-cos * Math.sin(lean), -sin * Math.sin(lean), Math.cos(lean)] as const;
    const right = [-sin, cos, 0] as const;
    for (const [u, v] of [
      [0, 0],
      [1, 0],
      [1, 1],
      [0, 0],
      [1, 1],
      [0, 1],
    ] as const) {
      for (let axis = 0; axis < 3; axis++) {
        const along = (u - 0.5) * size * right[axis]! + (v - 0.5) * size * up[axis]!;
        positions.push(at[axis]! + along);
      }
      normals.push(...ahead);
      uvs.push(u, v);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new Float32BufferAttribute(normals, 3));
  geometry.setAttribute('uv', new Float32BufferAttribute(uvs, 2));
  return geometry;
}
