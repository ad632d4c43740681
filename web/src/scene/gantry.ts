// The arch over the timing line, with the lights of the start.

import {
  type BufferGeometry,
  Color,
  Group,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  SphereGeometry,
} from 'three';

import type { Course } from '../race/course';
import type { SnapshotFrame } from '../wire/frames';
import { Phase } from '../wire/tables';
import { Facets } from './facets';

// In lengths of a kart.
const CLEAR = 1.9; // below the beam
const BEAM = 0.5;
const POST = 0.12;
const LIGHTS = 5;
const CELLS = 24;

const OFF = new Color('#2a1512');
const RED = new Color('#ff2d1f');
const GREEN = new Color('#3dff6e');

export class Gantry {
  readonly group = new Group();
  private readonly frameMesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  private readonly lamps: InstancedMesh<SphereGeometry, MeshBasicMaterial>;
  private shown = -2;

  constructor(course: Course, length: number) {
    const { kerb } = course.frame;
    const [left, right] = [course.edge(0, 'left', kerb), course.edge(0, 'right', kerb)];
    const span = Math.hypot(left.x - right.x, left.y - right.y) + 0.5 * length;
    const facets = new Facets();
    const dark = '#262c34';
    for (const side of [1, -1]) {
      const y = 0.5 * side * span;
      facets.box(
        [0, y, 0.5 * (CLEAR + BEAM) * length],
        [POST * length, POST * length, (CLEAR + BEAM) * length],
        dark,
      );
      facets.box([0, y, 0.08 * length], [0.4 * length, 0.3 * length, 0.16 * length], '#b9c0c8');
    }
    facets.box([0, 0, (CLEAR + 0.5 * BEAM) * length], [POST * length, span, BEAM * length], dark);
    addChequers(facets, span, length);
    this.frameMesh = new Mesh(facets.geometry(), new MeshLambertMaterial({ vertexColors: true }));
    this.frameMesh.castShadow = true;
    this.lamps = new InstancedMesh(
      new SphereGeometry(0.1 * length, 10, 8),
      new MeshBasicMaterial(),
      LIGHTS,
    );
    for (let lamp = 0; lamp < LIGHTS; lamp++) {
      const y = (lamp - 0.5 * (LIGHTS - 1)) * 0.3 * length;
      this.lamps.setMatrixAt(
        lamp,
        new Matrix4().setPosition(-0.1 * length, y, (CLEAR + 0.26) * length),
      );
      this.lamps.setColorAt(lamp, OFF);
    }
    this.group.add(this.frameMesh, this.lamps);
    const middle = { x: 0.5 * (left.x + right.x), y: 0.5 * (left.y + right.y) };
    this.group.position.set(middle.x, middle.y, 0);
    this.group.rotation.z = course.heading(0);
  }

  /** Lights one lamp for each second that is left, none in the race; all are green just after. */
  update(frame: SnapshotFrame, sinceGreen: number): void {
    const isCounting = frame.phase === Phase.COUNTDOWN || frame.lights > 0;
    const lit = isCounting
      ? Math.max(LIGHTS - Math.floor(frame.lights), 0)
      : sinceGreen < 3
        ? -1
        : 0;
    if (lit === this.shown) return;
    this.shown = lit;
    for (let lamp = 0; lamp < LIGHTS; lamp++) {
      this.lamps.setColorAt(lamp, lit < 0 ? GREEN : lamp < lit ? RED : OFF);
    }
    this.lamps.instanceColor!.needsUpdate = true;
  }

  dispose(): void {
    this.frameMesh.geometry.dispose();
    this.frameMesh.material.dispose();
    this.lamps.geometry.dispose();
    this.lamps.material.dispose();
    this.lamps.dispose();
  }
}

/** Chequers along the lower edge of the beam, on both of its faces. */
function addChequers(facets: Facets, span: number, length: number): void {
  const width = span / CELLS;
  for (const face of [1, -1]) {
    const x = face * (0.5 * POST + 0.01) * length;
    for (let cell = 0; cell < CELLS; cell++) {
      for (let row = 0; row < 2; row++) {
        const [from, to] = [(cell - 0.5 * CELLS) * width, (cell + 1 - 0.5 * CELLS) * width];
        const [low, high] = [row, row + 1].map((step) => (CLEAR + 0.06 * step) * length) as [
          number,
          number,
        ];
        const [a, b] = face > 0 ? [from, to] : [to, from];
        facets.quad(
          [x, a, low],
          [x, b, low],
          [x, b, high],
          [x, a, high],
          (cell + row) % 2 ? '#f4f5f7' : '#0d0f12',
        );
      }
    }
  }
}
