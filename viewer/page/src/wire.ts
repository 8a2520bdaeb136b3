// The server's messages (viewer/wire_format.hpp), decoded. Arrays of points are views of the message.

export const PROTOCOL = 5;
export const NO_ID = 0xffffffff;

export interface Keyframe {
  id: number;
  part: number;
  frame: number;
  t: number;
  position: [number, number, number];
  orientation: [number, number, number, number];
  points: number;
  window: number;
  hasPlace: boolean;
}

export interface Edge {
  from: number;
  to: number;
  sharedPoints: number;
  marginalised: boolean;
  /** 0: none, 1: closes a loop that was recognised, 2: and joined two map parts. */
  loop: number;
}

export const enum State {
  tracked = 0,
  lost = 1,
  unplaced = 2,
  /** Never looked at: its successor was there. */
  dropped = 3,
}

interface Frame {
  frame: number;
  t: number;
  reference: number;
  part: number;
  state: State;
  reason: number;
  keyframe: boolean;
  effort: number;
  latencyMs: number;
}

export interface PathFrame extends Frame {
  causal: [number, number, number];
  inReference: [number, number, number];
  turned: [number, number, number, number];
  /** That the tracker worked on it; 0: not known. */
  trackingMs: number;
}

export interface LiveFrame extends Frame {
  position: [number, number, number];
  orientation: [number, number, number, number];
  trackedShare: number;
  points: number;
  mapVersion: number;
  stageMs: number[];
  /** For the mapper; null, as of the others: not known. */
  keyframesWaiting: number | null;
  /** For the tracker. */
  framesWaiting: number | null;
  /** Keyframes that wait for the loop closer. */
  placesWaiting: number | null;
  /** So far: they came and were not tracked. */
  framesDropped: number | null;
  /** So far: they never came, the camera lost them. */
  framesLost: number | null;
}

/** Points as they came: each POINT_WORDS words, as whole numbers and as floating-point ones. */
export interface PointBlock {
  count: number;
  words: Uint32Array;
  floats: Float32Array;
}
export const POINT_WORDS = 7;

export interface Delta {
  kind: 'delta';
  whole: boolean;
  last: boolean;
  from: number;
  to: number;
  points: PointBlock[];
  pointsGone: number[];
  keyframes: Keyframe[];
  keyframesGone: number[];
  edges: Edge[];
  edgesGone: {from: number; to: number}[];
  path: PathFrame[];
  pathGone: number[];
}
export interface Frames {
  kind: 'frames';
  frames: LiveFrame[];
}
export interface Image {
  kind: 'image';
  frame: number;
  width: number;
  height: number;
  jpeg: Uint8Array<ArrayBuffer>;
}

/** What the camera saw at a keyframe; no bytes: nobody knows. */
export interface KeyframeImage {
  kind: 'keyframe image';
  keyframe: number;
  jpeg: Uint8Array<ArrayBuffer>;
}

/** A point of the map as it was found in the image. */
export interface MeasuredPoint {
  u: number;
  v: number;
  expectedU: number;
  expectedV: number;
  inlier: boolean;
  /** Where it was searched: a square around this, half of whose side is the radius; 0: not known. */
  predictedU: number;
  predictedV: number;
  radius: number;
}
export interface Measured {
  kind: 'measured';
  frame: number;
  points: MeasuredPoint[];
}
export type Binary = Delta | Frames | Image | KeyframeImage | Measured | SurfaceMessage;

const HEADER = 16;
const SIZES = {keyframe: 52, edge: 12, path: 60, live: 116, measured: 32};

class Reader {
  readonly view: DataView;
  at = HEADER;
  constructor(readonly buffer: ArrayBuffer) {
    this.view = new DataView(buffer);
  }
  u8 = (offset: number) => this.view.getUint8(this.at + offset);
  u16 = (offset: number) => this.view.getUint16(this.at + offset, true);
  i16 = (offset: number) => this.view.getInt16(this.at + offset, true);
  u32 = (offset: number) => this.view.getUint32(this.at + offset, true);
  /** Null: not known. */
  known = (offset: number) => (this.u32(offset) === NO_ID ? null : this.u32(offset));
  f32 = (offset: number) => this.view.getFloat32(this.at + offset, true);
  xyz = (o: number): [number, number, number] => [this.f32(o), this.f32(o + 4), this.f32(o + 8)];
  xyzw = (o: number): [number, number, number, number] => [this.f32(o), this.f32(o + 4), this.f32(o + 8), this.f32(o + 12)];

  /** What is left is told by nobody: the message is of another version, or damaged. */
  expectEnd(): void {
    if (this.at !== this.buffer.byteLength) throw new Error(`a message is ${this.buffer.byteLength - this.at} bytes too long`);
  }

  expect(bytes: number): void {
    if (this.at + bytes > this.buffer.byteLength) throw new Error('a message ends within a record');
  }

  list<T>(count: number, size: number, read: () => T): T[] {
    this.expect(count * size);
    const records: T[] = [];
    for (let i = 0; i < count; ++i, this.at += size) records.push(read());
    return records;
  }
}

function keyframe(r: Reader): Keyframe {
  return {
    id: r.u32(0), part: r.u32(4), frame: r.u32(8), t: r.f32(12), position: r.xyz(16), orientation: r.xyzw(28),
    points: r.u32(44), window: r.u8(48), hasPlace: r.u8(49) !== 0,
  };
}

function edge(r: Reader): Edge {
  return {from: r.u32(0), to: r.u32(4), sharedPoints: r.u16(8), marginalised: r.u8(10) !== 0, loop: r.u8(11)};
}

function frame(r: Reader, latencyAt: number): Frame {
  return {
    frame: r.u32(0), t: r.f32(4), reference: r.u32(8), part: r.u32(12), state: r.u8(16), reason: r.u8(17),
    keyframe: r.u8(18) !== 0, effort: r.u8(19), latencyMs: r.f32(latencyAt),
  };
}

function pathFrame(r: Reader): PathFrame {
  return {
    ...frame(r, 20), causal: r.xyz(24), inReference: r.xyz(36),
    turned: [r.i16(48) / 32767, r.i16(50) / 32767, r.i16(52) / 32767, r.i16(54) / 32767], trackingMs: r.f32(56),
  };
}

function liveFrame(r: Reader): LiveFrame {
  return {
    ...frame(r, 56), position: r.xyz(20), orientation: r.xyzw(32), trackedShare: r.f32(48), points: r.u32(52),
    mapVersion: r.u32(60),
    stageMs: Array.from({length: 8}, (_, s) => r.f32(64 + 4 * s)), keyframesWaiting: r.known(96),
    framesWaiting: r.known(100), placesWaiting: r.known(104), framesDropped: r.known(108), framesLost: r.known(112),
  };
}

function measuredPoint(r: Reader): MeasuredPoint {
  return {u: r.f32(0), v: r.f32(4), expectedU: r.f32(8), expectedV: r.f32(12), inlier: r.u32(16) !== 0,
    predictedU: r.f32(20), predictedV: r.f32(24), radius: r.f32(28)};
}

function pointBlock(r: Reader, count: number): PointBlock {
  r.expect(4 * count * POINT_WORDS);
  const words = new Uint32Array(r.buffer, r.at, count * POINT_WORDS);
  const floats = new Float32Array(r.buffer, r.at, count * POINT_WORDS);
  r.at += 4 * count * POINT_WORDS;
  return {count, words, floats};
}

function decodeDelta(r: Reader, flags: number, from: number, to: number): Delta {
  const delta: Delta = {
    kind: 'delta', whole: (flags & 1) !== 0, last: (flags & 2) !== 0, from, to, points: [], pointsGone: [],
    keyframes: [], keyframesGone: [], edges: [], edgesGone: [], path: [], pathGone: [],
  };
  const key = () => r.u32(0);
  while (r.at < r.buffer.byteLength) {
    r.expect(8);
    const block = r.u32(0);
    const count = r.u32(4);
    r.at += 8;
    switch (block) {
      case 1: delta.points.push(pointBlock(r, count)); break;
      case 2: delta.pointsGone.push(...r.list(count, 4, key)); break;
      case 3: delta.keyframes.push(...r.list(count, SIZES.keyframe, () => keyframe(r))); break;
      case 4: delta.keyframesGone.push(...r.list(count, 4, key)); break;
      case 5: delta.edges.push(...r.list(count, SIZES.edge, () => edge(r))); break;
      case 6: delta.edgesGone.push(...r.list(count, 8, () => ({from: r.u32(4), to: r.u32(0)}))); break;
      case 7: delta.path.push(...r.list(count, SIZES.path, () => pathFrame(r))); break;
      case 8: delta.pathGone.push(...r.list(count, 4, key)); break;
      default: throw new Error(`unknown block ${block}`);
    }
  }
  return delta;
}

/** A message that has nothing behind what it says it has. */
function whole<Message extends Binary>(r: Reader, message: Message): Message {
  r.expectEnd();
  return message;
}

/** A piece of the mesh, in the cell's place. */
export interface SurfacePiece {
  cell: [number, number, number];
  /** x, y, z */
  positions: Float32Array;
  /** x, y, z times 127, 0 */
  normals: Int8Array;
  /** red, green, blue, 255 */
  colours: Uint8Array;
  /** Three of each triangle: numbers of vertices. */
  corners: Uint16Array;
}
export interface SurfaceMessage {
  kind: 'surface';
  /** All that was there before is gone. */
  whole: boolean;
  part: number;
  pieces: SurfacePiece[];
}

const SURFACE_VERTEX = 12;

function surfacePiece(r: Reader, edge: number): SurfacePiece {
  r.expect(20);
  const cell = [0, 4, 8].map((at) => r.view.getInt32(r.at + at, true)) as [number, number, number];
  const vertices = r.u32(12);
  const triangles = r.u32(16);
  r.at += 20;
  r.expect(vertices * SURFACE_VERTEX + 2 * 3 * triangles);
  const positions = new Float32Array(3 * vertices);
  const normals = new Int8Array(4 * vertices);
  const colours = new Uint8Array(4 * vertices).fill(255);
  for (let v = 0; v < vertices; ++v, r.at += SURFACE_VERTEX) {
    for (let a = 0; a < 3; ++a) {
      positions[3 * v + a] = edge * (cell[a] + (2 * r.u16(2 * a)) / 65535 - 0.5);
      normals[4 * v + a] = r.view.getInt8(r.at + 6 + a);
      colours[4 * v + a] = r.u8(9 + a);
    }
  }
  const corners = new Uint16Array(r.buffer.slice(r.at, r.at + 6 * triangles));
  for (const corner of corners) if (corner >= vertices) throw new Error('a triangle without one of its vertices');
  r.at += 6 * triangles + (triangles % 2 === 1 ? 2 : 0);
  return {cell, positions, normals, colours, corners};
}

function decodeSurface(r: Reader, flags: number, count: number, part: number): SurfaceMessage {
  r.expect(8);
  const edge = r.f32(0);
  if (!(edge > 0 && Number.isFinite(edge))) throw new Error('a surface of cells without an edge');
  r.at += 8;
  const pieces: SurfacePiece[] = [];
  for (let n = 0; n < count; ++n) pieces.push(surfacePiece(r, edge));
  return whole(r, {kind: 'surface', whole: (flags & 1) !== 0, part, pieces});
}

export function decode(buffer: ArrayBuffer): Binary {
  if (buffer.byteLength < HEADER) throw new Error('a message ends within its header');
  const header = new DataView(buffer);
  const [kind, number, a, b] = [0, 4, 8, 12].map((at) => header.getUint32(at, true));
  const reader = new Reader(buffer);
  switch (kind) {
    case 1: return decodeDelta(reader, number, a, b);
    case 2: return whole(reader, {kind: 'frames', frames: reader.list(number, SIZES.live, () => liveFrame(reader))});
    case 3: return {kind: 'image', frame: number, width: a, height: b, jpeg: new Uint8Array(buffer, HEADER)};
    case 4: return whole(reader, {kind: 'measured', frame: number, points: reader.list(a, SIZES.measured, () => measuredPoint(reader))});
    case 5: return {kind: 'keyframe image', keyframe: number, jpeg: new Uint8Array(buffer, HEADER)};
    case 6: return decodeSurface(reader, number, a, b);
    default: throw new Error(`unknown message ${kind}`);
  }
}

// Text messages.

export interface Rig {
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
}
export interface Hello {
  protocol: number;
  title: string;
  rig: Rig | null;
  stages: string[];
  live: boolean;
  kind: 'live' | 'finished' | 'map';
  /** Lengths are metres, not of one camera's own unit. */
  metres: boolean;
  hasDeviations: boolean;
  /** Points' anchors say when they were first seen. */
  hasFirstSeen: boolean;
  hasObservers: boolean;
  /** Frames say how long they took. */
  hasTimes: boolean;
  hasQueues: boolean;
  /** Words of the effort levels. */
  efforts: string[];
  /** Whose pace the run keeps: 'camera', 'recording'; empty: it keeps none. */
  pacedBy: string;
  /** Commands are obeyed. */
  control: boolean;
  /** Images of keyframes can be asked for. */
  keyframeImages: boolean;
  periodMs: number;
}
export interface Truth {
  part: number;
  /** Lengths as they are shown over the true ones; one camera has a unit of its own. */
  scale: number;
  /** t, x, y, z */
  path: [number, number, number, number][];
}
/** A place that was recognised: keyframe `to` came back to what `from` saw. */
export interface Loop {
  from: number;
  to: number;
  joinsParts: boolean;
  /** Lengths now over lengths then: how far the unit of one camera has drifted. 1 for others. */
  scale: number;
  inliers: number;
  travelled: number;
}
export interface MapEvent {
  kind: string;
  text: string;
  frame: number;
  t: number;
  keyframe: number;
  partBefore: number;
  part: number;
  moved: number;
  turned: number;
  before: [number, number, number];
  after: [number, number, number];
  loop: Loop | null;
  /** Of corrections of one camera's map: lengths around the camera now over lengths before. */
  scale: number | null;
}
export interface Text {
  hello?: Hello;
  state?: {mappingPaused: boolean};
  reasons?: string[];
  truth?: Truth;
  events?: MapEvent[];
  status?: {ended: boolean; message: string};
}
