// People, trailers, and what stands in a car park for a round.

import {
  BufferGeometry,
  CapsuleGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  Mesh,
  MeshLambertMaterial,
  SphereGeometry,
} from 'three';

import { liveryOf } from '../draw/palette';
import type { LotFrame, SnapshotFrame } from '../wire/frames';
import { RayHit } from '../wire/tables';
import { addBlock } from './barriers';
import { Facets, placed } from './facets';
import { writeUpright } from './placing';

const MOST_PEOPLE = 64;
const MOST_TRAILERS = 64;
const PERSON_HEIGHT = 1.75; // [m]
const PERSON_RADIUS = 0.25;

export class Crowd {
  readonly group = new Group();
  private readonly people: InstancedMesh<BufferGeometry, MeshLambertMaterial>;
  private readonly trailers: InstancedMesh<BufferGeometry, MeshLambertMaterial>;
  private blocks: Mesh<BufferGeometry, MeshLambertMaterial> | null = null;
  private round: LotFrame | null = null;
  private readonly drawn = new Int16Array(MOST_TRAILERS).fill(-1); // seats of the trailers' colours

  constructor(private readonly length: number) {
    this.people = this.part(personShape(), MOST_PEOPLE);
    this.trailers = this.part(trailerShape(), MOST_TRAILERS);
    const colour = new Color();
    for (let row = 0; row < MOST_PEOPLE; row++) {
      this.people.setColorAt(row, colour.setHSL((row * 0.381) % 1, 0.45, 0.72));
    }
    for (let row = 0; row < MOST_TRAILERS; row++)
      this.trailers.setColorAt(row, colour.set('#ffffff'));
  }

  update(frame: SnapshotFrame, lot: LotFrame | null): void {
    const people = this.people.instanceMatrix.array as Float32Array;
    const walkers = Math.min(frame.walkers.length, MOST_PEOPLE);
    for (let row = 0; row < walkers; row++) {
      const { x, y, radius } = frame.walkers[row]!;
      const wide = radius / PERSON_RADIUS;
      writeUpright(people, row, x, y, 0, 1, 0, wide, wide, 1);
    }
    this.people.count = walkers;
    this.people.instanceMatrix.needsUpdate = walkers > 0;
    this.placeTrailers(frame);
    if (lot !== this.round) this.build(lot);
  }

  dispose(): void {
    for (const mesh of [this.people, this.trailers, this.blocks]) {
      mesh?.geometry.dispose();
      mesh?.material.dispose();
    }
    this.people.dispose();
    this.trailers.dispose();
  }

  private placeTrailers(frame: SnapshotFrame): void {
    const places = this.trailers.instanceMatrix.array as Float32Array;
    const count = Math.min(frame.trailers.length, MOST_TRAILERS);
    for (let row = 0; row < count; row++) {
      const { x, y, heading, length, width, seat } = frame.trailers[row]!;
      const high = 0.55 * width + 0.12 * this.length;
      writeUpright(places, row, x, y, 0, Math.cos(heading), Math.sin(heading), length, width, high);
      if (this.drawn[row] === seat) continue;
      this.drawn[row] = seat;
      this.trailers.setColorAt(row, new Color(liveryOf(seat).colour));
      this.trailers.instanceColor!.needsUpdate = true;
    }
    this.trailers.count = count;
    this.trailers.instanceMatrix.needsUpdate = count > 0;
  }

  /** Builds what was drawn for a round: once, since it stands still. */
  private build(lot: LotFrame | null): void {
    this.round = lot;
    if (this.blocks) {
      this.group.remove(this.blocks);
      this.blocks.geometry.dispose();
      this.blocks.material.dispose();
      this.blocks = null;
    }
    if (!lot?.blocks.length) return;
    const facets = new Facets();
    for (const block of lot.blocks) {
      const isVehicle = block.kind === RayHit.KART;
      const high = isVehicle ? 0.3 * this.length : 0.25 * this.length;
      const [top, face] = isVehicle ? ['#9fb0c3', '#71839a'] : ['#d29a3a', '#a87424'];
      addBlock(
        facets,
        block,
        block.heading,
        [0.5 * block.length, 0.5 * block.width, high],
        top,
        face,
      );
    }
    this.blocks = new Mesh(facets.geometry(), new MeshLambertMaterial({ vertexColors: true }));
    this.blocks.castShadow = this.blocks.receiveShadow = true;
    this.group.add(this.blocks);
  }

  private part(
    geometry: BufferGeometry,
    most: number,
  ): InstancedMesh<BufferGeometry, MeshLambertMaterial> {
    const mesh = new InstancedMesh(geometry, new MeshLambertMaterial({ vertexColors: true }), most);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    mesh.count = 0;
    this.group.add(mesh);
    return mesh;
  }
}

/** Returns a person who stands at the origin. */
function personShape(): BufferGeometry {
  const facets = new Facets();
  const upright: [number, number, number] = [0.5 * Math.PI, 0, 0];
  const shoulder = PERSON_HEIGHT - 0.32;
  for (const side of [1, -1]) {
    facets.shape(
      new CapsuleGeometry(0.09, 0.62, 3, 7),
      placed([0, 0.1 * side, 0.4], upright),
      '#2f3742',
    );
    facets.shape(
      new CapsuleGeometry(0.06, 0.5, 3, 6),
      placed([0, 0.28 * side, 1.12], upright),
      '#d8dde2',
    );
  }
  facets.shape(
    new CapsuleGeometry(0.2, 0.32, 4, 9),
    placed([0, 0, shoulder - 0.24], upright),
    '#ffffff',
  );
  facets.shape(new SphereGeometry(0.14, 10, 8), placed([0, 0, PERSON_HEIGHT - 0.14]), '#d9a886');
  return facets.geometry();
}

/** Returns a trailer of length, width and height 1. */
function trailerShape(): BufferGeometry {
  const facets = new Facets();
  facets.frustum(
    { x: [-0.5, 0.5], half: 0.5, z: 0.16 },
    { x: [-0.5, 0.5], half: 0.5, z: 0.94 },
    '#ffffff',
  );
  facets.frustum(
    { x: [-0.5, 0.5], half: 0.5, z: 0.94 },
    { x: [-0.48, 0.48], half: 0.46, z: 1 },
    '#e4e8ec',
  );
  facets.box([-0.2, 0, 0.1], [0.24, 0.9, 0.2], '#1b1f25');
  facets.box([0.47, 0, 0.12], [0.06, 0.4, 0.08], '#1b1f25');
  return facets.geometry();
}
