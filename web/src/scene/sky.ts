// Sky and light: a late afternoon, painted once.

import {
  BackSide,
  CanvasTexture,
  Color,
  DirectionalLight,
  Fog,
  Group,
  HemisphereLight,
  Mesh,
  MeshBasicMaterial,
  type Scene,
  SphereGeometry,
  SRGBColorSpace,
  Vector3,
} from 'three';

import { chance } from './chance';
import type { Setting } from './surroundings';

const [WIDTH, HEIGHT] = [2048, 512]; // [pixels]
const SKYLINE = HEIGHT / 1.04; // [pixels] from above: the dome reaches a little below it
const HORIZON = '#cfdde6';
const SHADES: readonly [number, string][] = [
  [0, '#2f6fb5'],
  [0.45, '#6ba3d6'],
  [0.8, '#a9cbe4'],
  [1, HORIZON],
];
const CLOUDS = 46;
const HILLS: readonly [height: number, colour: string, seed: number][] = [
  [30, '#a7bccb', 3],
  [19, '#86a1a8', 5],
  [9, '#6c8a7c', 8],
];
// A hall, from the top: roof, wall, and its foot in the colour of what is far away.
const ROOF: readonly [number, string][] = [
  [0, '#f3f5f7'],
  [0.72, '#e3e8ec'],
  [0.8, '#c3cbd2'],
  [0.801, '#8fa0ae'],
  [1, HORIZON],
];
const BAYS = 40;
/** From the ground to the sun. */
export const SUN = new Vector3(-0.55, -0.5, 0.68).normalize();
const SHADOW_PIXELS = 2048;

export class Sky {
  readonly group = new Group();
  readonly sun = new DirectionalLight('#fff1d8', 2.3);
  private readonly fog = new Fog(HORIZON);
  private readonly background = new Color(HORIZON);
  private readonly dome: Mesh<SphereGeometry, MeshBasicMaterial>;

  constructor(setting: Setting) {
    const texture = new CanvasTexture(setting === 'outdoor' ? paintSky() : paintHall());
    texture.colorSpace = SRGBColorSpace;
    const material = new MeshBasicMaterial({ map: texture, side: BackSide, fog: false });
    material.depthTest = material.depthWrite = false;
    this.dome = new Mesh(
      new SphereGeometry(1, 48, 16, 0, 2 * Math.PI, 0, 0.52 * Math.PI),
      material,
    );
    this.dome.rotation.x = 0.5 * Math.PI;
    this.dome.renderOrder = -100;
    this.dome.frustumCulled = false;
    const light = new HemisphereLight('#cfe4ff', '#90917e', 2.0);
    light.position.set(0, 0, 1);
    this.group.add(this.dome, light, this.sun, this.sun.target);
    this.sun.shadow.mapSize.set(SHADOW_PIXELS, SHADOW_PIXELS);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.02;
  }

  /** Makes what is far away pale, beyond `near` [m]. */
  haze(scene: Scene, near: number, far: number): void {
    this.fog.near = near;
    this.fog.far = far;
    scene.fog = this.fog;
    scene.background = this.background;
  }

  /** Keeps the sky around the eye. radius: within the far plane [m]. */
  surround(eye: Vector3, radius: number): void {
    this.dome.position.set(eye.x, eye.y, 0);
    this.dome.scale.setScalar(radius);
  }

  get isDomeShown(): boolean {
    return this.dome.visible;
  }

  set isDomeShown(isShown: boolean) {
    this.dome.visible = isShown;
  }

  /** Lets shadows fall around a place, as far as `reach` [m]. */
  shade(x: number, y: number, reach: number): void {
    const { sun } = this;
    const camera = sun.shadow.camera;
    // In whole pixels of the shadow, or its edges would swim.
    const step = (2 * reach) / SHADOW_PIXELS;
    const [px, py] = [Math.round(x / step) * step, Math.round(y / step) * step];
    sun.target.position.set(px, py, 0);
    sun.position.set(px, py, 0).addScaledVector(SUN, 2 * reach);
    if (camera.right === reach) return;
    camera.left = camera.bottom = -reach;
    camera.right = camera.top = reach;
    camera.near = 0.2 * reach;
    camera.far = 4 * reach;
    camera.updateProjectionMatrix();
  }

  dispose(): void {
    this.dome.geometry.dispose();
    this.dome.material.map?.dispose();
    this.dome.material.dispose();
    this.sun.dispose();
  }
}

/** Returns a picture of the dome in shades from the zenith down to the horizon. */
function shaded(shades: typeof SHADES): CanvasRenderingContext2D {
  const canvas = document.createElement('canvas');
  canvas.width = WIDTH;
  canvas.height = HEIGHT;
  const context = canvas.getContext('2d')!;
  const fill = context.createLinearGradient(0, 0, 0, SKYLINE);
  for (const [at, colour] of shades) fill.addColorStop(at, colour);
  context.fillStyle = fill;
  context.fillRect(0, 0, WIDTH, HEIGHT);
  return context;
}

function paintSky(): HTMLCanvasElement {
  const context = shaded(SHADES);
  paintGlow(context);
  paintClouds(context);
  for (const [height, colour, seed] of HILLS) paintHills(context, height, colour, seed);
  return context.canvas;
}

/** The inside of a hall: a wall with windows between its pillars, and lamps under the roof. */
function paintHall(): HTMLCanvasElement {
  const context = shaded(ROOF);
  const bay = WIDTH / BAYS;
  for (let each = 0; each < BAYS; each++) {
    const x = each * bay;
    context.fillStyle = 'rgb(214 233 246 / 75%)';
    context.fillRect(x + 0.2 * bay, 0.825 * SKYLINE, 0.6 * bay, 0.06 * SKYLINE);
    context.fillStyle = 'rgb(84 99 112 / 45%)';
    context.fillRect(x - 0.05 * bay, 0.74 * SKYLINE, 0.1 * bay, 0.25 * SKYLINE);
    context.fillStyle = each % 2 ? 'rgb(255 255 255 / 90%)' : 'rgb(255 255 255 / 0%)';
    context.fillRect(x + 0.1 * bay, 0.52 * SKYLINE, 0.5 * bay, 0.02 * SKYLINE);
  }
  context.fillStyle = 'rgb(200 60 52 / 55%)';
  context.fillRect(0, 0.925 * SKYLINE, WIDTH, 0.012 * SKYLINE);
  return context.canvas;
}

function paintGlow(context: CanvasRenderingContext2D): void {
  // A sphere begins opposite to x, and goes round clockwise seen from above.
  const turn = Math.atan2(SUN.y, SUN.x) / (2 * Math.PI);
  const x = (((0.5 + turn) % 1) + 1) % 1;
  const y = (1 - Math.asin(SUN.z) / (0.5 * Math.PI)) * SKYLINE;
  for (const wrap of [-1, 0, 1]) {
    const at = (x + wrap) * WIDTH;
    const glow = context.createRadialGradient(at, y, 4, at, y, 460);
    glow.addColorStop(0, 'rgb(255 250 230 / 100%)');
    glow.addColorStop(0.05, 'rgb(255 246 214 / 70%)');
    glow.addColorStop(0.25, 'rgb(255 240 205 / 22%)');
    glow.addColorStop(1, 'rgb(255 240 205 / 0%)');
    context.fillStyle = glow;
    context.fillRect(at - 460, y - 460, 920, 920);
  }
}

function paintClouds(context: CanvasRenderingContext2D): void {
  const next = chance(11);
  for (let cloud = 0; cloud < CLOUDS; cloud++) {
    const height = next() ** 1.6;
    const y = SKYLINE * (0.93 - 0.62 * height);
    const size = 10 + 46 * height;
    const x = next() * WIDTH;
    for (let puff = 0; puff < 14; puff++) {
      const [px, py] = [x + (next() - 0.5) * 7 * size, y + (next() - 0.5) * 0.8 * size];
      const radius = size * (0.4 + 0.8 * next());
      for (const wrap of [-WIDTH, 0, WIDTH]) paintPuff(context, px + wrap, py, radius);
    }
  }
}

function paintPuff(context: CanvasRenderingContext2D, x: number, y: number, radius: number): void {
  context.save();
  context.translate(x, y);
  context.scale(1.9, 0.55);
  const fill = context.createRadialGradient(0, -0.2 * radius, 0, 0, 0, radius);
  fill.addColorStop(0, 'rgb(255 255 255 / 20%)');
  fill.addColorStop(0.6, 'rgb(250 250 252 / 9%)');
  fill.addColorStop(1, 'rgb(250 250 252 / 0%)');
  context.fillStyle = fill;
  context.fillRect(-radius, -radius, 2 * radius, 2 * radius);
  context.restore();
}

function paintHills(
  context: CanvasRenderingContext2D,
  height: number,
  colour: string,
  seed: number,
): void {
  const next = chance(seed);
  // Whole waves around the picture, so that its ends meet.
  const waves = [2, 3, 5, 8, 13, 21].map((count) => ({
    count,
    phase: 2 * Math.PI * next(),
    size: 1 / count ** 0.8,
  }));
  const most = waves.reduce((sum, { size }) => sum + size, 0);
  context.beginPath();
  context.moveTo(0, HEIGHT);
  for (let x = 0; x <= WIDTH; x += 4) {
    const angle = (2 * Math.PI * x) / WIDTH;
    const wave = waves.reduce(
      (sum, { count, phase, size }) => sum + size * Math.sin(count * angle + phase),
      0,
    );
    context.lineTo(x, SKYLINE - height * (0.55 + (0.75 * wave) / most));
  }
  context.lineTo(WIDTH, HEIGHT);
  context.closePath();
  context.fillStyle = colour;
  context.fill();
}
