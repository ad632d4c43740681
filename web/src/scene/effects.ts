// What acts on karts: shields, boosts, what slows them, and pulses on their way.

import {
  AdditiveBlending,
  type BufferGeometry,
  ConeGeometry,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  IcosahedronGeometry,
  InstancedMesh,
  type Material,
  MeshBasicMaterial,
  RingGeometry,
  ShaderMaterial,
  TorusGeometry,
} from 'three';

import { TICKS_PER_SECOND } from '../race/clock';
import type { KartBody } from '../race/race.svelte';
import type { EventFrame, KartFrame, SnapshotFrame } from '../wire/frames';
import { EventKind, KartFlag, Status } from '../wire/tables';
import { writeUpright } from './placing';
import { MOST_KARTS } from './plates';

const PULSE_S = 0.9;
const PULSE_REACH = 9; // lengths
const MOST_PULSES = 8;
// Events further back in the list than this are over.
const NEWEST = 24;
// A kart with an effect whose cap is above this share of the fastest cap is boosted.
const BOOSTED = 1.02;

export class Effects {
  readonly group = new Group();
  private readonly shields: InstancedMesh;
  private readonly flames: InstancedMesh;
  private readonly slows: InstancedMesh;
  private readonly waves: InstancedMesh;
  private usualCap = 0;

  constructor(private readonly body: KartBody) {
    this.shields = this.part(new IcosahedronGeometry(1, 3), shieldMaterial(), MOST_KARTS);
    const flame = new ConeGeometry(0.5, 1, 10, 1, true);
    flame.rotateZ(0.5 * Math.PI).translate(-0.5, 0, 0);
    this.flames = this.part(flame, glowing('#ffa02e', 0.9), 2 * MOST_KARTS);
    this.slows = this.part(
      new TorusGeometry(1, 0.035, 6, 36),
      glowing('#ff7a2f', 0.95),
      MOST_KARTS,
    );
    this.waves = this.part(new RingGeometry(0.86, 1, 48), glowing('#7fd4ff', 0.9), MOST_PULSES);
  }

  /** events: of the race, oldest first; pulse: number of that item, 0 if there is none. */
  update(
    frame: SnapshotFrame,
    events: readonly EventFrame[],
    pulse: number,
    seconds: number,
  ): void {
    const [shields, flames, slows] = [
      arrayOf(this.shields),
      arrayOf(this.flames),
      arrayOf(this.slows),
    ];
    const { length, ahead } = this.body;
    let [shieldCount, flameCount, slowCount] = [0, 0, 0];
    this.learnCap(frame);
    for (const kart of frame.karts) {
      if (kart.status === Status.ABSENT) continue;
      const [cos, sin] = [Math.cos(kart.heading), Math.sin(kart.heading)];
      const [x, y] = [kart.x + ahead * cos, kart.y + ahead * sin];
      if (kart.flags & KartFlag.IMMUNE) {
        const swell = length * (0.72 + 0.02 * Math.sin(7 * seconds + kart.seat));
        writeUpright(
          shields,
          shieldCount++,
          x,
          y,
          0.22 * length,
          cos,
          sin,
          swell,
          swell,
          0.85 * swell,
        );
      }
      if (kart.effects === 0) continue;
      if (kart.speedCap > BOOSTED * this.usualCap) {
        const long = length * (0.42 + 0.16 * Math.sin(37 * seconds + kart.seat));
        for (const side of [-0.14, 0.14]) {
          const [fx, fy] = [
            x - 0.5 * length * cos - side * length * sin,
            y - 0.5 * length * sin + side * length * cos,
          ];
          writeUpright(
            flames,
            flameCount++,
            fx,
            fy,
            0.14 * length,
            cos,
            sin,
            long,
            0.16 * length,
            0.16 * length,
          );
        }
      } else {
        const turn = 3 * seconds + kart.seat;
        const high = length * (0.3 + 0.16 * Math.sin(5 * seconds));
        const wide = 0.62 * length;
        writeUpright(
          slows,
          slowCount++,
          x,
          y,
          high,
          Math.cos(turn),
          Math.sin(turn),
          wide,
          wide,
          wide,
        );
      }
    }
    this.finish(this.shields, shieldCount);
    this.finish(this.flames, flameCount);
    this.finish(this.slows, slowCount);
    this.finish(this.waves, this.placeWaves(frame, events, pulse));
  }

  dispose(): void {
    for (const mesh of [this.shields, this.flames, this.slows, this.waves]) {
      mesh.geometry.dispose();
      (mesh.material as Material).dispose();
      mesh.dispose();
    }
  }

  /** A pulse is a ring that leaves who used it, and one that closes around who is hit. */
  private placeWaves(frame: SnapshotFrame, events: readonly EventFrame[], pulse: number): number {
    const waves = arrayOf(this.waves);
    let count = 0;
    for (let back = 1; back <= Math.min(NEWEST, events.length) && count < MOST_PULSES; back++) {
      const event = events[events.length - back]!;
      const isUse = event.kind === EventKind.USE && event.other === pulse;
      const isHit = event.kind === EventKind.HIT && event.value === pulse;
      const age = (frame.tick - event.tick) / TICKS_PER_SECOND;
      if (pulse === 0 || (!isUse && !isHit) || age < 0 || age > PULSE_S) continue;
      const kart = kartOf(frame, event.kart);
      if (!kart) continue;
      const share = isUse ? age / PULSE_S : 1 - age / PULSE_S;
      const reach = this.body.length * (0.5 + (isUse ? PULSE_REACH : 2.5) * share);
      writeUpright(waves, count++, kart.x, kart.y, 0.2 * this.body.length, 1, 0, reach, reach, 1);
    }
    return count;
  }

  /** Without effects all karts may drive as fast. */
  private learnCap(frame: SnapshotFrame): void {
    for (const { effects, speedCap, status } of frame.karts) {
      if (effects === 0 && status === Status.RACING) this.usualCap = Math.max(speedCap, 0);
    }
  }

  private finish(mesh: InstancedMesh, count: number): void {
    mesh.count = count;
    mesh.visible = count > 0;
    mesh.instanceMatrix.needsUpdate = true;
  }

  private part(geometry: BufferGeometry, material: Material, most: number): InstancedMesh {
    const mesh = new InstancedMesh(geometry, material, most);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.frustumCulled = mesh.visible = false;
    mesh.renderOrder = 20;
    this.group.add(mesh);
    return mesh;
  }
}

function kartOf(frame: SnapshotFrame, seat: number): KartFrame | null {
  for (const kart of frame.karts) if (kart.seat === seat) return kart;
  return null;
}

function arrayOf(mesh: InstancedMesh): Float32Array {
  return mesh.instanceMatrix.array as Float32Array;
}

function glowing(color: string, opacity: number): MeshBasicMaterial {
  const material = new MeshBasicMaterial({
    color,
    opacity,
    transparent: true,
    blending: AdditiveBlending,
  });
  material.depthWrite = false;
  material.side = DoubleSide;
  return material;
}

/** A skin that is seen at its edge, hardly in its middle. */
function shieldMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    clipping: true,
    transparent: true,
    depthWrite: false,
    vertexShader: `
      varying vec3 vNormal;
      varying vec3 vToEye;
      #include <clipping_planes_pars_vertex>
      void main() {
        vec4 place = modelViewMatrix * instanceMatrix * vec4(position, 1.0);
        vec4 mvPosition = place;
        #include <clipping_planes_vertex>
        vNormal = normalize(normalMatrix * mat3(instanceMatrix) * normal);
        vToEye = normalize(-place.xyz);
        gl_Position = projectionMatrix * place;
      }`,
    fragmentShader: `
      varying vec3 vNormal;
      varying vec3 vToEye;
      #include <clipping_planes_pars_fragment>
      void main() {
        #include <clipping_planes_fragment>
        float edge = 1.0 - abs(dot(normalize(vNormal), normalize(vToEye)));
        gl_FragColor = vec4(mix(vec3(0.35, 0.75, 1.0), vec3(0.85, 0.97, 1.0), edge), 0.1 + 0.62 * edge * edge);
        #include <colorspace_fragment>
      }`,
  });
}
