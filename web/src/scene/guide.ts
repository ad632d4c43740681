// The ideal line on the road, with where to accelerate and where to brake.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, Mesh, MeshBasicMaterial } from 'three';

import { ZONE_COLOURS } from '../draw/surface';
import type { ReferenceLine, Zone } from '../race/line';
import { layered, LAYERS } from './ground';

// In lengths of a kart.
const WIDTH = 0.2;
const PIECE = 0.5;
const AHEAD = 32;
const CORNERS = 6; // of a piece

export class Guide {
  readonly mesh: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly stride: number; // samples of the line in a piece
  private readonly pieces: number;
  private readonly ahead: number; // pieces that a driver sees
  private near = -1;

  constructor(
    private readonly line: ReferenceLine,
    length: number,
  ) {
    this.stride = Math.max(Math.round((PIECE * length) / line.frame.spacing), 1);
    this.pieces = Math.floor(line.count / this.stride);
    this.ahead = Math.min(
      Math.ceil((AHEAD * length) / (this.stride * line.frame.spacing)),
      this.pieces,
    );
    const material = new MeshBasicMaterial({
      vertexColors: true,
      transparent: true,
      side: DoubleSide,
    });
    this.mesh = new Mesh(this.geometry(WIDTH * length), layered(material));
    this.mesh.renderOrder = LAYERS.line;
    this.mesh.frustumCulled = false;
  }

  showAll(): void {
    this.mesh.geometry.setDrawRange(0, CORNERS * this.pieces);
  }

  /** Shows what lies ahead of a place. */
  showAhead(x: number, y: number): void {
    this.near = this.line.nearest(x, y, this.near);
    const first = Math.floor(this.near / this.stride) % this.pieces;
    this.mesh.geometry.setDrawRange(CORNERS * first, CORNERS * this.ahead);
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  /** A lap, and once more its first pieces: a part that passes the timing line is one part, too. */
  private geometry(width: number): BufferGeometry {
    const all = this.pieces + this.ahead;
    const positions = new Float32Array(3 * CORNERS * all);
    const colours = new Float32Array(4 * CORNERS * all);
    const shades = shadesOfZones();
    for (let piece = 0; piece < all; piece++) {
      const from = ((piece % this.pieces) * this.stride) % this.line.count;
      const zone = this.line.zones[from]!;
      // Braking zones are bars with gaps, so that zones do not only differ in colour.
      const isGap = zone === 'brake' && piece % 2 === 1;
      const half = 0.5 * (zone === 'hold' ? 0.5 * width : zone === 'brake' ? 1.4 * width : width);
      this.writePiece(positions, piece, from, half);
      const [red, green, blue] = shades[zone];
      for (let corner = 0; corner < CORNERS; corner++) {
        colours.set([red, green, blue, isGap ? 0 : 0.82], 4 * (CORNERS * piece + corner));
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', new BufferAttribute(colours, 4));
    return geometry;
  }

  private writePiece(positions: Float32Array, piece: number, from: number, half: number): void {
    const { x, y } = this.line.frame;
    const { count } = this.line;
    const to = (from + this.stride) % count;
    const across = (at: number): [number, number] => {
      const [before, after] = [(at - 1 + count) % count, (at + 1) % count];
      const [dx, dy] = [x[after]! - x[before]!, y[after]! - y[before]!];
      const share = half / (Math.hypot(dx, dy) || 1);
      return [-dy * share, dx * share];
    };
    const [start, end] = [across(from), across(to)];
    const corners = [
      [x[from]! - start[0], y[from]! - start[1]],
      [x[to]! - end[0], y[to]! - end[1]],
      [x[to]! + end[0], y[to]! + end[1]],
      [x[from]! + start[0], y[from]! + start[1]],
    ] as const;
    [0, 1, 2, 0, 2, 3].forEach((corner, index) => {
      positions.set([...corners[corner]!, 0], 3 * (CORNERS * piece + index));
    });
  }
}

function shadesOfZones(): Record<Zone, readonly [number, number, number]> {
  const shade = (zone: Zone) => {
    const { r, g, b } = new Color(ZONE_COLOURS[zone]);
    return [r, g, b] as const;
  };
  return { accelerate: shade('accelerate'), hold: shade('hold'), brake: shade('brake') };
}
