// The picture: map, windows, edges, paths, camera; drawn when something has changed.
import * as THREE from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {Cloud} from './cloud.ts';
import {WideLines, type Segments} from './lines.ts';
import type {CameraPose, Model} from './model.ts';
import {PALETTES, eventColour, type Palette, type Theme} from './palette.ts';
import {Surface} from './surface.ts';
import {State, type Keyframe, type MapEvent, type PathFrame} from './wire.ts';

export type View = 'follow' | 'top' | 'free';
export type Layer = 'points' | 'surface' | 'keyframes' | 'covisible' | 'marginalised' | 'returns' | 'causal' | 'final' | 'truth' | 'grid';
export type Picked = {keyframe: Keyframe} | {point: THREE.Vector3} | null;

const SLOW_MS = 45;
const FAST_MS = 38;
const SURFACE_MS = 6;         // of a picture, for the surface to be made anew; a fifth where pictures take longer
const FIRST_BUDGET = 200000;  // points
const LEAST_BUDGET = 10000;
const SOFTWARE_MS = 33;  // between frames that no graphics processor draws: the tracker may want the same processors
const MOST_PATH = 20000;  // segments drawn of a path
const MOST_FRUSTA = 1200;  // outside of the windows: of more, an even sample is drawn
const MOST_EDGES = 4000;   // likewise, but for closed loops

export class Stage {
  readonly cloud = new Cloud();
  readonly surface = new Surface();
  readonly layers: Record<Layer, boolean> = {
    points: true, surface: true, keyframes: true, covisible: true, marginalised: true, returns: true, causal: true, final: true, truth: true, grid: true,
  };
  view: View = 'follow';
  /** Seconds; null: now. */
  time: number | null = null;
  part: number | null = null;
  selected: number | null = null;
  measured: THREE.Vector3[] = [];
  /** That is looked at. */
  event: MapEvent | null = null;
  drawn = 0;
  frameMs = 16;

  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(50, 1, 0.02, 5000);
  private readonly controls: OrbitControls;
  private readonly world = new THREE.Group();  // the map's frame: y down, z forward
  private readonly final = new WideLines(3, 3);
  private readonly causal = new WideLines(1.6, 2);
  private readonly truth = new WideLines(1.5, 1, 0.7);
  private readonly windows = new WideLines(1.8, 4);
  private readonly body = new WideLines(3, 6);
  private readonly tape = new WideLines(3, 7);
  private readonly keyframes = new WideLines(1, 0, 0.8);
  private readonly edges = new WideLines(1, 0, 0.25);
  private readonly returns = new WideLines(2.2, 5);
  private readonly grid = new WideLines(1, -1);
  private palette: Palette = PALETTES.dark;
  private dirty = true;
  private lines = true;  // to be made anew
  private path = true;   // likewise, alone
  private frustum = 0.1;
  private extent = {size: 2, centre: new THREE.Vector3(), lowest: -1};
  drawnPoints = 0;
  private keyframeStep = 1;
  private budget = FIRST_BUDGET;  // points that can be drawn in time
  private readonly leastMs: number;  // between two frames
  private begun = 0;                 // the newest frame
  private fence: WebGLSync | null = null;  // of the frame that is being drawn
  private readonly target = new THREE.Vector3();
  private moved = false;  // by hand

  constructor(private readonly canvas: HTMLCanvasElement, context: WebGL2RenderingContext, private readonly model: Model) {
    this.renderer = new THREE.WebGLRenderer({canvas, context});
    this.renderer.debug.checkShaderErrors = false;  // each question waits for the compiler
    const slow = drawsInSoftware(this.renderer.getContext());
    this.leastMs = slow ? SOFTWARE_MS : 0;
    this.renderer.setPixelRatio(slow ? 1 : Math.min(Math.max(devicePixelRatio, 1.5), 2));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.redraw());
    this.controls.addEventListener('start', () => (this.moved = true));
    this.world.rotation.x = Math.PI;
    this.world.add(this.surface.group, this.cloud.group, this.edges.object, this.keyframes.object, this.truth.object, this.causal.object,
      this.final.object, this.windows.object, this.returns.object, this.body.object, this.tape.object);
    this.scene.add(this.world, this.grid.object);
    for (const lines of [this.final, this.causal, this.truth, this.windows, this.returns, this.body, this.tape]) lines.object.material.depthTest = false;
    this.renderer.compile(this.scene, this.camera);  // goes on while the page is made
    this.setTheme('dark');
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.setView('follow');
    requestAnimationFrame((now) => this.frame(now));
  }

  setTheme(theme: Theme): void {
    this.palette = PALETTES[theme];
    this.renderer.setClearColor(this.palette.background);
    this.changed();
  }

  setView(view: View): void {
    this.view = view;
    this.moved = false;
    this.controls.minPolarAngle = 0;
    this.controls.maxPolarAngle = view === 'top' ? 0.001 : Math.PI;
    this.redraw();
  }

  /** The model has changed: lines are made anew with the next frame. */
  changed(): void {
    this.lines = true;
    this.dirty = true;
  }
  /** Nothing but the path has. */
  pathGrew(): void {
    this.path = true;
    this.dirty = true;
  }
  redraw(): void {
    this.dirty = true;
  }

  /** The camera's pose at the time shown. */
  pose(): CameraPose | null {
    if (this.time !== null) {
      const frame = this.model.frameAt(this.time);
      return frame ? this.model.finalPose(frame) : null;
    }
    const live = this.model.newestTracked();
    if (live) return live;
    const last = this.model.frameAt(Infinity);
    return last ? this.model.finalPose(last) : null;
  }
  /** Its position in the picture's frame: y up. */
  private here(): THREE.Vector3 | null {
    const pose = this.pose();
    return pose && this.isShown(pose.part) ? up(pose.position) : null;
  }

  isShown(part: number): boolean {
    return this.part === null || part === this.part;
  }

  private resize(): void {
    const {clientWidth, clientHeight} = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (this.drawn > 0) this.renderer.render(this.scene, this.camera);  // a canvas of another size is empty until then
    this.dirty = true;
  }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    if (!this.isDrawn(now) || !this.dirty || now - this.begun < this.leastMs) return;
    this.dirty = false;
    this.begun = now;
    if (this.lines) this.makeLines();
    else if (this.path) this.makePaths();
    this.lines = this.path = false;
    this.surface.group.visible = this.layers.surface && this.isShown(this.surface.part);
    if (this.surface.update(Math.max(SURFACE_MS, 0.2 * this.frameMs))) this.dirty = true;
    this.makeBody();
    this.aim();
    this.chooseDetail();
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    ++this.drawn;
  }

  /** The frame before is through: frames that pile up would hold up whatever else the browser draws. */
  private isDrawn(now: number): boolean {
    if (!this.fence) return true;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    if (gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(this.fence);
    this.fence = null;
    this.pace(now - this.begun);
    return true;
  }

  /** A machine that cannot draw twenty frames a second draws fewer points; one at rest draws all. */
  private pace(took: number): void {
    this.frameMs += 0.2 * (took - this.frameMs);
    if (Math.min(took, this.frameMs) > SLOW_MS) this.budget = Math.max(LEAST_BUDGET, Math.max(0.5, SLOW_MS / took) * Math.min(this.budget, this.drawnPoints));
    else if (this.frameMs < FAST_MS) this.budget = Math.min(1.1 * this.budget, Math.max(FIRST_BUDGET, this.cloud.size));
  }

  /** Of the points in view, those that can be drawn in time. */
  private chooseDetail(): void {
    this.camera.updateMatrixWorld();
    this.world.updateMatrixWorld();
    const {clientHeight: height} = this.canvas;
    const scale = (0.5 * height) / Math.tan((this.camera.fov * Math.PI) / 360);
    const frustum = new THREE.Frustum().setFromProjectionMatrix(
      new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse));
    this.drawnPoints = this.cloud.chooseDetail(this.camera, frustum, scale, height * height * this.camera.aspect, this.budget);
  }

  private makeLines(): void {
    this.extent = this.findExtent();
    this.frustum = this.frustumSize();
    this.makePaths();
    this.makeKeyframes();
    this.makeEdges();
    this.makeTruth();
    this.makeTape();
    this.makeGrid();
    this.cloud.group.visible = this.layers.points;
    this.cloud.showPart(this.part);
    this.cloud.showUntil(this.time === null ? 1e9 : this.lastKeyframe(this.time));
  }

  private lastKeyframe(time: number): number {
    let last = 0;
    for (const keyframe of this.model.keyframes.values()) if (keyframe.t <= time && keyframe.id > last) last = keyframe.id;
    return last;
  }

  /** Half of the usual distance between keyframes that follow each other. */
  private frustumSize(): number {
    const steps: number[] = [];
    let last: Keyframe | null = null;
    for (const keyframe of this.model.keyframes.values()) {
      if (last && last.part === keyframe.part) steps.push(distance(last.position, keyframe.position));
      last = keyframe;
    }
    if (steps.length === 0) return this.frustum;
    steps.sort((a, b) => a - b);
    return Math.max(0.03, 0.55 * steps[steps.length >> 1], 0.006 * this.extent.size);
  }

  private makePaths(): void {
    const end = this.time === null ? this.model.path.length : this.model.indexOf((frame) => frame.t > this.time!);
    const step = Math.max(1, Math.ceil(end / MOST_PATH));
    const final = this.final.begin();
    const causal = this.causal.begin();
    let last: PathFrame | null = null;
    let lastFinal: number[] = [];
    for (let i = 0; i < end; i += step) {
      const frame = this.model.path[i];
      const part = this.model.partOf(frame);
      if (frame.state !== State.tracked || !this.isShown(part)) {
        last = null;
        continue;
      }
      const position = this.model.finalPosition(frame);
      if (last && this.model.partOf(last) === part) final.add(lastFinal, position, this.palette.final);
      if (last && last.part === frame.part) causal.add(last.causal, frame.causal, this.palette.causal);
      last = frame;
      lastFinal = position;
    }
    this.final.end();
    this.causal.end();
    this.final.object.visible = this.layers.final;
    this.causal.object.visible = this.layers.causal;
  }

  private corners(scale: number): number[][] {
    const rig = this.model.hello?.rig ?? {width: 4, height: 3, fx: 4, fy: 4, cx: 1.5, cy: 1};
    return [[0, 0], [rig.width, 0], [rig.width, rig.height], [0, rig.height]].map(([u, v]) =>
      [((u - rig.cx) / rig.fx) * scale, ((v - rig.cy) / rig.fy) * scale, scale]);
  }

  private addFrustum(to: Segments, pose: CameraPose | Keyframe, scale: number, colour: THREE.Color): void {
    const q = new THREE.Quaternion(...pose.orientation);
    const ends = this.corners(scale).map((c) => new THREE.Vector3(...c).applyQuaternion(q).toArray().map((x, k) => x + pose.position[k]));
    for (let i = 0; i < 4; ++i) {
      to.add(pose.position, ends[i], colour);
      to.add(ends[i], ends[(i + 1) % 4], colour);
    }
  }

  private isDrawnKeyframe(keyframe: Keyframe): boolean {
    const isOneOfMany = keyframe.window === 0 && keyframe.id !== this.selected && keyframe.id % this.keyframeStep !== 0;
    return !isOneOfMany && this.isShown(keyframe.part) && (this.time === null || keyframe.t <= this.time);
  }

  private makeKeyframes(): void {
    this.keyframeStep = Math.max(1, Math.ceil(this.model.keyframes.size / MOST_FRUSTA));
    const windows = this.windows.begin();
    const others = this.keyframes.begin();
    for (const keyframe of this.model.keyframes.values()) {
      if (!this.isDrawnKeyframe(keyframe)) continue;
      const isSelected = keyframe.id === this.selected;
      const colour = [this.palette.keyframe, this.palette.inner, this.palette.outer][keyframe.window];
      if (isSelected) this.addFrustum(windows, keyframe, 1.3 * this.frustum, this.palette.selected);
      else this.addFrustum(keyframe.window === 0 ? others : windows, keyframe, this.frustum, colour);
    }
    this.windows.end();
    this.keyframes.end();
    this.windows.object.visible = this.keyframes.object.visible = this.layers.keyframes;
  }

  private makeEdges(): void {
    const segments = this.edges.begin();
    const returns = this.returns.begin();
    const step = Math.max(1, Math.ceil(this.model.edges.size / MOST_EDGES));
    let n = 0;
    for (const edge of this.model.edges.values()) {
      if (n++ % step !== 0 && edge.loop === 0) continue;
      const from = this.model.keyframes.get(edge.from);
      const to = this.model.keyframes.get(edge.to);
      if (!from || !to || !this.isShown(from.part) || from.part !== to.part) continue;
      if (this.time !== null && Math.max(from.t, to.t) > this.time) continue;
      const layer = edge.loop > 0 ? 'returns' : edge.marginalised ? 'marginalised' : 'covisible';
      if (!this.layers[layer]) continue;
      const colour = layer === 'returns' ? this.palette.back : this.palette[layer];
      (layer === 'returns' ? returns : segments).add(from.position, to.position, colour);
    }
    this.edges.end();
    this.returns.end();
  }

  private makeTruth(): void {
    const segments = this.truth.begin();
    const truth = this.model.truth;
    if (truth && this.layers.truth && this.isShown(truth.part)) {
      for (let i = 1; i < truth.path.length; ++i)
        segments.add(truth.path[i - 1].slice(1), truth.path[i].slice(1), this.palette.truth);
    }
    this.truth.end();
  }

  /** Crosses, and what joins the first two. */
  private addWay(to: Segments, points: readonly (readonly number[])[], cross: number, colour: THREE.Color): void {
    for (const p of points) {
      for (const axis of [[cross, 0, 0], [0, cross, 0], [0, 0, cross]])
        to.add(p.map((x, k) => x - axis[k]), p.map((x, k) => x + axis[k]), colour);
    }
    if (points.length > 1) to.add([...points[0]], [...points[1]], colour);
  }

  /** What is measured, and where the event that is looked at took the camera. */
  private makeTape(): void {
    const segments = this.tape.begin();
    this.addWay(segments, this.measured.map((point) => point.toArray()), 0.25 * this.frustum, this.palette.measure);
    if (this.event && this.isShown(this.event.part)) {
      const {before, after, partBefore, part, kind} = this.event;
      this.addWay(segments, partBefore === part ? [before, after] : [after], this.frustum, new THREE.Color(eventColour(kind)));
    }
    this.tape.end();
  }

  /** Squares of one, ten or a hundred metres below the path, wherever that is. */
  private makeGrid(): void {
    const {size, centre, lowest} = this.extent;
    const square = 10 ** Math.round(Math.log10(Math.max(size, 0.1) / 12));
    const half = square * Math.min(40, Math.ceil((1.2 * size) / square));
    const [x, z] = [centre.x, centre.z].map((middle) => square * Math.round(middle / square));
    const segments = this.grid.begin();
    for (let at = -half; at <= half; at += square) {
      segments.add([x + at, lowest, z - half], [x + at, lowest, z + half], this.palette.grid);
      segments.add([x - half, lowest, z + at], [x + half, lowest, z + at], this.palette.grid);
    }
    this.grid.end();
    this.grid.object.visible = this.layers.grid;
  }

  /** Of keyframes, path and most points, in the picture's frame; the lowest of the former two. */
  private findExtent(): {size: number; centre: THREE.Vector3; lowest: number} {
    const box = new THREE.Box3();
    for (const keyframe of this.model.keyframes.values()) if (this.isShown(keyframe.part)) box.expandByPoint(up(keyframe.position));
    const step = Math.max(1, this.model.path.length >> 10);
    for (let i = 0; i < this.model.path.length; i += step) {
      const frame = this.model.path[i];
      if (frame.state === State.tracked && this.isShown(this.model.partOf(frame))) box.expandByPoint(up(this.model.finalPosition(frame)));
    }
    if (box.isEmpty()) return {size: 2, centre: new THREE.Vector3(), lowest: -1};
    const lowest = box.min.y - Math.max(0.02 * box.getSize(new THREE.Vector3()).length(), 6 * this.frustum);
    if (!this.cloud.box.isEmpty()) box.union(this.cloud.box);
    const size = box.getSize(new THREE.Vector3());
    return {size: Math.max(size.x, size.z, 1), centre: box.getCenter(new THREE.Vector3()), lowest};
  }

  private makeBody(): void {
    const segments = this.body.begin();
    const pose = this.pose();
    if (pose && this.isShown(pose.part)) this.addFrustum(segments, pose, 2.2 * this.frustum, this.palette.camera);
    this.body.end();
  }

  private aim(): void {
    if (this.view === 'top') this.aimFromAbove();
    if (this.view === 'follow') this.follow();
    this.controls.update();
    const away = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(0.01, away / 200);
    this.camera.far = Math.max(100, away * 100);
    this.camera.updateProjectionMatrix();
  }

  private aimFromAbove(): void {
    if (this.moved) return;
    const {size, centre} = this.extent;
    const height = (0.6 * size) / Math.tan((this.camera.fov * Math.PI) / 360) / Math.min(1, this.camera.aspect) + centre.y;
    this.controls.target.copy(centre);
    this.camera.position.set(centre.x, centre.y + height, centre.z);
  }

  /** The view moves along from behind and above, or keeps the angle and distance that it was given by hand. */
  private follow(): void {
    const at = this.here();
    if (!at) return;
    if (!this.moved) {
      const distance = Math.max(0.7 * this.extent.size, 20 * this.frustum);
      this.controls.target.copy(this.target);
      this.camera.position.copy(this.target).add(new THREE.Vector3(0.3, 0.6, 0.75).multiplyScalar(distance));
    }
    const far = at.distanceTo(this.target) > 60 * this.frustum;
    const step = at.clone().sub(this.target).multiplyScalar(far ? 1 : 0.25);
    if (step.length() < 1e-4 * this.frustum) return;
    this.target.add(step);
    this.controls.target.add(step);
    this.camera.position.add(step);
    this.dirty = true;
  }

  /** What is under the pointer: keyframes within 14 pixels, or points. */
  pick(x: number, y: number, what: 'keyframe' | 'point'): Picked {
    const {clientWidth: w, clientHeight: h} = this.canvas;
    const M = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse).multiply(this.world.matrixWorld).elements;
    let nearest = 14;
    let picked: Picked = null;
    const offer = (px: number, py: number, pz: number): boolean => {
      const depth = M[3] * px + M[7] * py + M[11] * pz + M[15];
      if (depth <= 0) return false;
      const u = (0.5 + (0.5 * (M[0] * px + M[4] * py + M[8] * pz + M[12])) / depth) * w;
      const v = (0.5 - (0.5 * (M[1] * px + M[5] * py + M[9] * pz + M[13])) / depth) * h;
      const away = Math.hypot(u - x, v - y);
      if (away >= nearest) return false;
      nearest = away;
      return true;
    };
    if (what === 'point') {
      this.cloud.visitShown((px, py, pz) => {
        if (offer(px, py, pz)) picked = {point: new THREE.Vector3(px, py, pz)};
      });
    } else {
      if (!this.layers.keyframes) return null;
      for (const keyframe of this.model.keyframes.values())
        if (this.isDrawnKeyframe(keyframe) && offer(...keyframe.position)) picked = {keyframe};
    }
    return picked;
  }

  /** Moves the view to a position of the map. */
  lookAt(position: readonly [number, number, number]): void {
    const step = up(position).sub(this.controls.target);
    this.controls.target.add(step);
    this.camera.position.add(step);
    this.target.copy(this.controls.target);
    this.redraw();
  }

  picture(done: (blob: Blob | null) => void): void {
    this.renderer.render(this.scene, this.camera);
    this.canvas.toBlob(done, 'image/png');
  }
}

/** Null: the browser has no WebGL 2. It is the picture's own: another, made to find that out, would be work for nothing. */
export function contextOf(canvas: HTMLCanvasElement): WebGL2RenderingContext | null {
  return canvas.getContext('webgl2', {antialias: false, preserveDrawingBuffer: true, powerPreference: 'low-power'});
}

/** Smooth edges, by more pixels than the screen has, are for those who have a graphics processor. */
function drawsInSoftware(gl: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  const name = gl.getExtension('WEBGL_debug_renderer_info');
  return !name || /swiftshader|llvmpipe|software/i.test(String(gl.getParameter(name.UNMASKED_RENDERER_WEBGL)));
}

function up(p: readonly [number, number, number]): THREE.Vector3 {
  return new THREE.Vector3(p[0], -p[1], -p[2]);
}

function distance(a: readonly number[], b: readonly number[]): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
