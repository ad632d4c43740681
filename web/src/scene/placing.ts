// Matrices of instances, written where the graphics card reads them: nothing is made on the way.
// Column by column, as WebGL reads them; x ahead, y left, z up.

/** Writes an upright instance. cos, sin: of its heading. */
export function writeUpright(
  matrices: Float32Array,
  row: number,
  x: number,
  y: number,
  z: number,
  cos: number,
  sin: number,
  along: number,
  across: number,
  up: number,
): void {
  const at = 16 * row;
  matrices[at] = along * cos;
  matrices[at + 1] = along * sin;
  matrices[at + 2] = 0;
  matrices[at + 3] = 0;
  matrices[at + 4] = -across * sin;
  matrices[at + 5] = across * cos;
  matrices[at + 6] = 0;
  matrices[at + 7] = 0;
  matrices[at + 8] = 0;
  matrices[at + 9] = 0;
  matrices[at + 10] = up;
  matrices[at + 11] = 0;
  matrices[at + 12] = x;
  matrices[at + 13] = y;
  matrices[at + 14] = z;
  matrices[at + 15] = 1;
}

/** Writes a wheel: turned about z by its heading, and rolled about its axle by an angle [rad]. */
export function writeWheel(
  matrices: Float32Array,
  row: number,
  x: number,
  y: number,
  radius: number,
  heading: number,
  roll: number,
  width: number,
): void {
  const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
  const [rollCos, rollSin] = [radius * Math.cos(roll), radius * Math.sin(roll)];
  const at = 16 * row;
  matrices[at] = rollCos * cos;
  matrices[at + 1] = rollCos * sin;
  matrices[at + 2] = -rollSin;
  matrices[at + 3] = 0;
  matrices[at + 4] = -width * sin;
  matrices[at + 5] = width * cos;
  matrices[at + 6] = 0;
  matrices[at + 7] = 0;
  matrices[at + 8] = rollSin * cos;
  matrices[at + 9] = rollSin * sin;
  matrices[at + 10] = rollCos;
  matrices[at + 11] = 0;
  matrices[at + 12] = x;
  matrices[at + 13] = y;
  matrices[at + 14] = radius;
  matrices[at + 15] = 1;
}

/** Writes an instance that is not seen. */
export function hide(matrices: Float32Array, row: number): void {
  matrices.fill(0, 16 * row, 16 * row + 15);
  matrices[16 * row + 15] = 1;
}
