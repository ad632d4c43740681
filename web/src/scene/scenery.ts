// Trees around an outdoor course, always the same for the same course.

import {
  ConeGeometry,
  CylinderGeometry,
  InstancedMesh,
  IcosahedronGeometry,
  Matrix4,
  MeshLambertMaterial,
  Color,
  Quaternion,
  Vector3,
  type BufferGeometry,
} from 'three';

import type { Course } from '../race/course';
import { chance } from './chance';
import { Facets, placed } from './facets';
import { nearestSample } from './outline';

const TREES = 120;
const TRIES = 900;
// In metres: trees do not shrink with the karts, and stand only where karts are large.
const CLEAR = 7; // beyond the verge
const AROUND = 70;

export class Scenery {
  readonly mesh: InstancedMesh<BufferGeometry, MeshLambertMaterial>;

  constructor(course: Course) {
    const trees = placesOf(course);
    this.mesh = new InstancedMesh(
      treeShape(),
      new MeshLambertMaterial({ vertexColors: true }),
      trees.length,
    );
    const next = chance(21);
    const [up, turn] = [new Vector3(0, 0, 1), new Quaternion()];
    trees.forEach(([x, y], row) => {
      const size = 0.75 + 0.9 * next();
      turn.setFromAxisAngle(up, 2 * Math.PI * next());
      const wide = size * (0.85 + 0.3 * next());
      this.mesh.setMatrixAt(
        row,
        new Matrix4().compose(new Vector3(x, y, 0), turn, new Vector3(wide, wide, size)),
      );
      this.mesh.setColorAt(
        row,
        new Color().setHSL(0.24 + 0.07 * next(), 0.24 + 0.2 * next(), 0.62 + 0.24 * next()),
      );
    });
    this.mesh.castShadow = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.mesh.dispose();
  }
}

function placesOf(course: Course): [number, number][] {
  const next = chance(course.samples);
  const { left, right, bottom, top } = course.box;
  const places: [number, number][] = [];
  for (let attempt = 0; attempt < TRIES && places.length < TREES; attempt++) {
    const x = left - AROUND + next() * (right - left + 2 * AROUND);
    const y = bottom - AROUND + next() * (top - bottom + 2 * AROUND);
    const sample = nearestSample(course, { x, y });
    const away = Math.hypot(course.x(sample) - x, course.y(sample) - y);
    const { halfWidths, kerb, grass } = course.frame;
    const half = Math.max(halfWidths[2 * sample]!, halfWidths[2 * sample + 1]!);
    if (away > half + kerb + grass + CLEAR) places.push([x, y]);
  }
  return places;
}

function treeShape(): BufferGeometry {
  const facets = new Facets();
  facets.shape(
    new CylinderGeometry(0.16, 0.26, 2.2, 5, 1, true),
    placed([0, 0, 1.1], [0.5 * Math.PI, 0, 0]),
    '#6b4f36',
  );
  facets.shape(new IcosahedronGeometry(2.1, 1), placed([0, 0, 4.1]), '#5f8f43');
  facets.shape(
    new IcosahedronGeometry(1.5, 0),
    placed([0.9, 0.5, 3.1], [0.4, 0.2, 0.3]),
    '#527f3a',
  );
  facets.shape(
    new IcosahedronGeometry(1.4, 0),
    placed([-0.7, -0.8, 3.3], [0.1, 0.7, 0.2]),
    '#6a9b4a',
  );
  facets.shape(
    new ConeGeometry(1.3, 2, 6, 1, true),
    placed([0, 0, 5.7], [0.5 * Math.PI, 0, 0]),
    '#6fa04c',
  );
  return facets.geometry();
}
