// The table top under the model of a course.

import { BoxGeometry, Mesh, MeshLambertMaterial } from 'three';

import type { Course } from '../race/course';
import { coloursOf } from '../scene/surroundings';

const MARGIN = 0.05; // of the longer side
const THICK = 0.018;

export class Plinth {
  readonly mesh: Mesh<BoxGeometry, MeshLambertMaterial>;

  constructor(course: Course, length: number) {
    const { left, right, bottom, top } = course.box;
    const longer = Math.max(right - left, top - bottom);
    const rim = 2 * MARGIN * longer + length;
    const high = THICK * longer;
    const shape = new BoxGeometry(right - left + rim, top - bottom + rim, high);
    this.mesh = new Mesh(shape, new MeshLambertMaterial({ color: coloursOf(course).around }));
    this.mesh.position.set(0.5 * (left + right), 0.5 * (bottom + top), -0.5 * high);
    // Below all layers of the ground, which do not look at depth.
    this.mesh.renderOrder = -70;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
