// Numbers and names above karts, and signs above hazards: always turned to the eye, readable from
// far away, and never so large that they hide what they stand above.

import {
  CanvasTexture,
  DynamicDrawUsage,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  PlaneGeometry,
  ShaderMaterial,
  SRGBColorSpace,
} from 'three';

import { liveryOf } from '../draw/palette';
import { drawSign, type Sign } from '../draw/signs';
import type { Race } from '../race/race.svelte';
import type { SnapshotFrame } from '../wire/frames';
import { Status } from '../wire/tables';
import { MOST_KARTS } from './plates';

const COLUMNS = 4;
const ROWS = 17; // the last one holds signs
const [CELL_WIDTH, CELL_HEIGHT] = [256, 64];
const SIGN_CELL = COLUMNS * (ROWS - 1);
const DANGER: Sign = { text: '!', colour: '#ffb000', ink: '#1b1200' };
const MOST_SIGNS = 32;
const MOST = MOST_KARTS + MOST_SIGNS;
// Height of a badge [m per length of a kart], and its bounds as shares of the picture's height.
const SIZE = 0.3;
const [LEAST, MOST_SHARE] = [0.026, 0.05];
const ABOVE = 0.7; // lengths above the ground

export class Badges {
  readonly mesh: Mesh<InstancedBufferGeometry, ShaderMaterial>;
  private readonly canvas = document.createElement('canvas');
  private readonly texture: CanvasTexture;
  private readonly places = new Float32Array(4 * MOST); // x, y, z, cell
  private readonly painted = new Array<string>(MOST_KARTS).fill('');
  private readonly attribute: InstancedBufferAttribute;

  constructor(private readonly length: number) {
    this.canvas.width = COLUMNS * CELL_WIDTH;
    this.canvas.height = ROWS * CELL_HEIGHT;
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const plane = new PlaneGeometry(CELL_WIDTH / CELL_HEIGHT, 1);
    const geometry = new InstancedBufferGeometry();
    geometry.index = plane.index;
    geometry.setAttribute('position', plane.attributes.position!);
    geometry.setAttribute('uv', plane.attributes.uv!);
    this.attribute = new InstancedBufferAttribute(this.places, 4).setUsage(DynamicDrawUsage);
    geometry.setAttribute('place', this.attribute);
    this.mesh = new Mesh(geometry, badgeMaterial(this.texture, SIZE * length));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 30;
    drawSign(this.canvas.getContext('2d')!, DANGER, ...middleOf(SIGN_CELL), CELL_HEIGHT);
  }

  /** Sets how large the picture is. tangent: of half its angle from top to bottom. */
  set tangent(value: number) {
    this.mesh.material.uniforms.tangent!.value = value;
  }

  /** without: seat that has no badge, -1 for none. */
  update(frame: SnapshotFrame, race: Race, without: number, showsNames: boolean): void {
    let count = 0;
    const { length } = this;
    for (let row = 0; row < Math.min(frame.karts.length, MOST_KARTS); row++) {
      const kart = frame.karts[row]!;
      if (kart.status === Status.ABSENT || kart.seat === without) continue;
      this.paint(row, kart.seat, showsNames ? race : null);
      this.write(count++, kart.x, kart.y, ABOVE * length, row);
    }
    for (const { x, y } of frame.hazards) {
      if (count < MOST) this.write(count++, x, y, 0.34 * length, SIGN_CELL);
    }
    this.mesh.geometry.instanceCount = count;
    this.attribute.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }

  private write(row: number, x: number, y: number, z: number, cell: number): void {
    const at = 4 * row;
    this.places[at] = x;
    this.places[at + 1] = y;
    this.places[at + 2] = z;
    this.places[at + 3] = cell;
  }

  private paint(cell: number, seat: number, named: Race | null): void {
    const name = named ? named.driver(seat) : '';
    const wanted = this.painted[cell]!;
    if (wanted.length === name.length + 2 && wanted.charCodeAt(0) === seat && wanted.endsWith(name))
      return;
    this.painted[cell] = `${String.fromCharCode(seat)} ${name}`;
    const context = this.canvas.getContext('2d')!;
    const [x, y] = middleOf(cell);
    context.clearRect(x - 0.5 * CELL_WIDTH, y - 0.5 * CELL_HEIGHT, CELL_WIDTH, CELL_HEIGHT);
    const { colour, ink } = liveryOf(seat);
    const disc: Sign = { text: String(seat), colour, ink };
    if (name) paintPill(context, disc, name, x, y);
    else drawSign(context, disc, x, y, CELL_HEIGHT);
    this.texture.needsUpdate = true;
  }
}

function paintPill(
  context: CanvasRenderingContext2D,
  disc: Sign,
  name: string,
  x: number,
  y: number,
): void {
  const room = CELL_WIDTH - CELL_HEIGHT - 14;
  context.font = '600 34px system-ui, sans-serif';
  const width = Math.min(context.measureText(name).width, room);
  const left = x - 0.5 * (width + CELL_HEIGHT + 10);
  context.beginPath();
  context.roundRect(left + 2, y - 25, width + CELL_HEIGHT + 8, 50, 25);
  context.fillStyle = 'rgb(10 14 19 / 82%)';
  context.fill();
  context.fillStyle = '#f2f5f8';
  context.textAlign = 'left';
  context.textBaseline = 'middle';
  context.fillText(name, left + CELL_HEIGHT, y + 2, room);
  drawSign(context, disc, left + 0.5 * CELL_HEIGHT - 2, y, 54);
}

function middleOf(cell: number): [number, number] {
  return [((cell % COLUMNS) + 0.5) * CELL_WIDTH, (Math.floor(cell / COLUMNS) + 0.5) * CELL_HEIGHT];
}

function badgeMaterial(texture: CanvasTexture, size: number): ShaderMaterial {
  return new ShaderMaterial({
    clipping: true,
    uniforms: { map: { value: texture }, size: { value: size }, tangent: { value: 0.5 } },
    transparent: true,
    depthWrite: false,
    vertexShader: `
      attribute vec4 place;
      uniform float size;
      uniform float tangent;
      varying vec2 vUv;
      #include <clipping_planes_pars_vertex>
      void main() {
        vec4 at = modelViewMatrix * vec4(place.xyz, 1.0);
        vec4 mvPosition = at;
        #include <clipping_planes_vertex>
        float scale = length(modelViewMatrix[0].xyz);
        float seen = 2.0 * tangent * max(-at.z, 1e-4);
        float high = clamp(size * scale, ${LEAST} * seen, ${MOST_SHARE} * seen);
        at.xy += position.xy * high + vec2(0.0, 0.5 * high);
        float column = mod(place.w, ${COLUMNS}.0);
        float row = floor(place.w / ${COLUMNS}.0 + 0.001);
        vUv = vec2((column + uv.x) / ${COLUMNS}.0, 1.0 - (row + 1.0 - uv.y) / ${ROWS}.0);
        gl_Position = projectionMatrix * at;
      }`,
    fragmentShader: `
      uniform sampler2D map;
      varying vec2 vUv;
      #include <clipping_planes_pars_fragment>
      void main() {
        #include <clipping_planes_fragment>
        vec4 colour = texture2D(map, vUv);
        if (colour.a < 0.02) discard;
        gl_FragColor = colour;
        #include <colorspace_fragment>
      }`,
  });
}
