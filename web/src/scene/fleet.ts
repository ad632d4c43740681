// All karts: a few instanced meshes, whatever their number.

import {
  type BufferGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  InstancedBufferAttribute,
  InstancedMesh,
  type Material,
  MeshStandardMaterial,
} from 'three';

import { opacityOf } from '../draw/karts';
import { liveryOf } from '../draw/palette';
import type { KartBody } from '../race/race.svelte';
import type { KartFrame, SnapshotFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import { hide, writeUpright, writeWheel } from './placing';
import { MOST_KARTS, Plates } from './plates';
import { addPresence, screened } from './screen';
import { helmShape, type Model, modelFor, wheelShape } from './vehicles';

const WHEELS = 4;
// A steering wheel turns about this many times as far as the road wheels.
const HELM_RATIO = 2.2;
const [HELM_AHEAD, HELM_HEIGHT] = [0.24, 0.56]; // [m] on the model of a kart
const HELM_LEAN = 0.95;

export class Fleet {
  readonly group = new Group();
  readonly model: Model;
  private readonly paint: InstancedMesh;
  private readonly trim: InstancedMesh;
  private readonly rider: InstancedMesh;
  private readonly wheels: InstancedMesh;
  private readonly helms: InstancedMesh | null;
  private readonly plates: Plates;
  private readonly presences: Float32Array[] = [];
  private readonly seats = new Int16Array(MOST_KARTS).fill(-1);
  private readonly colour = new Color();
  private readonly along: number; // scale from the model to the vehicle
  private readonly across: number;

  constructor(private readonly body: KartBody) {
    this.model = modelFor(body);
    this.along = body.length / this.model.length;
    this.across = body.width / this.model.width;
    const gloss = { vertexColors: true, roughness: 0.42, metalness: 0.05 };
    const matt = { vertexColors: true, roughness: 0.85, metalness: 0.1 };
    this.paint = this.part(this.model.paint, gloss, MOST_KARTS, true);
    this.rider = this.part(this.model.rider, { ...gloss, roughness: 0.5 }, MOST_KARTS, true);
    this.trim = this.part(this.model.trim, matt, MOST_KARTS, false);
    this.trim.instanceMatrix = this.paint.instanceMatrix;
    this.wheels = this.part(wheelShape(), matt, WHEELS * MOST_KARTS, false);
    const isKart = this.model.width / this.model.length > 0.55;
    this.helms = isKart ? this.part(helmShape(), matt, MOST_KARTS, false) : null;
    this.plates = new Plates(this.model);
    this.plates.mesh.instanceMatrix = this.paint.instanceMatrix;
    this.plates.mesh.frustumCulled = false;
    this.group.add(this.plates.mesh);
  }

  /** Places all karts. within: seat whose driver is not drawn, -1 for none. */
  update(frame: SnapshotFrame, within: number): void {
    const count = Math.min(frame.karts.length, MOST_KARTS);
    for (let row = 0; row < count; row++) this.place(row, frame.karts[row]!, within);
    for (const mesh of [this.paint, this.trim, this.rider, this.plates.mesh]) mesh.count = count;
    if (this.helms) this.helms.count = count;
    this.wheels.count = WHEELS * count;
    this.commit();
  }

  /** Leaves out karts for which `isDrawn` is false, after an update. */
  keepOnly(frame: SnapshotFrame, isDrawn: (kart: KartFrame) => boolean): void {
    frame.karts.forEach((kart, row) => {
      if (row < MOST_KARTS && !isDrawn(kart)) this.remove(row);
    });
  }

  dispose(): void {
    this.plates.dispose();
    for (const mesh of [this.paint, this.trim, this.rider, this.wheels, this.helms]) {
      mesh?.geometry.dispose();
      (mesh?.material as Material | undefined)?.dispose();
      mesh?.dispose();
    }
  }

  private place(row: number, kart: KartFrame, within: number): void {
    if (kart.status === Status.ABSENT) return this.remove(row);
    this.dress(row, kart);
    const { along, across, body } = this;
    const [cos, sin] = [Math.cos(kart.heading), Math.sin(kart.heading)];
    const [x, y] = [kart.x + body.ahead * cos, kart.y + body.ahead * sin];
    const places = this.paint.instanceMatrix.array as Float32Array;
    writeUpright(places, row, x, y, 0, cos, sin, along, across, along);
    if (kart.seat === within) hide(places16(this.rider), row);
    else writeUpright(places16(this.rider), row, x, y, 0, cos, sin, along, across, along);
    this.placeWheels(row, kart, x, y, cos, sin);
    if (this.helms) this.placeHelm(row, kart, x, y, cos, sin);
  }

  private placeWheels(
    row: number,
    kart: KartFrame,
    x: number,
    y: number,
    cos: number,
    sin: number,
  ): void {
    const { along, across } = this;
    const { wheels } = this.model;
    // By the way that was driven, not by time: the same moment always gives the same picture.
    const way = kart.progress / along;
    for (let each = 0; each < WHEELS; each++) {
      const wheel = wheels[each]!;
      const [ahead, left] = [wheel.x * along, wheel.y * across];
      writeWheel(
        places16(this.wheels),
        WHEELS * row + each,
        x + ahead * cos - left * sin,
        y + ahead * sin + left * cos,
        wheel.radius * along,
        kart.heading + (wheel.steers ? kart.steering : 0),
        (way / wheel.radius) % (2 * Math.PI),
        wheel.width * across,
      );
    }
  }

  /** A steering wheel leans back, and turns about its own axle. */
  private placeHelm(
    row: number,
    kart: KartFrame,
    x: number,
    y: number,
    cos: number,
    sin: number,
  ): void {
    const { along } = this;
    const [leanCos, leanSin] = [along * Math.cos(HELM_LEAN), along * Math.sin(HELM_LEAN)];
    const turn = kart.steering * HELM_RATIO;
    const [turnCos, turnSin] = [Math.cos(turn), Math.sin(turn)];
    // Columns of the lean alone, in the frame of the body: axle, left, up.
    const axle = [leanCos * cos, leanCos * sin, -leanSin] as const;
    const left = [-along * sin, along * cos, 0] as const;
    const up = [leanSin * cos, leanSin * sin, leanCos] as const;
    const to = places16(this.helms!);
    const at = 16 * row;
    for (let axis = 0; axis < 3; axis++) {
      to[at + axis] = axle[axis]!;
      to[at + 4 + axis] = turnCos * left[axis]! + turnSin * up[axis]!;
      to[at + 8 + axis] = turnCos * up[axis]! - turnSin * left[axis]!;
      to[at + 3 + 4 * axis] = 0;
    }
    to[at + 12] = x + HELM_AHEAD * along * cos;
    to[at + 13] = y + HELM_AHEAD * along * sin;
    to[at + 14] = HELM_HEIGHT * along;
    to[at + 15] = 1;
  }

  private dress(row: number, kart: KartFrame): void {
    const presence = opacityOf(kart) < 1 ? 0 : 1;
    if (this.presences[0]![row] !== presence) this.setPresence(row, presence);
    if (this.seats[row] === kart.seat) return;
    this.seats[row] = kart.seat;
    this.colour.set(liveryOf(kart.seat).colour);
    for (const mesh of [this.paint, this.rider]) {
      mesh.setColorAt(row, this.colour);
      mesh.instanceColor!.needsUpdate = true;
    }
    this.plates.show(row, kart.seat);
  }

  private setPresence(row: number, presence: number): void {
    for (const values of this.presences) {
      const per = values.length / MOST_KARTS;
      values.fill(presence, per * row, per * row + per);
    }
    for (const mesh of [this.paint, this.trim, this.rider, this.wheels, this.helms]) {
      if (mesh) mesh.geometry.attributes.presence!.needsUpdate = true;
    }
  }

  private remove(row: number): void {
    for (const mesh of [this.paint, this.rider]) hide(places16(mesh), row);
    for (let each = 0; each < WHEELS; each++) hide(places16(this.wheels), WHEELS * row + each);
    if (this.helms) hide(places16(this.helms), row);
  }

  private commit(): void {
    for (const mesh of [this.paint, this.rider, this.wheels]) {
      mesh.instanceMatrix.needsUpdate = true;
    }
    if (this.helms) this.helms.instanceMatrix.needsUpdate = true;
  }

  private part(
    geometry: BufferGeometry,
    look: ConstructorParameters<typeof MeshStandardMaterial>[0],
    most: number,
    isColoured: boolean,
  ): InstancedMesh {
    this.presences.push(addPresence(geometry, most).fill(1));
    const mesh = new InstancedMesh(geometry, screened(new MeshStandardMaterial(look)), most);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    if (isColoured)
      mesh.instanceColor = new InstancedBufferAttribute(new Float32Array(3 * most), 3);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false; // its extent changes with every picture
    mesh.count = 0;
    this.group.add(mesh);
    return mesh;
  }
}

function places16(mesh: InstancedMesh): Float32Array {
  return mesh.instanceMatrix.array as Float32Array;
}
