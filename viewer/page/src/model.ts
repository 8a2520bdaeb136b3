// What the page knows of the run, apart from its points: keyframes, edges, path, events, newest frames.
import {NO_ID, State, type Delta, type Edge, type Hello, type Keyframe, type LiveFrame, type MapEvent, type PathFrame, type Truth} from './wire.ts';

const LIVE_KEPT = 600;
const EVENTS_KEPT = 4096;

/** Position and orientation of a camera in the world of its part. */
export interface CameraPose {
  position: [number, number, number];
  orientation: [number, number, number, number];
  part: number;
}

function turn(q: readonly number[], v: readonly number[]): [number, number, number] {
  const [x, y, z, w] = q;
  const tx = 2 * (y * v[2] - z * v[1]);
  const ty = 2 * (z * v[0] - x * v[2]);
  const tz = 2 * (x * v[1] - y * v[0]);
  return [v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx];
}

function multiply(a: readonly number[], b: readonly number[]): [number, number, number, number] {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  return [
    aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
  ];
}

export class Model {
  hello: Hello | null = null;
  reasons: string[] = [''];
  truth: Truth | null = null;
  events: MapEvent[] = [];
  keyframes = new Map<number, Keyframe>();
  edges = new Map<string, Edge>();
  path: PathFrame[] = [];
  live: LiveFrame[] = [];
  mapVersion = 0;
  mappingPaused = false;
  /** When frames came last, by the page's clock [ms]; null: none have. */
  liveAt: number | null = null;
  private revision = 0;  // of the scene

  get isMetric(): boolean {
    return this.hello?.metres ?? true;
  }

  clear(): void {
    this.keyframes.clear();
    this.edges.clear();
    this.path = [];
  }

  /** Of a new connection: events and frames come again. */
  forget(): void {
    this.events = [];
    this.live = [];
    this.truth = null;
    this.liveAt = null;
  }

  addEvents(events: MapEvent[]): void {
    this.events.push(...events);
    if (this.events.length > EVENTS_KEPT) this.events.splice(0, this.events.length - EVENTS_KEPT);
  }

  take(delta: Delta): void {
    if (delta.whole) this.clear();
    else if (delta.from !== this.revision) throw new Error(`what changed since revision ${delta.from} came to one that has ${this.revision}`);
    this.revision = delta.last ? delta.to : delta.from;
    for (const id of delta.keyframesGone) this.keyframes.delete(id);
    for (const keyframe of delta.keyframes) this.keyframes.set(keyframe.id, keyframe);
    for (const gone of delta.edgesGone) this.edges.delete(`${gone.from}-${gone.to}`);
    for (const edge of delta.edges) this.edges.set(`${edge.from}-${edge.to}`, edge);
    if (delta.pathGone.length > 0) {
      const gone = new Set(delta.pathGone);
      this.path = this.path.filter((frame) => !gone.has(frame.frame));
    }
    for (const frame of delta.path) this.put(frame);
  }

  private put(frame: PathFrame): void {
    const last = this.path.at(-1);
    if (last === undefined || last.frame < frame.frame) {
      this.path.push(frame);
      return;
    }
    const at = this.indexOf((other) => other.frame >= frame.frame);
    if (this.path[at].frame === frame.frame) this.path[at] = frame;
    else this.path.splice(at, 0, frame);
  }

  /** First frame of the path for which `reached` holds; it holds for all after it. */
  indexOf(reached: (frame: PathFrame) => boolean): number {
    let low = 0;
    let high = this.path.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (reached(this.path[middle])) high = middle;
      else low = middle + 1;
    }
    return low;
  }

  addLive(frames: LiveFrame[]): void {
    this.liveAt = performance.now();
    this.live.push(...frames);
    if (this.live.length > LIVE_KEPT) this.live.splice(0, this.live.length - LIVE_KEPT);
    const newest = frames.at(-1);
    if (newest) this.mapVersion = newest.mapVersion;
  }

  /** Where the frame was as the map has it now. */
  finalPosition(frame: PathFrame): [number, number, number] {
    const reference = this.keyframes.get(frame.reference);
    if (reference === undefined) return frame.causal;
    const p = turn(reference.orientation, frame.inReference);
    return [p[0] + reference.position[0], p[1] + reference.position[1], p[2] + reference.position[2]];
  }

  finalPose(frame: PathFrame): CameraPose {
    const reference = this.keyframes.get(frame.reference);
    const orientation = reference ? multiply(reference.orientation, frame.turned) : frame.turned;
    return {position: this.finalPosition(frame), orientation, part: this.partOf(frame)};
  }

  /** Under its present name: a part that joined another one has that one's. */
  partOf(frame: PathFrame): number {
    return this.keyframes.get(frame.reference)?.part ?? frame.part;
  }

  /** The newest tracked frame. */
  newestTracked(): LiveFrame | null {
    return this.live.findLast((frame) => frame.state === State.tracked) ?? null;
  }

  /** The last tracked frame up to a time. */
  frameAt(t: number): PathFrame | null {
    for (let i = this.indexOf((frame) => frame.t > t) - 1; i >= 0; --i) {
      if (this.path[i].state === State.tracked) return this.path[i];
    }
    return null;
  }

  endTime(): number {
    return Math.max(this.path.at(-1)?.t ?? 0, this.live.at(-1)?.t ?? 0);
  }

  /** Number and keyframes of each part, the largest first. */
  parts(): [number, number][] {
    const counts = new Map<number, number>();
    for (const keyframe of this.keyframes.values()) counts.set(keyframe.part, (counts.get(keyframe.part) ?? 0) + 1);
    return [...counts].sort((a, b) => b[1] - a[1]);
  }

  neighbours(id: number): Edge[] {
    return [...this.edges.values()].filter((edge) => edge.from === id || edge.to === id);
  }

  /** What a frame may take: the usual time between two. */
  periodMs(): number {
    if (this.hello?.periodMs) return this.hello.periodMs;
    const steps: number[] = [];
    for (let i = Math.max(1, this.live.length - 60); i < this.live.length; ++i)
      steps.push((1000 * (this.live[i].t - this.live[i - 1].t)) / Math.max(1, this.live[i].frame - this.live[i - 1].frame));
    for (let i = Math.max(1, this.path.length - 60); steps.length < 30 && i < this.path.length; ++i)
      steps.push((1000 * (this.path[i].t - this.path[i - 1].t)) / Math.max(1, this.path[i].frame - this.path[i - 1].frame));
    steps.sort((a, b) => a - b);
    return steps[steps.length >> 1] ?? 0;
  }

  static isKnown(id: number): boolean {
    return id !== NO_ID;
  }
}
