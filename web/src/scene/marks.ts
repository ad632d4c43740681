// What is painted on the road: its edges, the timing line, the grid, slots, and the rubber that
// karts leave along the ideal line.

import { BufferAttribute, BufferGeometry, Group, Mesh, MeshLambertMaterial } from 'three';

import type { Course, Point } from '../race/course';
import type { ReferenceLine } from '../race/line';
import { layered, LAYERS } from './ground';
import { hasVerge } from './surroundings';

// In lengths of a kart.
const EDGE_WIDTH = 0.045;
const EDGE_STEP = 0.4;
const RUBBER_WIDTH = 1.1;
const RUBBER_STEP = 1;
const RUBBER_DARK = 0.3;
const CELLS = 12; // of the timing line, from side to side

type Shade = readonly [red: number, green: number, blue: number, opacity: number];
const PAINT: Shade = [0.82, 0.83, 0.84, 0.9];
const FAINT: Shade = [0.82, 0.83, 0.84, 0.5];
const CHEQUERS: readonly Shade[] = [
  [0.9, 0.9, 0.9, 1],
  [0.01, 0.01, 0.012, 1],
];

/** Triangles with a colour at each corner. */
class Paint {
  private readonly positions: number[] = [];
  private readonly colours: number[] = [];

  quad(corners: readonly [Point, Point, Point, Point], shades: readonly Shade[]): void {
    for (const at of [0, 1, 2, 0, 2, 3]) {
      const { x, y } = corners[at]!;
      this.positions.push(x, y, 0);
      this.colours.push(...shades[at % shades.length]!);
    }
  }

  /** Adds a rectangle in a frame: from and to, along and across [m]. */
  patch(
    at: Point,
    heading: number,
    along: [number, number],
    across: [number, number],
    shade: Shade,
  ): void {
    const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
    const corner = (ahead: number, left: number): Point => ({
      x: at.x + ahead * cos - left * sin,
      y: at.y + ahead * sin + left * cos,
    });
    this.quad(
      [
        corner(along[0], across[0]),
        corner(along[1], across[0]),
        corner(along[1], across[1]),
        corner(along[0], across[1]),
      ],
      [shade],
    );
  }

  mesh(order: number): Mesh<BufferGeometry, MeshLambertMaterial> {
    const geometry = new BufferGeometry();
    const positions = new Float32Array(this.positions);
    const normals = positions.map((_, index) => (index % 3 === 2 ? 1 : 0));
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('normal', new BufferAttribute(normals, 3));
    geometry.setAttribute('color', new BufferAttribute(new Float32Array(this.colours), 4));
    const material = layered(new MeshLambertMaterial({ vertexColors: true, transparent: true }));
    const mesh = new Mesh(geometry, material);
    mesh.renderOrder = order;
    mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    return mesh;
  }
}

export class Marks {
  readonly group = new Group();
  private readonly meshes: Mesh<BufferGeometry, MeshLambertMaterial>[] = [];

  /** places: of the grid that are drawn. */
  constructor(
    course: Course,
    line: ReferenceLine | null,
    places: number,
    length: number,
    width: number,
  ) {
    const paint = new Paint();
    if (course.isLot || course.frame.slots.length) paintSlots(paint, course, length);
    if (!course.isLot) {
      if (hasVerge(course)) paintEdges(paint, course, length);
      paintStart(paint, course);
      paintGrid(paint, course, places, length, width);
    }
    this.add(paint.mesh(LAYERS.marks));
    if (!line) return;
    const rubber = new Paint();
    paintRubber(rubber, line, RUBBER_WIDTH * Math.max(width, 0.5 * length), RUBBER_STEP * length);
    this.add(rubber.mesh(LAYERS.rubber));
  }

  dispose(): void {
    for (const { geometry, material } of this.meshes) {
      geometry.dispose();
      material.dispose();
    }
  }

  private add(mesh: Mesh<BufferGeometry, MeshLambertMaterial>): void {
    this.meshes.push(mesh);
    this.group.add(mesh);
  }
}

function paintEdges(paint: Paint, course: Course, length: number): void {
  const step = EDGE_STEP * length;
  const inset = -EDGE_WIDTH * length;
  for (const side of ['left', 'right'] as const) {
    const [outer, inner] = [course.edgeLine(side, 0, step), course.edgeLine(side, inset, step)];
    outer.forEach((start, index) => {
      const next = (index + 1) % outer.length;
      const band = [inner[index]!, inner[next]!, outer[next]!, start] as const;
      paint.quad(side === 'left' ? band : [band[3], band[2], band[1], band[0]], [PAINT]);
    });
  }
}

/** Two rows of chequers across the road. */
function paintStart(paint: Paint, course: Course): void {
  const [left, right] = [course.edge(0, 'left'), course.edge(0, 'right')];
  const size = Math.hypot(left.x - right.x, left.y - right.y) / CELLS;
  const heading = course.heading(0);
  for (let row = 0; row < 2; row++) {
    for (let cell = 0; cell < CELLS; cell++) {
      const along: [number, number] = [(row - 1) * size, row * size];
      paint.patch(
        right,
        heading,
        along,
        [cell * size, (cell + 1) * size],
        CHEQUERS[(row + cell) % 2]!,
      );
    }
  }
}

/** A bracket before each place of the grid. */
function paintGrid(
  paint: Paint,
  course: Course,
  places: number,
  length: number,
  width: number,
): void {
  const { grid } = course.frame;
  const thick = 0.04 * length;
  for (let i = 0; i + 2 < Math.min(grid.length, 3 * places); i += 3) {
    const at = { x: grid[i]!, y: grid[i + 1]! };
    const [nose, side] = [0.62 * length, 0.75 * width];
    paint.patch(at, grid[i + 2]!, [nose - thick, nose], [-side, side], PAINT);
    for (const edge of [-side, side - thick]) {
      paint.patch(at, grid[i + 2]!, [0.3 * length, nose], [edge, edge + thick], PAINT);
    }
  }
}

function paintSlots(paint: Paint, course: Course, length: number): void {
  const thick = 0.03 * length;
  for (const slot of course.frame.slots) {
    const [end, side] = [0.5 * slot.length, 0.5 * slot.width];
    for (const edge of [-side, side - thick]) {
      paint.patch(slot, slot.heading, [-end, end], [edge, edge + thick], FAINT);
    }
    paint.patch(slot, slot.heading, [-end, -end + thick], [-side, side], FAINT);
  }
}

/** A dark band, faded at its sides. */
function paintRubber(paint: Paint, line: ReferenceLine, width: number, step: number): void {
  const { x, y } = line.frame;
  const [clear, dark]: Shade[] = [
    [0.01, 0.01, 0.012, 0],
    [0.01, 0.01, 0.012, RUBBER_DARK],
  ] as Shade[];
  const beside = (at: number, offset: number): Point => {
    const [before, after] = [(at - 1 + line.count) % line.count, (at + 1) % line.count];
    const [dx, dy] = [x[after]! - x[before]!, y[after]! - y[before]!];
    const share = offset / (Math.hypot(dx, dy) || 1);
    return { x: x[at]! - share * dy, y: y[at]! + share * dx };
  };
  const stride = Math.max(Math.round(step / line.frame.spacing), 1);
  for (let at = 0; at < line.count; at += stride) {
    const next = at + stride < line.count ? at + stride : 0;
    const corners = [
      beside(at, 0),
      beside(next, 0),
      beside(next, width),
      beside(at, width),
    ] as const;
    paint.quad(corners, [dark!, dark!, clear!, clear!]);
    const others = [
      beside(at, -width),
      beside(next, -width),
      beside(next, 0),
      beside(at, 0),
    ] as const;
    paint.quad(others, [clear!, clear!, dark!, dark!]);
  }
}
