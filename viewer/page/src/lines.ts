// Lines that change all the time, in buffers that only grow.
import * as THREE from 'three';

const CORNERS = 4;

/** Pairs of ends with a colour each, collected anew for every change. */
export class Segments {
  /** Of each segment both ends, once for each corner of its strip, and so the colours. */
  ends = new Float32Array(6 * CORNERS * 256);
  colours = new Uint8Array(4 * CORNERS * 256);
  count = 0;

  add(a: readonly number[], b: readonly number[], colour: THREE.Color): void {
    if (6 * CORNERS * (this.count + 1) > this.ends.length) this.grow();
    const hex = colour.getHex();
    for (let corner = CORNERS * this.count; corner < CORNERS * (this.count + 1); ++corner) {
      for (let k = 0; k < 3; ++k) {
        this.ends[6 * corner + k] = a[k];
        this.ends[6 * corner + 3 + k] = b[k];
      }
      this.colours[4 * corner] = hex >> 16;
      this.colours[4 * corner + 1] = (hex >> 8) & 0xff;
      this.colours[4 * corner + 2] = hex & 0xff;
    }
    ++this.count;
  }

  private grow(): void {
    const {ends, colours} = this;
    this.ends = new Float32Array(2 * ends.length);
    this.ends.set(ends);
    this.colours = new Uint8Array(2 * colours.length);
    this.colours.set(colours);
  }
}

// A segment is a strip as wide as the line: two triangles. What lies behind the near plane is cut off first, for it has
// no direction in the image. Strips are not instances of one: renderers in software begin anew for each instance.
const VERTEX = `
  attribute vec3 to, shade;
  uniform vec2 size;  // of the picture [pixels]
  uniform float width;
  varying vec3 colour;
  vec4 projected(vec3 point) {
    return projectionMatrix * (modelViewMatrix * vec4(point, 1.0));
  }
  void main() {
    colour = shade;
    vec4 a = projected(position), b = projected(to);
    float nearA = a.z + a.w, nearB = b.z + b.w;
    if (nearA < 0.0 && nearB < 0.0) {
      gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
      return;
    }
    if (nearA < 0.0) a = mix(a, b, nearA / (nearA - nearB));
    if (nearB < 0.0) b = mix(b, a, nearB / (nearB - nearA));
    vec2 along = (b.xy / b.w - a.xy / a.w) * size;
    vec2 across = normalize(vec2(-along.y, along.x) + vec2(1e-6, 0.0)) * width / size;
    int corner = gl_VertexID & 3;
    vec4 end = corner < 2 ? a : b;
    gl_Position = end + vec4(((corner & 1) == 0 ? across : -across) * end.w, 0.0, 0.0);
  }`;
const FRAGMENT = `
  uniform float opacity;
  varying vec3 colour;
  void main() {
    gl_FragColor = vec4(colour, opacity);
  }`;

/**
 * Lines of a width in pixels: renderers without a graphics processor draw them many times faster than WebGL's own. Of
 * those that are drawn over each other, the one of higher order is on top.
 */
export class WideLines {
  readonly object: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  readonly segments = new Segments();
  private room = 0;

  constructor(width: number, order: number, opacity = 1) {
    const material = new THREE.ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, side: THREE.DoubleSide,
      uniforms: {size: {value: new THREE.Vector2(1, 1)}, width: {value: width}, opacity: {value: opacity}},
      transparent: true, depthWrite: false, blending: opacity < 1 ? THREE.NormalBlending : THREE.NoBlending,
    });
    this.object = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = order;
    this.object.onBeforeRender = (renderer) => renderer.getDrawingBufferSize(material.uniforms.size.value);
  }
  begin(): Segments {
    this.segments.count = 0;
    return this.segments;
  }
  end(): void {
    const {ends, colours, count} = this.segments;
    if (this.room !== ends.length) {
      this.room = ends.length;
      this.object.geometry.dispose();
      this.object.geometry = strips(ends, colours);
    } else {
      this.upload('position', 6 * CORNERS * count);
      this.upload('shade', 4 * CORNERS * count);
    }
    this.object.geometry.setDrawRange(0, 6 * count);
  }

  /** The first values of a buffer, as many as there are segments for. */
  private upload(name: string, values: number): void {
    const attribute = this.object.geometry.getAttribute(name);
    const buffer = attribute instanceof THREE.InterleavedBufferAttribute ? attribute.data : attribute;
    buffer.clearUpdateRanges();
    if (values === 0) return;
    buffer.addUpdateRange(0, values);
    buffer.needsUpdate = true;
  }
}

/** Two triangles for each segment that there is room for. */
function strips(ends: Float32Array, colours: Uint8Array): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  const pairs = new THREE.InterleavedBuffer(ends, 6).setUsage(THREE.DynamicDrawUsage);
  geometry.setAttribute('position', new THREE.InterleavedBufferAttribute(pairs, 3, 0));
  geometry.setAttribute('to', new THREE.InterleavedBufferAttribute(pairs, 3, 3));
  geometry.setAttribute('shade', new THREE.BufferAttribute(colours, 4, true).setUsage(THREE.DynamicDrawUsage));
  const room = ends.length / 6 / CORNERS;
  const corners = new Uint32Array(6 * room);
  for (let n = 0; n < room; ++n) corners.set([0, 1, 2, 2, 1, 3].map((corner) => CORNERS * n + corner), 6 * n);
  geometry.setIndex(new THREE.BufferAttribute(corners, 1));
  return geometry;
}
