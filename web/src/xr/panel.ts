// What a driver must read: speed, flag, item, why nothing else is drawn. One picture on a panel
// ahead of the seat, below the road.

import { CanvasTexture, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace } from 'three';

const [WIDTH, HEIGHT] = [512, 192]; // [pixels]
const AWAY = 1.5; // [m]
const DOWN = (15 * Math.PI) / 180;
const WIDE = 0.62; // [m]
const FLAGS = ['', '#ffd43b', '#ff5347'] as const;

/** What the panel says; texts in the language of the page. */
export interface Reading {
  speed: string;
  unit: string;
  flag: number;
  item: string;
  alert: string; // '' for none
}

export class Panel {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly canvas = document.createElement('canvas');
  private readonly texture: CanvasTexture;
  private shown = '';

  constructor() {
    this.canvas.width = WIDTH;
    this.canvas.height = HEIGHT;
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true });
    material.depthTest = material.depthWrite = material.toneMapped = false;
    this.mesh = new Mesh(new PlaneGeometry(WIDE, (WIDE * HEIGHT) / WIDTH), material);
    this.mesh.position.set(0, -AWAY * Math.sin(DOWN), -AWAY * Math.cos(DOWN));
    this.mesh.rotation.x = -DOWN;
    this.mesh.renderOrder = 1001;
  }

  show(reading: Reading): void {
    const stamp = `${reading.speed}|${reading.flag}|${reading.item}|${reading.alert}`;
    if (stamp === this.shown) return;
    this.shown = stamp;
    paint(this.canvas.getContext('2d')!, reading);
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }
}

function paint(context: CanvasRenderingContext2D, reading: Reading): void {
  const { speed, unit, flag, item, alert } = reading;
  context.clearRect(0, 0, WIDTH, HEIGHT);
  context.textBaseline = 'middle';
  if (speed) {
    context.fillStyle = 'rgb(8 14 22 / 72%)';
    context.beginPath();
    context.roundRect(4, 64, WIDTH - 8, HEIGHT - 68, 24);
    context.fill();
    context.fillStyle = '#ffffff';
    context.textAlign = 'right';
    context.font = '800 96px system-ui, sans-serif';
    context.fillText(speed, 210, 132);
    context.textAlign = 'left';
    context.font = '600 32px system-ui, sans-serif';
    context.fillText(unit, 222, 148);
    context.font = '700 40px system-ui, sans-serif';
    context.fillStyle = '#c9b3ff';
    context.fillText(item, 320, 132, WIDTH - 340);
  }
  if (!alert) return;
  context.fillStyle = FLAGS[flag] || '#ff5347';
  context.beginPath();
  context.roundRect(4, 2, WIDTH - 8, 56, 16);
  context.fill();
  context.fillStyle = '#171200';
  context.textAlign = 'center';
  context.font = '800 36px system-ui, sans-serif';
  context.fillText(alert, 0.5 * WIDTH, 31, WIDTH - 40);
}
