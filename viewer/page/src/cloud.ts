// Millions of points, with levels of detail. A chunk holds neighbours (points are put in order along a curve through space
// whenever their number has doubled), and its first n points are an even sample of it: of chunks that look small, fewer are
// drawn, so that as many points as the machine can draw in time are spread over the picture.
import * as THREE from 'three';
import {POINT_WORDS, type PointBlock} from './wire.ts';

const CHUNK_BITS = 13;
const CHUNK = 1 << CHUNK_BITS;
const MOST_PARTS = 255;  // with a number of their own
const LEAST = 16;  // points of a chunk in view

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

/** The bits of a place in a chunk in reverse order: 0, 4096, 2048, ... */
const REVERSED = Uint16Array.from({length: CHUNK}, (_, n) => {
  let reversed = 0;
  for (let bit = 0; bit < CHUNK_BITS; ++bit) reversed |= ((n >> bit) & 1) << (CHUNK_BITS - 1 - bit);
  return reversed;
});

/** Ten bits, with two zeros after each. */
function spread(n: number): number {
  n = (n | (n << 16)) & 0x030000ff;
  n = (n | (n << 8)) & 0x0300f00f;
  n = (n | (n << 4)) & 0x030c30c3;
  return (n | (n << 2)) & 0x09249249;
}

const PAGE_BITS = 12;

/** Slots by id, in pages that go when nothing is in them any more: ids of long runs only grow. */
class Slots {
  private pages = new Map<number, {slots: Int32Array; used: number}>();
  private newest = -1;  // what was asked for last
  private page: {slots: Int32Array; used: number} | undefined;

  private find(id: number): {slots: Int32Array; used: number} | undefined {
    const number = id >>> PAGE_BITS;
    if (number !== this.newest) {
      this.newest = number;
      this.page = this.pages.get(number);
    }
    return this.page;
  }
  /** -1: none. */
  get(id: number): number {
    return this.find(id)?.slots[id & ((1 << PAGE_BITS) - 1)] ?? -1;
  }
  set(id: number, slot: number): void {
    let page = this.find(id);
    if (!page) {
      page = this.page = {slots: new Int32Array(1 << PAGE_BITS).fill(-1), used: 0};
      this.pages.set(this.newest, page);
    }
    const at = id & ((1 << PAGE_BITS) - 1);
    if (page.slots[at] < 0) ++page.used;
    page.slots[at] = slot;
  }
  remove(id: number): void {
    const page = this.find(id);
    if (!page) return;
    page.slots[id & ((1 << PAGE_BITS) - 1)] = -1;
    if (--page.used > 0) return;
    this.pages.delete(this.newest);
    this.page = undefined;
  }
}

class Chunk {
  /** Of the points, by slot. */
  readonly ids = new Uint32Array(CHUNK);
  count = 0;  // of points
  drawn = 0;  // places, the empty ones included
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
  private slots = new Slots();
  private free: number[] = [];
  private used = 0;  // slots ever taken
  private parts: number[] = [];
  private newest = 1;     // age
  private boxOf = 0;      // number of points when `box` was found
  private orderedOf = 0;  // likewise, when they were put in order
  size = 0;
  /** Holds nine tenths of the points in each direction, in the picture's frame: y up. */
  readonly box = new THREE.Box3();

  clear(): void {
    for (const chunk of this.chunks) {
      this.group.remove(chunk.object);
      chunk.object.geometry.dispose();
    }
    this.chunks = [];
    this.slots = new Slots();
    this.free = [];
    this.parts = [];
    this.used = this.size = this.boxOf = this.orderedOf = 0;
    this.newest = 1;
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
    if (this.size > Math.max(2 * this.orderedOf, 4 * CHUNK) && this.used <= SLOTS) this.order();
  }

  /** Neighbours into the same chunk: slots are given anew in Morton order. */
  private order(): void {
    this.orderedOf = this.size;
    const all = new THREE.Box3();
    for (const chunk of this.chunks) all.union(chunk.box);
    const low = all.min;
    const scale = 1023 / Math.max(all.max.x - low.x, all.max.y - low.y, all.max.z - low.z, 1e-6);
    const keys = new Float64Array(this.size);  // the place on the curve, 30 bits, and the slot, 23
    let at = 0;
    this.chunks.forEach((chunk, c) => {
      const p = chunk.position.array;
      for (let n = 0; n < CHUNK; ++n) {
        const i = REVERSED[n];
        if (chunk.info.array[4 * i + 3] === 0) continue;
        const x = spread(Math.round((p[3 * i] - low.x) * scale));
        const y = spread(Math.round((p[3 * i + 1] - low.y) * scale));
        const z = spread(Math.round((p[3 * i + 2] - low.z) * scale));
        keys[at++] = (x | (y << 1) | (z << 2)) * SLOTS + (c << CHUNK_BITS) + n;
      }
    });
    keys.sort();
    const old = this.chunks;
    for (const chunk of old) this.group.remove(chunk.object);
    this.chunks = [];
    this.free = [];
    this.used = this.size = 0;
    const touched = new Set<Chunk>();
    for (const key of keys) this.move(old, key % SLOTS, touched);
    for (const chunk of old) chunk.object.geometry.dispose();
    for (const chunk of touched) chunk.touch();
  }

  private move(old: Chunk[], slot: number, touched: Set<Chunk>): void {
    const from = old[slot >> CHUNK_BITS];
    const id = from.ids[slot & (CHUNK - 1)];
    const i = REVERSED[slot & (CHUNK - 1)];
    this.slots.remove(id);
    const there = this.slotOf(id);
    const to = this.chunks[there >> CHUNK_BITS];
    const k = REVERSED[there & (CHUNK - 1)];
    for (let n = 0; n < 3; ++n) to.position.array[3 * k + n] = from.position.array[3 * i + n];
    for (let n = 0; n < 4; ++n) to.info.array[4 * k + n] = from.info.array[4 * i + n];
    to.age.array[k] = from.age.array[i];
    to.box.expandByPoint(scratch.fromArray(to.position.array, 3 * k));
    touched.add(to);
  }

  private put(block: PointBlock, at: number, touched: Set<Chunk>): void {
    const {words, floats} = block;
    const slot = this.slotOf(words[at]);
    const chunk = this.chunks[slot >> CHUNK_BITS];
    const i = REVERSED[slot & (CHUNK - 1)];
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
    const slot = this.slots.get(id);
    if (slot < 0) return;
    this.slots.remove(id);
    this.free.push(slot);
    --this.size;
    const chunk = this.chunks[slot >> CHUNK_BITS];
    --chunk.count;
    chunk.info.array[4 * REVERSED[slot & (CHUNK - 1)] + 3] = 0;
    touched.add(chunk);
  }

  private slotOf(id: number): number {
    const known = this.slots.get(id);
    if (known >= 0) return known;
    const slot = this.free.pop() ?? this.used++;
    if (slot >> CHUNK_BITS >= this.chunks.length) {
      const chunk = new Chunk(this.material);
      chunk.object.geometry.setDrawRange(0, 0);
      this.chunks.push(chunk);
      this.group.add(chunk.object);
    }
    this.slots.set(id, slot);
    const chunk = this.chunks[slot >> CHUNK_BITS];
    chunk.ids[slot & (CHUNK - 1)] = id;
    ++chunk.count;
    ++this.size;
    return slot;
  }

  private partNumber(part: number): number {
    const at = this.parts.indexOf(part);
    return at >= 0 ? at : this.parts.length < MOST_PARTS ? this.parts.push(part) - 1 : MOST_PARTS;
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
    for (const chunk of this.chunks) visitFirst(chunk, count, () => true, visit);
  }

  /** For those that are in the picture, or would be if it showed all that it looks at. */
  visitShown(visit: (x: number, y: number, z: number, anchor: number) => void): void {
    if (!this.group.visible) return;
    const {lastAge, shownPart} = this.material.uniforms;
    const isShown = (age: number, part: number) => age <= lastAge.value && (shownPart.value < 0 || part === shownPart.value);
    for (const chunk of this.chunks) visitFirst(chunk, chunk.drawn, isShown, visit);
  }

  /**
   * Chooses what is drawn from where `camera` is: of each chunk in view as many points as its share of the picture is of
   * all shares, `budget` in all.
   * @param scale  of the picture: pixels that something of length one takes at distance one
   * @return how many are drawn
   */
  chooseDetail(camera: THREE.Camera, frustum: THREE.Frustum, scale: number, pixels: number, budget: number): number {
    const eye = scratch.setFromMatrixPosition(camera.matrixWorld);
    const seen: {chunk: Chunk; area: number}[] = [];
    let all = 0;
    for (const chunk of this.chunks) {
      sphere.copy(chunk.object.geometry.boundingSphere!).applyMatrix4(chunk.object.matrixWorld);
      chunk.drawn = 0;
      if (chunk.count === 0 || !frustum.intersectsSphere(sphere)) continue;
      const away = Math.max(eye.distanceTo(sphere.center), sphere.radius, 1e-6);
      seen.push({chunk, area: Math.min(pixels, Math.PI * ((scale * sphere.radius) / away) ** 2)});
      all += chunk.count;
    }
    const wanted = ({chunk, area}: {chunk: Chunk; area: number}, density: number) => Math.min(chunk.count, LEAST + density * area);
    let density = Infinity;
    if (all > budget) {
      let [low, high] = [0, 64];  // points a pixel
      for (let step = 0; step < 30; ++step) {
        density = 0.5 * (low + high);
        if (seen.reduce((sum, one) => sum + wanted(one, density), 0) > budget) high = density;
        else low = density;
      }
    }
    let drawn = 0;
    for (const one of seen) {
      const count = wanted(one, density);
      drawn += count;
      one.chunk.drawn = count >= one.chunk.count ? CHUNK : Math.ceil((CHUNK * count) / one.chunk.count);
    }
    for (const chunk of this.chunks) chunk.object.geometry.setDrawRange(0, chunk.drawn);
    this.material.uniforms.sparse.value = 1 / Math.sqrt(Math.max(drawn / Math.max(1, all), 0.1));
    return Math.round(drawn);
  }

  /** Lowest and highest value of what the colours stand for: heights, up; null where there are none. */
  get heights(): [number, number] {
    const {x, y} = this.material.uniforms.heights.value as THREE.Vector2;
    return [x, y];
  }
  get newestAge(): number {
    return this.newest;
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

const SLOTS = 1 << 23;  // eight million points
const scratch = new THREE.Vector3();
const sphere = new THREE.Sphere();

/** Of a chunk's points the first `count` places. */
function visitFirst(chunk: Chunk, count: number, isShown: (age: number, part: number) => boolean,
  visit: (x: number, y: number, z: number, anchor: number) => void): void {
  const p = chunk.position.array;
  const info = chunk.info.array;
  const age = chunk.age.array;
  for (let i = 0; i < count; ++i) {
    if (info[4 * i + 3] > 0 && isShown(age[i], info[4 * i + 2])) visit(p[3 * i], p[3 * i + 1], p[3 * i + 2], age[i]);
  }
}

/** 0 to 1 as the points are coloured, as CSS has it: for the bar beside them. */
export function colourBar(steps = 12): string {
  const at = (x: number) => {
    const powers = [1, x, x * x, x ** 3, x ** 4, x ** 5];
    const sum = (c: number[]) => c.reduce((total, value, n) => total + value * powers[n], 0);
    const rgb = [
      sum([0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943]),
      sum([0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604]),
      sum([0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973]),
    ];
    return `rgb(${rgb.map((value) => Math.round(255 * (0.12 * 0.75 + 0.88 * Math.min(1, Math.max(0, value))))).join(' ')})`;
  };
  return `linear-gradient(90deg, ${Array.from({length: steps + 1}, (_, n) => at(0.13 + (0.8 * n) / steps)).join(', ')})`;
}
