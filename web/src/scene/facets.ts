// Coloured surfaces, gathered into one geometry that is drawn in one call.

import { BufferGeometry, Color, Float32BufferAttribute, Matrix4, Vector3 } from 'three';

export type Spot = readonly [x: number, y: number, z: number];

/** A rectangle that lies flat at a height. */
export interface Plate {
  x: readonly [from: number, to: number];
  half: number; // of its width; its middle is at y
  y?: number;
  z: number;
}

export class Facets {
  private readonly positions: number[] = [];
  private readonly normals: number[] = [];
  private readonly colours: number[] = [];
  private readonly colour = new Color();

  get triangles(): number {
    return this.positions.length / 9;
  }

  /** Adds a triangle; its front is where its corners go counter-clockwise. */
  triangle(a: Spot, b: Spot, c: Spot, colour: string): void {
    const [ux, uy, uz] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    const [vx, vy, vz] = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
    const normal = new Vector3(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx).normalize();
    this.colour.set(colour);
    for (const [x, y, z] of [a, b, c]) {
      this.positions.push(x, y, z);
      this.normals.push(normal.x, normal.y, normal.z);
      this.colours.push(this.colour.r, this.colour.g, this.colour.b);
    }
  }

  quad(a: Spot, b: Spot, c: Spot, d: Spot, colour: string): void {
    this.triangle(a, b, c, colour);
    this.triangle(a, c, d, colour);
  }

  /** Adds a body between two plates, the lower one first. */
  frustum(low: Plate, high: Plate, colour: string): void {
    const [foot, head] = [cornersOf(low), cornersOf(high)];
    this.quad(head[0]!, head[1]!, head[2]!, head[3]!, colour);
    this.quad(foot[3]!, foot[2]!, foot[1]!, foot[0]!, colour);
    for (let i = 0; i < 4; i++) {
      const next = (i + 1) % 4;
      this.quad(foot[i]!, foot[next]!, head[next]!, head[i]!, colour);
    }
  }

  /** Adds an upright box. size: along x, y, z. */
  box(middle: Spot, size: Spot, colour: string): void {
    const [x, y, z] = middle;
    const plate = (up: number): Plate => ({
      x: [x - 0.5 * size[0], x + 0.5 * size[0]],
      y,
      half: 0.5 * size[1],
      z: up,
    });
    this.frustum(plate(z - 0.5 * size[2]), plate(z + 0.5 * size[2]), colour);
  }

  /** Adds a geometry with its own normals, moved by a matrix. */
  shape(geometry: BufferGeometry, place: Matrix4, colour: string): void {
    const moved = (geometry.index ? geometry.toNonIndexed() : geometry.clone()).applyMatrix4(place);
    const { position, normal } = moved.attributes;
    this.colour.set(colour);
    for (let i = 0; i < position!.count; i++) {
      this.positions.push(position!.getX(i), position!.getY(i), position!.getZ(i));
      this.normals.push(normal!.getX(i), normal!.getY(i), normal!.getZ(i));
      this.colours.push(this.colour.r, this.colour.g, this.colour.b);
    }
    geometry.dispose();
    moved.dispose();
  }

  geometry(): BufferGeometry {
    const made = new BufferGeometry();
    made.setAttribute('position', new Float32BufferAttribute(this.positions, 3));
    made.setAttribute('normal', new Float32BufferAttribute(this.normals, 3));
    made.setAttribute('color', new Float32BufferAttribute(this.colours, 3));
    return made;
  }
}

/** Returns the corners of a plate counter-clockwise, seen from above. */
function cornersOf({ x, y = 0, half, z }: Plate): Spot[] {
  return [
    [x[0], y - half, z],
    [x[1], y - half, z],
    [x[1], y + half, z],
    [x[0], y + half, z],
  ];
}

/** Returns the matrix of a place and three turns [rad], in the order x, y, z. */
export function placed(at: Spot, turns: Spot = [0, 0, 0]): Matrix4 {
  const [x, y, z] = turns;
  return new Matrix4()
    .makeRotationZ(z)
    .multiply(new Matrix4().makeRotationY(y))
    .multiply(new Matrix4().makeRotationX(x))
    .setPosition(...at);
}
