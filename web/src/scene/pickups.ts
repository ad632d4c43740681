// Item boxes that float above the road, and puddles on it.

import {
  BoxGeometry,
  BufferGeometry,
  CanvasTexture,
  CircleGeometry,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  type Material,
  MeshBasicMaterial,
  MeshStandardMaterial,
  SRGBColorSpace,
} from 'three';

import type { Course } from '../race/course';
import type { SnapshotFrame } from '../wire/frames';
import { layered, LAYERS } from './ground';
import { hide, writeUpright } from './placing';

// In lengths of a kart.
const SIZE = 0.3;
const HOVER = 0.3;
const BOB = 0.05;
const SPIN = 1.4; // [rad/s]
const MOST_PUDDLES = 64;
const RIM = 1.08; // of a puddle, relative to it

export class Pickups {
  readonly group = new Group();
  private readonly boxes: InstancedMesh;
  private readonly shades: InstancedMesh; // on the ground below the boxes
  private readonly puddles: InstancedMesh;
  private readonly rims: InstancedMesh;

  constructor(
    private readonly course: Course,
    private readonly length: number,
  ) {
    const count = course.frame.boxes.length / 2;
    this.boxes = this.part(new BoxGeometry(1, 1, 1), boxMaterial(), count);
    this.boxes.castShadow = true;
    const disc = new CircleGeometry(1, 24);
    const flat = (colour: string, opacity: number): Material =>
      layered(new MeshBasicMaterial({ color: colour, transparent: true, opacity }));
    this.shades = this.part(disc, flat('#6d3df0', 0.28), count);
    this.rims = this.part(puddleShape(), flat('#ffb000', 0.85), MOST_PUDDLES);
    const oil = layered(
      new MeshStandardMaterial({ color: '#07060a', roughness: 0.12, metalness: 0.6 }),
    );
    oil.transparent = true;
    oil.depthTest = true;
    this.puddles = this.part(puddleShape(), oil, MOST_PUDDLES);
    this.shades.renderOrder = LAYERS.flat;
    this.rims.renderOrder = LAYERS.flat + 1;
    this.puddles.renderOrder = LAYERS.flat + 2;
  }

  /** seconds: of the clock of the pictures, for what moves by itself. */
  update(frame: SnapshotFrame, seconds: number): void {
    this.placeBoxes(frame, seconds);
    this.placePuddles(frame);
  }

  dispose(): void {
    for (const mesh of [this.boxes, this.shades, this.puddles, this.rims]) {
      mesh.geometry.dispose();
      (mesh.material as MeshBasicMaterial).map?.dispose();
      (mesh.material as Material).dispose();
      mesh.dispose();
    }
  }

  private placeBoxes(frame: SnapshotFrame, seconds: number): void {
    const { boxes } = this.course.frame;
    const { length } = this;
    const [solid, shade] = [arrayOf(this.boxes), arrayOf(this.shades)];
    for (let row = 0; 2 * row < boxes.length; row++) {
      if (frame.boxes[row] !== 1) {
        hide(solid, row);
        hide(shade, row);
        continue;
      }
      const [x, y] = [boxes[2 * row]!, boxes[2 * row + 1]!];
      const turn = SPIN * seconds + row;
      const up = (HOVER + BOB * Math.sin(2.2 * seconds + 0.7 * row)) * length;
      const size = SIZE * length;
      writeUpright(solid, row, x, y, up, Math.cos(turn), Math.sin(turn), size, size, size);
      writeUpright(shade, row, x, y, 0, 1, 0, 0.8 * size, 0.8 * size, 1);
    }
    this.boxes.instanceMatrix.needsUpdate = this.shades.instanceMatrix.needsUpdate = true;
  }

  private placePuddles(frame: SnapshotFrame): void {
    const count = Math.min(frame.hazards.length, MOST_PUDDLES);
    const [oil, rim] = [arrayOf(this.puddles), arrayOf(this.rims)];
    for (let row = 0; row < count; row++) {
      const { x, y, radius } = frame.hazards[row]!;
      // Turned by where it lies, so that no two look alike.
      const turn = 37 * x + 17 * y;
      const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
      writeUpright(oil, row, x, y, 0, cos, sin, radius, radius, 1);
      writeUpright(rim, row, x, y, 0, cos, sin, RIM * radius, RIM * radius, 1);
    }
    this.puddles.count = this.rims.count = count;
    this.puddles.instanceMatrix.needsUpdate = this.rims.instanceMatrix.needsUpdate = true;
  }

  private part(geometry: BufferGeometry, material: Material, most: number): InstancedMesh {
    const mesh = new InstancedMesh(geometry, material, Math.max(most, 1));
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.count = most;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    return mesh;
  }
}

function arrayOf(mesh: InstancedMesh): Float32Array {
  return mesh.instanceMatrix.array as Float32Array;
}

function boxMaterial(): MeshStandardMaterial {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 128;
  const context = canvas.getContext('2d')!;
  const fill = context.createLinearGradient(0, 0, 128, 128);
  fill.addColorStop(0, '#a57bff');
  fill.addColorStop(1, '#6429dd');
  context.fillStyle = fill;
  context.fillRect(0, 0, 128, 128);
  context.lineWidth = 12;
  context.strokeStyle = '#efe6ff';
  context.strokeRect(6, 6, 116, 116);
  context.font = '800 88px system-ui, sans-serif';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = '#ffffff';
  context.fillText('?', 64, 70);
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  return new MeshStandardMaterial({
    map,
    roughness: 0.35,
    emissive: '#5a2bd0',
    emissiveIntensity: 0.35,
  });
}

/** Returns a puddle of radius 1, whose shore is uneven. */
function puddleShape(): BufferGeometry {
  const shape = new CircleGeometry(1, 40);
  const position = shape.attributes.position!;
  for (let i = 1; i < position.count; i++) {
    const angle = Math.atan2(position.getY(i), position.getX(i));
    const reach = 0.93 + 0.07 * Math.sin(3 * angle + 0.6) * Math.cos(5 * angle);
    position.setXY(i, reach * Math.cos(angle), reach * Math.sin(angle));
  }
  return shape;
}
