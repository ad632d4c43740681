// The ground, in flat layers that are drawn one over the other: none hides what stands on it.

import {
  BufferAttribute,
  BufferGeometry,
  Float32BufferAttribute,
  Group,
  Mesh,
  MeshLambertMaterial,
  type Texture,
  type Material,
} from 'three';

import type { Course, Point } from '../race/course';
import { areaWithin, bandBetween, type Sheet } from './outline';
import { coloursOf, hasVerge, settingOf } from './surroundings';
import { grain, type Grain } from './textures';

// In lengths of a kart.
const EDGE_STEP = 0.4;
const TILE = 2.2; // of a texture
const AROUND = 900;

const RED = [0.72, 0.08, 0.06] as const;
const WHITE = [0.86, 0.87, 0.88] as const;
const CONCRETE = [0.42, 0.43, 0.43] as const;
// Bends sharper than this have striped kerbs [1/lengths].
const BEND = 0.035;

/**
 * Makes a material one of the layers of the ground: the later ones lie above. No layer hides what
 * stands on it; those that are drawn last, as they let others shine through, are hidden by it.
 */
export function layered<M extends Material>(material: M): M {
  material.depthTest = material.transparent;
  material.depthWrite = false;
  return material;
}

/** Orders of the layers of the ground; all of them are drawn before what stands on it. */
export const LAYERS = {
  around: -60,
  verge: -50,
  road: -40,
  kerb: -36,
  rubber: -32,
  marks: -28,
  line: -24,
  flat: -20,
};

export class Ground {
  readonly group = new Group();
  readonly around = new Group(); // what lies beyond the borders
  private readonly textures: Texture[] = [];
  private readonly meshes: Mesh<BufferGeometry, MeshLambertMaterial>[] = [];

  constructor(course: Course, length: number) {
    const colours = coloursOf(course);
    const isOutdoor = settingOf(course) === 'outdoor';
    const surface: Grain = isOutdoor ? 'grass' : 'floor';
    this.lay(aroundOf(course, length), colours.around, surface, LAYERS.around, TILE * length * 2);
    this.around.add(...this.group.children);
    const within = areaWithin(course.loops);
    if (!hasVerge(course)) {
      this.lay(
        within,
        colours.road,
        isOutdoor || length > 1 ? 'asphalt' : 'floor',
        LAYERS.road,
        TILE * length,
      );
      return;
    }
    this.lay(within, colours.verge, 'grass', LAYERS.verge, TILE * length * 1.4);
    const { kerb } = course.frame;
    const step = EDGE_STEP * length;
    const [left, right] = [course.edgeLine('left', 0, step), course.edgeLine('right', 0, step)];
    if (kerb > 0) this.layKerbs(course, step, length);
    this.lay(bandBetween(left, right), colours.road, 'asphalt', LAYERS.road, TILE * length);
  }

  dispose(): void {
    for (const mesh of this.meshes) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
    for (const texture of this.textures) texture.dispose();
  }

  private lay(sheet: Sheet, colour: string, kind: Grain, order: number, tile: number): void {
    const texture = grain(kind);
    this.textures.push(texture);
    this.add(
      geometryOf(sheet, tile),
      new MeshLambertMaterial({ color: colour, map: texture }),
      order,
    );
  }

  private layKerbs(course: Course, step: number, length: number): void {
    const { kerb } = course.frame;
    const stride = Math.max(Math.floor(step / course.frame.spacing), 1);
    for (const side of ['left', 'right'] as const) {
      const outer = course.edgeLine(side, kerb, step);
      const inner = course.edgeLine(side, 0, step);
      const sheet = separate(
        side === 'left' ? bandBetween(outer, inner) : bandBetween(inner, outer),
      );
      const colours = new Float32Array((3 * sheet.points.length) / 2);
      for (let piece = 0; 18 * piece < colours.length; piece++) {
        const curvature = Math.abs(course.curvature((piece * stride) % course.samples)) * length;
        const striped = piece % 4 < 2 ? RED : WHITE;
        const shade = curvature > BEND ? striped : CONCRETE;
        for (let corner = 0; corner < 6; corner++) colours.set(shade, 18 * piece + 3 * corner);
      }
      const geometry = geometryOf(sheet, length);
      geometry.setAttribute('color', new BufferAttribute(colours, 3));
      this.add(geometry, new MeshLambertMaterial({ vertexColors: true }), LAYERS.kerb);
    }
  }

  private add(geometry: BufferGeometry, material: MeshLambertMaterial, order: number): void {
    const mesh = new Mesh(geometry, layered(material));
    mesh.renderOrder = order;
    mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    this.meshes.push(mesh);
    this.group.add(mesh);
  }
}

/** Returns a sheet as a geometry at height 0. tile: length of a texture [m]. */
export function geometryOf(sheet: Sheet, tile: number): BufferGeometry {
  const count = sheet.points.length / 2;
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  const uvs = new Float32Array(2 * count);
  for (let i = 0; i < count; i++) {
    const [x, y] = [sheet.points[2 * i]!, sheet.points[2 * i + 1]!];
    positions.set([x, y, 0], 3 * i);
    normals[3 * i + 2] = 1;
    uvs.set([x / tile, y / tile], 2 * i);
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new BufferAttribute(normals, 3));
  geometry.setAttribute('uv', new Float32BufferAttribute(uvs, 2));
  geometry.setIndex(sheet.triangles);
  return geometry;
}

/** Returns a sheet whose triangles share no corners, so that each may have its own colour. */
function separate(sheet: Sheet): Sheet {
  const points = sheet.triangles.flatMap((at) => [
    sheet.points[2 * at]!,
    sheet.points[2 * at + 1]!,
  ]);
  return { points, triangles: sheet.triangles.map((_, index) => index) };
}

function aroundOf(course: Course, length: number): Sheet {
  const { left, right, bottom, top } = course.box;
  const reach = AROUND * length;
  const corners: Point[] = [
    { x: left - reach, y: bottom - reach },
    { x: right + reach, y: bottom - reach },
    { x: right + reach, y: top + reach },
    { x: left - reach, y: top + reach },
  ];
  return { points: corners.flatMap(({ x, y }) => [x, y]), triangles: [0, 1, 2, 0, 2, 3] };
}
