// Borders of the course, and what stands fixed on it.

import { type BufferGeometry, Mesh, MeshLambertMaterial } from 'three';

import { wallsOf, type Wall } from '../draw/walls';
import type { Course, Point } from '../race/course';
import { Facets } from './facets';
import { leftOf, nearestSample } from './outline';
import { coloursOf } from './surroundings';

// In lengths of a kart.
const HEIGHT = 0.34;
const THICK = 0.16;
const PIECE = 1.4;
const OBSTACLE_HEIGHT = 0.34;
const [CAP_LIGHT, CRATE, CRATE_DARK] = [0.2, '#d29a3a', '#a87424'];
// Joints that turn further than this are not mitred: the pieces just overlap.
const LEAST_COSINE = 0.35;

export class Barriers {
  readonly mesh: Mesh<BufferGeometry, MeshLambertMaterial>;

  constructor(course: Course, length: number) {
    const facets = new Facets();
    addWalls(facets, course, length);
    addObstacles(facets, course, length);
    this.mesh = new Mesh(facets.geometry(), new MeshLambertMaterial({ vertexColors: true }));
    this.mesh.castShadow = this.mesh.receiveShadow = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

function addWalls(facets: Facets, course: Course, length: number): void {
  const walls = wallsOf(course, PIECE * length);
  const [high, thick] = [HEIGHT * length, THICK * length];
  const colours = coloursOf(course);
  walls.forEach((wall, index) => {
    const isLeft = course.isLot || isLeftOf(course, wall);
    // Seen along the wall its road lies on one side; the wall stands on the other.
    const way = outwardOf(course, wall) * thick;
    const [start, end] = [
      shifted(wall, neighbour(walls, index, -1), wall.from, way),
      shifted(wall, neighbour(walls, index, 1), wall.to, way),
    ];
    const colour = colours.wall[isLeft ? 'left' : 'right'][wall.shade]!;
    addPiece(facets, [wall.from, wall.to, end, start], high, colour, way > 0);
  });
}

function addPiece(
  facets: Facets,
  foot: readonly Point[],
  high: number,
  colour: string,
  isLeft: boolean,
): void {
  const ring = isLeft ? foot : [foot[1]!, foot[0]!, foot[3]!, foot[2]!];
  const [low, top] = [0, high].map((z) => ring.map(({ x, y }) => [x, y, z] as const));
  for (let i = 0; i < 4; i++) {
    const next = (i + 1) % 4;
    // Ends are hidden by the next piece, where it is not another colour's turn to begin.
    if (i % 2 === 0) facets.quad(low![i]!, low![next]!, top![next]!, top![i]!, colour);
  }
  facets.quad(top![0]!, top![1]!, top![2]!, top![3]!, lighter(colour));
}

function lighter(colour: string): string {
  const value = parseInt(colour.slice(1), 16);
  const mixed = [16, 8, 0].map((bits) => {
    const part = (value >> bits) & 255;
    return Math.round(part + (255 - part) * CAP_LIGHT);
  });
  return `rgb(${mixed.join(',')})`;
}

function isLeftOf(course: Course, wall: Wall): boolean {
  const sample = nearestSample(course, wall.from);
  return leftOf(course, sample, wall.from) > 0;
}

/** Returns 1 where the wall stands to the left of its own direction, -1 to the right. */
function outwardOf(course: Course, { from, to }: Wall): 1 | -1 {
  if (course.isLot) return -1;
  const sample = nearestSample(course, from);
  const [east, north] = [course.x(sample) - from.x, course.y(sample) - from.y];
  const isRoadLeft = (to.x - from.x) * north - (to.y - from.y) * east > 0;
  return isRoadLeft ? -1 : 1;
}

/** Returns the wall before or after one in the same loop, or itself. */
function neighbour(walls: readonly Wall[], index: number, step: 1 | -1): Wall {
  const wall = walls[index]!;
  const other = walls[index + step];
  if (!other) return wall;
  const [one, two] = step > 0 ? [wall.to, other.from] : [wall.from, other.to];
  return Math.hypot(one.x - two.x, one.y - two.y) < 1e-6 ? other : wall;
}

/** Returns a joint of two walls, shifted to the left of both [m]. */
function shifted(wall: Wall, other: Wall, joint: Point, left: number): Point {
  const [one, two] = [normalOf(wall), normalOf(other)];
  const [x, y] = [one.x + two.x, one.y + two.y];
  const square = Math.max(0.5 * (x * x + y * y), 2 * LEAST_COSINE);
  return { x: joint.x + (left * x) / square, y: joint.y + (left * y) / square };
}

function normalOf({ from, to }: Wall): Point {
  const length = Math.hypot(to.x - from.x, to.y - from.y) || 1;
  return { x: -(to.y - from.y) / length, y: (to.x - from.x) / length };
}

function addObstacles(facets: Facets, course: Course, length: number): void {
  const all = course.frame.obstacles;
  const high = OBSTACLE_HEIGHT * length;
  for (let i = 0; i + 4 < all.length; i += 5) {
    const [x, y, heading] = [all[i]!, all[i + 1]!, all[i + 2]!];
    const [half, side] = [0.5 * all[i + 3]!, 0.5 * all[i + 4]!];
    addBlock(facets, { x, y }, heading, [half, side, high], CRATE, CRATE_DARK);
  }
}

/** Adds an upright block to the ground. half: of its length and width, and its height [m]. */
export function addBlock(
  facets: Facets,
  { x, y }: Point,
  heading: number,
  [half, side, high]: readonly [number, number, number],
  top: string,
  face: string,
): void {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  const corner = (along: number, across: number, z: number) =>
    [x + along * cos - across * sin, y + along * sin + across * cos, z] as const;
  const ring = [
    [-half, -side],
    [half, -side],
    [half, side],
    [-half, side],
  ] as const;
  const [low, up] = [0, high].map((z) => ring.map(([along, across]) => corner(along, across, z)));
  facets.quad(up![0]!, up![1]!, up![2]!, up![3]!, top);
  for (let i = 0; i < 4; i++) {
    const next = (i + 1) % 4;
    facets.quad(low![i]!, low![next]!, up![next]!, up![i]!, face);
  }
}
