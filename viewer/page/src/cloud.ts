// Millions of points. Chunks of 65,536 are filled in an order that makes the first n of them an even sample of all: fewer
// are drawn when the machine is slow.
import * as THREE from 'three';
import {POINT_WORDS, type PointBlock} from './wire.ts';

const CHUNK_BITS = 16;
const CHUNK = 1 << CHUNK_BITS;

const VERTEX = `
  attribute vec4 info;  // observers, deviation code, part, alive
  attribute float age;
  uniform float size, shownPart, newest, lastAge, sparse;
  uniform vec2 heights;
  uniform int mode;
  varying vec3 shade;
  vec3 turbo(float x) {
    x = clamp(x, 0.0, 1.0);
    const vec4 r4 = vec4(0.13572138, 4.61539260, -42.66032258, 132.13108234);
    const vec4 g4 = vec4(0.09140261, 2.19418839, 4.84296658, -14.18503333);
    const vec4 b4 = vec4(0.10667330, 12.64194608, -60.58204836, 110.36276771);
    const vec2 r2 = vec2(-152.94239396, 59.28637943);
    const vec2 g2 = vec2(4.27729857, 2.82956604);
    const vec2 b2 = vec2(-89.90310912, 27.34824973);
    vec4 v4 = vec4(1.0, x, x * x, x * x * x);
    vec2 v2 = v4.zw * v4.z;
    return vec3(dot(v4, r4) + dot(v2, r2), dot(v4, g4) + dot(v2, g2), dot(v4, b4) + dot(v2, b2));
  }
  void main() {
    bool shown = info.w > 0.5 && age <= lastAge && (shownPart < 0.0 || abs(info.z * 255.0 - shownPart) < 0.5);
    vec4 p = modelViewMatrix * vec4(position, 1.0);
    gl_Position = shown ? projectionMatrix * p : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = clamp(size * sparse / max(-p.z, 0.01), 2.6, 9.0);
    float x = 0.0;
    if (mode == 0) x = (-position.y - heights.x) / max(heights.y - heights.x, 1e-3);
    if (mode == 1) x = age / max(newest, 1.0);
    if (mode == 2) x = fract(info.z * 255.0 * 0.618034);
    if (mode == 3) x = info.x * 255.0 / 20.0;
    if (mode == 4) x = info.y == 0.0 ? 0.0 : (info.y * 255.0 - 64.0) / 80.0;
    shade = mix(vec3(0.75), turbo(0.13 + 0.8 * x), 0.88);
  }`;
const FRAGMENT = `
  varying vec3 shade;
  void main() {
    vec2 d = gl_PointCoord - 0.5;
    if (dot(d, d) > 0.25) discard;
    gl_FragColor = vec4(shade, 1.0);
  }`;

export type Colouring = 'height' | 'age' | 'part' | 'observers' | 'deviation';
export const COLOURINGS: Colouring[] = ['height', 'age', 'part', 'observers', 'deviation'];

/** 16 bits in reverse order: 0, 32768, 16384, ... */
function reversed(n: number): number {
  n = ((n & 0x5555) << 1) | ((n >> 1) & 0x5555);
  n = ((n & 0x3333) << 2) | ((n >> 2) & 0x3333);
  n = ((n & 0x0f0f) << 4) | ((n >> 4) & 0x0f0f);
  return ((n & 0x00ff) << 8) | ((n >> 8) & 0x00ff);
}

class Chunk {
  readonly position = new THREE.BufferAttribute(new Float32Array(3 * CHUNK), 3);
  readonly info = new THREE.BufferAttribute(new Uint8Array(4 * CHUNK), 4, true);
  readonly age = new THREE.BufferAttribute(new Float32Array(CHUNK), 1);
  readonly object: THREE.Points;
  readonly box = new THREE.Box3();

  constructor(material: THREE.Material) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', this.position);
    geometry.setAttribute('info', this.info);
    geometry.setAttribute('age', this.age);
    geometry.boundingSphere = new THREE.Sphere();
    this.object = new THREE.Points(geometry, material);
  }
  touch(): void {
    this.position.needsUpdate = this.info.needsUpdate = this.age.needsUpdate = true;
    this.box.getBoundingSphere(this.object.geometry.boundingSphere!);
  }
}

export class Cloud {
  readonly group = new THREE.Group();
  private readonly material = new THREE.ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: {
      size: {value: 20}, shownPart: {value: -1}, newest: {value: 1}, lastAge: {value: 1e9}, sparse: {value: 1},
      heights: {value: new THREE.Vector2(0, 1)}, mode: {value: 0},
    },
  });
  private chunks: Chunk[] = [];
  private slots = new Int32Array(1 << 16).fill(-1);  // by id
  private free: number[] = [];
  private used = 0;  // slots ever taken
  private parts: number[] = [];
  private share = 1;
  private newest = 1;  // age
  private boxOf = 0;   // number of points when `box` was found
  size = 0;
  /** Holds nine tenths of the points in each direction, in the picture's frame: y up. */
  readonly box = new THREE.Box3();

  clear(): void {
    for (const chunk of this.chunks) {
      this.group.remove(chunk.object);
      chunk.object.geometry.dispose();
    }
    this.chunks = [];
    this.slots.fill(-1);
    this.free = [];
    this.used = this.size = this.boxOf = 0;
    this.box.makeEmpty();
  }

  take(blocks: PointBlock[], gone: number[]): void {
    const touched = new Set<Chunk>();
    for (const id of gone) this.remove(id, touched);
    for (const block of blocks) {
      for (let i = 0; i < block.count; ++i) this.put(block, i * POINT_WORDS, touched);
    }
    for (const chunk of touched) chunk.touch();
    this.material.uniforms.newest.value = this.newest;
    if (this.size > 1.3 * this.boxOf) this.findBox();
  }

  private put(block: PointBlock, at: number, touched: Set<Chunk>): void {
    const {words, floats} = block;
    const slot = this.slotOf(words[at]);
    const chunk = this.chunks[slot >> CHUNK_BITS];
    const i = reversed(slot & (CHUNK - 1));
    const p = chunk.position.array;
    for (let k = 0; k < 3; ++k) p[3 * i + k] = floats[at + 1 + k];
    chunk.box.expandByPoint(scratch.fromArray(p, 3 * i));
    chunk.age.array[i] = words[at + 5];
    this.newest = Math.max(this.newest, words[at + 5]);
    const packed = words[at + 6];
    const info = chunk.info.array;  // written singly: an array for each of millions of points costs seconds
    info[4 * i] = packed & 0xff;
    info[4 * i + 1] = (packed >> 8) & 0xff;
    info[4 * i + 2] = this.partNumber(words[at + 4]);
    info[4 * i + 3] = 255;
    touched.add(chunk);
  }

  private remove(id: number, touched: Set<Chunk>): void {
    const slot = id < this.slots.length ? this.slots[id] : -1;
    if (slot < 0) return;
    this.slots[id] = -1;
    this.free.push(slot);
    --this.size;
    const chunk = this.chunks[slot >> CHUNK_BITS];
    chunk.info.array[4 * reversed(slot & (CHUNK - 1)) + 3] = 0;
    touched.add(chunk);
  }

  private slotOf(id: number): number {
    if (id >= this.slots.length) {
      const grown = new Int32Array(Math.max(2 * this.slots.length, id + 1)).fill(-1);
      grown.set(this.slots);
      this.slots = grown;
    }
    if (this.slots[id] >= 0) return this.slots[id];
    const slot = this.free.pop() ?? this.used++;
    if (slot >> CHUNK_BITS >= this.chunks.length) {
      const chunk = new Chunk(this.material);
      chunk.object.geometry.setDrawRange(0, Math.ceil(this.share * CHUNK));
      this.chunks.push(chunk);
      this.group.add(chunk.object);
    }
    this.slots[id] = slot;
    ++this.size;
    return slot;
  }

  private partNumber(part: number): number {
    const at = this.parts.indexOf(part);
    return Math.min(at >= 0 ? at : this.parts.push(part) - 1, 255);
  }

  /** All points are there: what was found on the way is found anew. */
  settle(): void {
    if (this.size > 0) this.findBox();
  }

  /** Leaves out the twentieth part of the points that is farthest out on each side. */
  private findBox(): void {
    this.boxOf = this.size;
    const sample: [number[], number[], number[]] = [[], [], []];
    this.visit((x, y, z) => [x, -y, -z].forEach((value, k) => sample[k].push(value)), 8192);
    for (const values of sample) values.sort((a, b) => a - b);
    const ends = (share: number) => new THREE.Vector3(...sample.map((values) => values[Math.floor(share * (values.length - 1))]));
    this.box.set(ends(0.05), ends(0.95));
    this.material.uniforms.heights.value.set(this.box.min.y, this.box.max.y);
  }

  /** Calls visit(x, y, z, anchor) for all points, in the map's frame, or for an even sample of `most` of them. */
  visit(visit: (x: number, y: number, z: number, anchor: number) => void, most = Infinity): void {
    const count = Math.ceil(CHUNK * Math.min(1, most / Math.max(1, this.size)));
    for (const chunk of this.chunks) {
      const p = chunk.position.array;
      const info = chunk.info.array;
      const age = chunk.age.array;
      for (let i = 0; i < count; ++i) {
        if (info[4 * i + 3] > 0) visit(p[3 * i], p[3 * i + 1], p[3 * i + 2], age[i]);
      }
    }
  }

  /** Share of the points that is drawn. */
  setShare(share: number): void {
    this.share = share;
    this.material.uniforms.sparse.value = 1 / Math.sqrt(Math.max(share, 0.1));
    for (const chunk of this.chunks) chunk.object.geometry.setDrawRange(0, Math.ceil(share * CHUNK));
  }
  setColouring(colouring: Colouring): void {
    this.material.uniforms.mode.value = COLOURINGS.indexOf(colouring);
  }
  /** Null: all parts. */
  showPart(part: number | null): void {
    this.material.uniforms.shownPart.value = part === null ? -1 : this.partNumber(part);
  }
  /** Points that were first seen in later keyframes are hidden. */
  showUntil(keyframe: number): void {
    this.material.uniforms.lastAge.value = keyframe;
  }
  setPointSize(size: number): void {
    this.material.uniforms.size.value = size;
  }
}

const scratch = new THREE.Vector3();
