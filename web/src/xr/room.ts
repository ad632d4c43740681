// A quiet room around the table, where none is seen through the headset.

import {
  CircleGeometry,
  Color,
  Group,
  Mesh,
  MeshBasicMaterial,
  RingGeometry,
  type Scene,
} from 'three';

const [WALL, FLOOR, RING] = ['#27323e', '#323e4b', '#41505f'];
const RADIUS = 4; // [m]

export class Room {
  private readonly group = new Group();
  private readonly meshes: Mesh<CircleGeometry | RingGeometry, MeshBasicMaterial>[];

  constructor(scene: Scene) {
    scene.background = new Color(WALL);
    const flat = (color: string) => new MeshBasicMaterial({ color, toneMapped: false });
    this.meshes = [
      new Mesh(new CircleGeometry(RADIUS, 64), flat(FLOOR)),
      new Mesh(new RingGeometry(0.5 * RADIUS, 0.51 * RADIUS, 64), flat(RING)),
      new Mesh(new RingGeometry(0.98 * RADIUS, RADIUS, 64), flat(RING)),
    ];
    this.meshes.forEach((mesh, layer) => {
      mesh.position.z = 0.002 * layer;
      // Before the plinth and the layers of the ground, which do not look at depth.
      mesh.renderOrder = -80 + layer;
    });
    this.group.add(...this.meshes);
    this.group.rotation.x = -0.5 * Math.PI;
    scene.add(this.group);
  }

  dispose(): void {
    for (const { geometry, material } of this.meshes) {
      geometry.dispose();
      material.dispose();
    }
  }
}
