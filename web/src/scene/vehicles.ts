// Bodies of vehicles. Each is modelled in metres at the size that stands here, and scaled to the
// vehicle of the race: x ahead, y left, z up, the middle of the body on the ground.

import {
  BufferGeometry,
  CircleGeometry,
  CylinderGeometry,
  SphereGeometry,
  TorusGeometry,
} from 'three';

import type { KartBody } from '../race/race.svelte';
import { Facets, placed, type Spot } from './facets';

export interface Wheel {
  x: number; // [m]
  y: number;
  radius: number;
  width: number;
  steers: boolean;
}

/** Where a number stands: its middle, the way that it faces and its size [m]. */
export interface NumberPlate {
  at: Spot;
  turn: number; // about z [rad]; 0 faces ahead
  lean: number; // backwards, from upright [rad]
  size: number;
}

export interface Model {
  length: number; // [m]
  width: number;
  paint: BufferGeometry; // takes the colour of the seat
  trim: BufferGeometry; // keeps its own colours
  rider: BufferGeometry; // takes the colour of the seat; not drawn for whom it is the own head
  wheels: readonly Wheel[];
  plates: readonly NumberPlate[];
  eye: Spot; // of the camera that shows what the driver sees
  head: Spot; // of the driver
}

// Relative width from which a vehicle is a kart: cars and their models are slimmer.
const KART_SHAPE = 0.55;
const UPRIGHT = 0.5 * Math.PI;
const [DARK, TYRE, STEEL, SUIT] = ['#1b1f25', '#15171a', '#8b939c', '#454b55'];

/** Returns the model for vehicles of a race. */
export function modelFor({ length, width }: KartBody): Model {
  return width / length >= KART_SHAPE ? kartModel() : carModel();
}

function kartModel(): Model {
  return {
    length: 2.0,
    width: 1.36,
    paint: kartPaint(),
    trim: kartTrim(),
    rider: kartRider(),
    wheels: [
      { x: 0.6, y: 0.53, radius: 0.135, width: 0.15, steers: true },
      { x: 0.6, y: -0.53, radius: 0.135, width: 0.15, steers: true },
      { x: -0.55, y: 0.56, radius: 0.145, width: 0.22, steers: false },
      { x: -0.55, y: -0.56, radius: 0.145, width: 0.22, steers: false },
    ],
    plates: [
      { at: [0.5, 0, 0.42], turn: 0, lean: 0.75, size: 0.27 },
      { at: [0.02, 0.645, 0.19], turn: UPRIGHT, lean: 0.1, size: 0.19 },
      { at: [0.02, -0.645, 0.19], turn: -UPRIGHT, lean: 0.1, size: 0.19 },
      { at: [-0.985, 0, 0.27], turn: Math.PI, lean: 0.05, size: 0.24 },
    ],
    eye: [-0.62, 0, 0.92],
    head: [-0.2, 0, 0.98],
  };
}

function kartPaint(): BufferGeometry {
  const paint = new Facets();
  const white = '#ffffff';
  // Nose: a broad low spoiler that rises to the front panel.
  paint.frustum(
    { x: [0.7, 1.0], half: 0.5, z: 0.06 },
    { x: [0.66, 0.93], half: 0.42, z: 0.21 },
    white,
  );
  for (const side of [1, -1]) {
    paint.frustum(
      { x: [0.78, 0.94], half: 0.1, y: side * 0.55, z: 0.06 },
      { x: [0.76, 0.9], half: 0.08, y: side * 0.52, z: 0.2 },
      white,
    );
    // Side pods.
    paint.frustum(
      { x: [-0.36, 0.4], half: 0.14, y: side * 0.5, z: 0.07 },
      { x: [-0.3, 0.32], half: 0.11, y: side * 0.52, z: 0.28 },
      white,
    );
  }
  // Front panel, leaning back.
  paint.frustum(
    { x: [0.6, 0.72], half: 0.2, z: 0.2 },
    { x: [0.36, 0.41], half: 0.15, z: 0.58 },
    white,
  );
  // Rear bumper.
  paint.frustum(
    { x: [-0.98, -0.86], half: 0.56, z: 0.13 },
    { x: [-0.97, -0.88], half: 0.52, z: 0.34 },
    white,
  );
  return paint.geometry();
}

function kartTrim(): BufferGeometry {
  const trim = new Facets();
  trim.box([-0.05, 0, 0.07], [1.5, 0.62, 0.04], DARK);
  trim.box([0.6, 0, 0.135], [0.06, 0.96, 0.05], STEEL);
  trim.box([-0.55, 0, 0.145], [0.06, 1.0, 0.05], STEEL);
  trim.box([-0.93, 0, 0.1], [0.08, 0.9, 0.05], STEEL);
  // Seat: a shell that is open to the front.
  trim.frustum(
    { x: [-0.42, 0.06], half: 0.2, z: 0.08 },
    { x: [-0.46, 0.0], half: 0.22, z: 0.18 },
    '#2b3038',
  );
  trim.frustum(
    { x: [-0.52, -0.38], half: 0.22, z: 0.12 },
    { x: [-0.62, -0.54], half: 0.19, z: 0.66 },
    '#2b3038',
  );
  // Engine, its cylinder head, the exhaust and the tank.
  trim.box([-0.3, -0.36, 0.24], [0.34, 0.18, 0.26], '#5d656e');
  trim.box([-0.28, -0.36, 0.42], [0.16, 0.14, 0.12], STEEL);
  trim.shape(
    new CylinderGeometry(0.05, 0.05, 0.5, 8),
    placed([-0.66, -0.36, 0.3], [0, 0, UPRIGHT]),
    STEEL,
  );
  trim.box([0.2, 0, 0.18], [0.24, 0.22, 0.16], '#c9ced4');
  // Steering column.
  trim.shape(
    new CylinderGeometry(0.018, 0.018, 0.42, 6),
    placed([0.42, 0, 0.4], [UPRIGHT, -0.95, 0]),
    DARK,
  );
  return trim.geometry();
}

function kartRider(): BufferGeometry {
  const rider = new Facets();
  const white = '#ffffff';
  // Legs, trunk and arms, in a suit that is tinted by the colour of the seat.
  for (const side of [1, -1]) {
    rider.frustum(
      { x: [-0.3, 0.1], half: 0.08, y: side * 0.12, z: 0.18 },
      { x: [-0.2, 0.12], half: 0.07, y: side * 0.13, z: 0.38 },
      SUIT,
    );
    rider.box([0.3, side * 0.15, 0.28], [0.42, 0.12, 0.13], SUIT);
    rider.box([0.5, side * 0.17, 0.2], [0.1, 0.1, 0.2], DARK);
    rider.shape(
      new CylinderGeometry(0.055, 0.065, 0.52, 7),
      placed([-0.04, side * 0.21, 0.6], [UPRIGHT, -1.16, 0]),
      SUIT,
    );
    rider.shape(new SphereGeometry(0.06, 7, 5), placed([0.2, side * 0.17, 0.5]), DARK);
  }
  rider.frustum(
    { x: [-0.42, -0.16], half: 0.19, z: 0.2 },
    { x: [-0.42, -0.2], half: 0.25, z: 0.72 },
    '#aab0b8',
  );
  rider.frustum(
    { x: [-0.42, -0.2], half: 0.25, z: 0.72 },
    { x: [-0.37, -0.24], half: 0.1, z: 0.82 },
    '#aab0b8',
  );
  // Helmet with its visor.
  rider.shape(new SphereGeometry(0.165, 14, 10), placed([-0.27, 0, 0.96]), white);
  rider.shape(
    new SphereGeometry(0.169, 12, 4, Math.PI - 1, 2, 1.2, 0.5),
    placed([-0.27, 0, 0.96], [UPRIGHT, 0, 0]),
    '#10141a',
  );
  return rider.geometry();
}

function carModel(): Model {
  return {
    length: 4.4,
    width: 1.86,
    paint: carPaint(),
    trim: carTrim(),
    rider: carCabin(),
    wheels: [1, -1].flatMap((side) => [
      { x: 1.36, y: side * 0.78, radius: 0.34, width: 0.26, steers: true },
      { x: -1.3, y: side * 0.78, radius: 0.34, width: 0.28, steers: false },
    ]),
    plates: [
      { at: [1.55, 0, 0.87], turn: 0, lean: 1.35, size: 0.66 },
      { at: [-0.2, 0.945, 0.56], turn: UPRIGHT, lean: 0, size: 0.54 },
      { at: [-0.2, -0.945, 0.56], turn: -UPRIGHT, lean: 0, size: 0.54 },
      { at: [-2.215, 0, 0.72], turn: Math.PI, lean: 0.05, size: 0.42 },
    ],
    eye: [-1.5, 0, 1.75],
    head: [0.1, 0.38, 1.15],
  };
}

function carPaint(): BufferGeometry {
  const paint = new Facets();
  const white = '#ffffff';
  // Sills between the wheels, bonnet, tail; the wheel arches stay open.
  paint.frustum(
    { x: [-0.9, 0.95], half: 0.93, z: 0.16 },
    { x: [-0.92, 0.98], half: 0.91, z: 0.8 },
    white,
  );
  paint.frustum(
    { x: [0.9, 2.2], half: 0.62, z: 0.16 },
    { x: [0.9, 2.1], half: 0.62, z: 0.6 },
    white,
  );
  paint.frustum(
    { x: [0.9, 2.14], half: 0.9, z: 0.66 },
    { x: [0.8, 2.0], half: 0.8, z: 0.84 },
    white,
  );
  paint.frustum(
    { x: [1.76, 2.2], half: 0.9, z: 0.16 },
    { x: [1.74, 2.14], half: 0.9, z: 0.68 },
    white,
  );
  paint.frustum(
    { x: [-2.2, -0.85], half: 0.62, z: 0.2 },
    { x: [-2.2, -0.85], half: 0.62, z: 0.66 },
    white,
  );
  paint.frustum(
    { x: [-2.2, -0.85], half: 0.91, z: 0.7 },
    { x: [-2.14, -0.85], half: 0.82, z: 0.92 },
    white,
  );
  paint.frustum(
    { x: [-2.2, -1.72], half: 0.91, z: 0.2 },
    { x: [-2.2, -1.72], half: 0.91, z: 0.72 },
    white,
  );
  // Wing.
  paint.box([-2.05, 0, 1.2], [0.34, 1.6, 0.04], white);
  return paint.geometry();
}

function carTrim(): BufferGeometry {
  const trim = new Facets();
  trim.box([0, 0, 0.2], [4.1, 1.2, 0.14], DARK);
  trim.box([2.16, 0, 0.15], [0.16, 1.7, 0.06], DARK);
  trim.box([-2.2, 0, 0.3], [0.04, 1.4, 0.2], DARK);
  for (const side of [1, -1]) {
    trim.box([2.13, side * 0.68, 0.6], [0.1, 0.3, 0.12], '#f5f7da');
    trim.box([-2.19, side * 0.7, 0.62], [0.05, 0.3, 0.12], '#d9342b');
    trim.box([-2.05, side * 0.5, 1.05], [0.1, 0.05, 0.28], DARK);
  }
  return trim.geometry();
}

function carCabin(): BufferGeometry {
  const cabin = new Facets();
  cabin.frustum(
    { x: [-1.3, 1.0], half: 0.82, z: 0.8 },
    { x: [-0.72, 0.28], half: 0.62, z: 1.3 },
    '#2a323c',
  );
  cabin.frustum(
    { x: [-0.76, 0.32], half: 0.63, z: 1.29 },
    { x: [-0.7, 0.26], half: 0.58, z: 1.36 },
    '#ffffff',
  );
  for (const side of [1, -1]) cabin.box([0.5, side * 0.9, 0.9], [0.14, 0.14, 0.1], '#ffffff');
  return cabin.geometry();
}

/** Returns a wheel of radius and width 1, its axle along y. */
export function wheelShape(): BufferGeometry {
  const wheel = new Facets();
  wheel.shape(new CylinderGeometry(1, 1, 1, 18, 1), placed([0, 0, 0]), TYRE);
  for (const side of [1, -1]) {
    const lean: Spot = [-side * UPRIGHT, 0, 0];
    wheel.shape(new CircleGeometry(0.58, 14), placed([0, side * 0.505, 0], lean), '#b9c0c8');
    for (let spoke = 0; spoke < 5; spoke++) {
      const angle = (2 * Math.PI * spoke) / 5;
      const at: Spot = [0.34 * Math.cos(angle), side * 0.515, 0.34 * Math.sin(angle)];
      wheel.shape(new CircleGeometry(0.13, 6), placed(at, lean), '#2c3138');
    }
  }
  return wheel.geometry();
}

/** Returns a steering wheel of a kart as it is held straight: its axle along x. */
export function helmShape(): BufferGeometry {
  const helm = new Facets();
  helm.shape(new TorusGeometry(0.15, 0.02, 6, 20), placed([0, 0, 0], [0, UPRIGHT, 0]), '#22262c');
  helm.box([0, 0, 0], [0.02, 0.28, 0.05], STEEL);
  helm.box([0.01, 0, -0.07], [0.02, 0.05, 0.14], STEEL);
  helm.box([-0.02, 0, 0.148], [0.02, 0.04, 0.03], '#e8c53a');
  return helm.geometry();
}
