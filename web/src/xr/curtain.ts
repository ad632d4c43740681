// Fades all that was drawn before it: what is behind shows through, or a calm grey in a room that
// is virtual as a whole. One surface for both eyes, so no material needs to know of it.

import {
  BufferGeometry,
  CustomBlending,
  Float32BufferAttribute,
  Mesh,
  OneFactor,
  ShaderMaterial,
  SrcAlphaFactor,
  ZeroFactor,
} from 'three';

export class Curtain {
  readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;

  constructor(isRoomReal: boolean) {
    const geometry = new BufferGeometry();
    const corners = [-1, -1, 0, 3, -1, 0, -1, 3, 0];
    geometry.setAttribute('position', new Float32BufferAttribute(corners, 3));
    const material = new ShaderMaterial({
      uniforms: { share: { value: 1 }, calm: { value: isRoomReal ? 0 : 0.16 } },
      transparent: true,
      depthTest: false,
      depthWrite: false,
      blending: CustomBlending,
      blendSrc: OneFactor,
      blendDst: SrcAlphaFactor,
      blendSrcAlpha: ZeroFactor,
      blendDstAlpha: SrcAlphaFactor,
      vertexShader: 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }',
      // Colours and opacity of what lies below are multiplied by the share.
      fragmentShader: `
        uniform float share;
        uniform float calm;
        void main() { gl_FragColor = vec4(vec3(calm * (1.0 - share)), share); }`,
    });
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = this.mesh.visible = false;
    this.mesh.renderOrder = 1000;
  }

  /** share: of what was drawn that stays visible, 0 to 1. */
  set share(value: number) {
    this.mesh.material.uniforms.share!.value = value;
    this.mesh.visible = value < 1;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
