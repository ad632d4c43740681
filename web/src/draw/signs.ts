// Signs with a letter or number, painted once and then only scaled: text in changing sizes would
// cost more than everything else in the picture.

export interface Sign {
  text: string;
  colour: string;
  ink: string;
  isCube?: boolean; // a box on its edge instead of a disc
}

const SIZE = 96; // [pixels] of a painted sign
const painted = new Map<string, HTMLCanvasElement>();

/** Draws a sign of `size` pixels across with its middle at (x, y). */
export function drawSign(
  context: CanvasRenderingContext2D,
  sign: Sign,
  x: number,
  y: number,
  size: number,
): void {
  const name = `${sign.text} ${sign.colour} ${sign.isCube}`;
  let picture = painted.get(name);
  if (!picture) {
    picture = paint(sign);
    painted.set(name, picture);
  }
  context.drawImage(picture, x - 0.5 * size, y - 0.5 * size, size, size);
}

function paint(sign: Sign): HTMLCanvasElement {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = SIZE;
  const context = canvas.getContext('2d')!;
  const half = 0.5 * SIZE;
  context.beginPath();
  if (sign.isCube) {
    const reach = half - 4;
    context.moveTo(half, half - reach);
    context.lineTo(half + reach, half);
    context.lineTo(half, half + reach);
    context.lineTo(half - reach, half);
    context.closePath();
  } else context.arc(half, half, half - 3, 0, 2 * Math.PI);
  context.fillStyle = sign.colour;
  context.fill();
  context.lineWidth = 5;
  context.strokeStyle = sign.isCube ? '#efe6ff' : 'rgb(0 0 0 / 70%)';
  context.stroke();
  context.font = `800 ${sign.isCube ? 46 : 60}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = sign.ink;
  context.fillText(sign.text, half, half + 3);
  return canvas;
}
