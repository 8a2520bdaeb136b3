// The time line: events, stretches in which the camera was lost, and the time that is shown.
import type {Model} from './model.ts';
import {eventColour} from './palette.ts';
import {NO_ID, State, type Loop, type MapEvent, type PathFrame} from './wire.ts';

/** Frames in a row that were lost, or late, for the same reason. */
export interface Stretch {
  begin: number;
  end: number;  // until the next frame
  frames: number;
  reason: string;
}

/** Looked at, and not placed. */
export function isLost(frame: PathFrame): boolean {
  return frame.state === State.lost || frame.state === State.unplaced;
}

/** `why` gives nothing for frames that are no part of any. */
function stretches(model: Model, why: (frame: PathFrame) => string | null): Stretch[] {
  const found: Stretch[] = [];
  let open: Stretch | null = null;
  for (const frame of model.path) {
    const reason = why(frame);
    if (open) open.end = frame.t;
    if (reason === null) open = null;
    else if (open && open.reason === reason) ++open.frames;
    else found.push((open = {begin: frame.t, end: frame.t, frames: 1, reason}));
  }
  return found;
}
export function lostStretches(model: Model): Stretch[] {
  return stretches(model, (frame) => (isLost(frame) ? model.reasons[frame.reason] ?? '' : null));
}
/** Poses that came when the next frame was there already, and frames that were dropped. */
export function lateStretches(model: Model): Stretch[] {
  const budget = model.periodMs();
  return stretches(model, (frame) => (frame.state === State.dropped || isLate(frame, budget) ? whyLate(model, frame, budget) : null));
}
/** In the run's own words; of live frames, whose run is still to say them, as summary.json will: its own work, or whatever it waited for. */
function whyLate(model: Model, frame: PathFrame, budget: number): string {
  if (frame.reason > 0) return model.reasons[frame.reason] ?? '';
  return frame.trackingMs > budget / 2 ? `tracking it took ${frame.trackingMs.toFixed(0)} ms` : 'it waited: earlier frames, decoding, or no CPU';
}
function isLate(frame: PathFrame, budget: number): boolean {
  return frame.state === State.tracked && budget > 0 && frame.latencyMs > budget;
}

/** How many frames, and what most of them suffered from. */
export interface Tally {
  frames: number;
  commonest: string;
}
export function tally(found: readonly Stretch[]): Tally {
  const counts = new Map<string, number>();
  for (const {frames, reason} of found) {
    const kind = reason.replace(/ \d[\d.]* ms$/, '');  // however long it took
    counts.set(kind, (counts.get(kind) ?? 0) + frames);
  }
  const sorted = [...counts].sort((a, b) => b[1] - a[1]);
  return {frames: sorted.reduce((sum, [, frames]) => sum + frames, 0), commonest: sorted[0]?.[0] ?? ''};
}
/** Of those frames that were tracked. */
export function lateTally(model: Model): Tally {
  const budget = model.periodMs();
  return tally(stretches(model, (frame) => (isLate(frame, budget) ? whyLate(model, frame, budget) : null)));
}

/** Asked for by somebody who watches, at whatever moment. */
const COMMANDS = new Set(['map saved', 'mapping paused', 'mapping resumed', 'run stopped', 'command failed']);

export class Timeline {
  onTime: (time: number | null) => void = () => {};
  onEvent: (event: MapEvent) => void = () => {};
  time: number | null = null;
  private context: CanvasRenderingContext2D | null = null;  // from the first draw on: the big picture comes first
  private lost: Stretch[] = [];
  private late: Stretch[] = [];

  constructor(private readonly canvas: HTMLCanvasElement, private readonly tip: HTMLElement, private readonly model: Model) {
    let dragging = false;
    canvas.addEventListener('pointerdown', (event) => {
      const hit = this.eventAt(event.offsetX, event.offsetY);
      if (hit) this.onEvent(hit);
      dragging = !hit;
      if (dragging) {
        canvas.setPointerCapture(event.pointerId);
        this.seek(event.offsetX);
      }
    });
    canvas.addEventListener('pointermove', (event) => {
      if (dragging) this.seek(event.offsetX);
      this.explain(event);
    });
    canvas.addEventListener('pointerup', () => (dragging = false));
    canvas.addEventListener('pointerleave', () => (tip.hidden = true));
    new ResizeObserver(() => this.context && this.draw()).observe(canvas);
  }

  /** Time by `step` seconds; beyond the end is now. */
  move(step: number): void {
    const end = this.model.endTime();
    const t = Math.max(0, (this.time ?? end) + step);
    this.set(t >= end ? null : t);
  }
  set(time: number | null): void {
    this.time = time;
    this.onTime(time);
    this.draw();
  }

  private seek(x: number): void {
    const t = this.timeAt(x);
    this.set(t >= 0.997 * this.model.endTime() ? null : t);
  }
  private get width(): number {
    return this.canvas.clientWidth;
  }
  private x(t: number): number {
    return 8 + ((this.width - 16) * t) / Math.max(this.model.endTime(), 1e-3);
  }
  private timeAt(x: number): number {
    return Math.min(1, Math.max(0, (x - 8) / (this.width - 16))) * this.model.endTime();
  }

  private eventAt(x: number, y: number): MapEvent | null {
    if (y > 18) return null;
    let nearest: MapEvent | null = null;
    let away = 6;
    for (const event of this.model.events) {
      const d = Math.abs(this.x(event.t) - x);
      if (d >= away) continue;
      away = d;
      nearest = event;
    }
    return nearest;
  }

  private explain(pointer: PointerEvent): void {
    const event = this.eventAt(pointer.offsetX, pointer.offsetY);
    const t = this.timeAt(pointer.offsetX);
    const under = (stretch: Stretch) => this.x(stretch.begin) - 2 <= pointer.offsetX && pointer.offsetX <= this.x(stretch.end) + 2;
    const say = (what: string, stretch: Stretch) => `${what} for ${stretch.frames} frame${stretch.frames > 1 ? 's' : ''}: ${stretch.reason}`;
    const lost = this.lost.find(under);
    const late = this.late.find(under);
    const text = event ? this.describeAll(event.t) : lost ? say('lost', lost) : late ? say('late', late) : clock(t);
    this.tip.textContent = text;
    this.tip.hidden = false;
    const room = this.tip.parentElement!.clientWidth - this.tip.offsetWidth - 8;
    this.tip.style.left = `${Math.max(8, Math.min(room, pointer.offsetX - this.tip.offsetWidth / 2))}px`;
  }

  /** What happened at that moment, one below the other: of marks at the same place only the upper one can be pointed at. */
  private describeAll(t: number): string {
    return this.model.events.filter((event) => event.t === t).map((event) => describe(event, this.model.isMetric)).join('\n');
  }

  draw(): void {
    const {canvas} = this;
    const c = (this.context ??= canvas.getContext('2d', {willReadFrequently: true})!);  // not to wait for the big picture
    const scale = Math.min(devicePixelRatio, 2);
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(w * scale) || canvas.height !== Math.round(h * scale)) {
      canvas.width = Math.round(w * scale);
      canvas.height = Math.round(h * scale);
    }
    this.lost = lostStretches(this.model);
    this.late = lateStretches(this.model);
    const style = getComputedStyle(canvas);
    c.setTransform(scale, 0, 0, scale, 0, 0);
    c.clearRect(0, 0, w, h);
    const line = 24;
    c.fillStyle = style.getPropertyValue('--track');
    c.fillRect(8, line - 2, w - 16, 4);
    const end = this.model.endTime();
    c.fillStyle = style.getPropertyValue('--final');
    c.fillRect(8, line - 2, this.x(this.time ?? end) - 8, 4);
    this.markStretches(c, this.late, line, 'late');
    this.markStretches(c, this.lost, line, 'lost');
    for (const event of this.model.events) if (!COMMANDS.has(event.kind)) this.mark(c, event);
    for (const event of this.model.events) if (COMMANDS.has(event.kind)) this.markCommand(c, event);
    this.ticks(c, end, line, h, style);
    c.fillStyle = style.getPropertyValue('--text');
    c.beginPath();
    c.arc(this.x(this.time ?? end), line, 6, 0, 2 * Math.PI);
    c.fill();
  }

  private markStretches(c: CanvasRenderingContext2D, stretches: Stretch[], line: number, kind: string): void {
    c.fillStyle = eventColour(kind);
    for (const {begin, end} of stretches) c.fillRect(this.x(begin), line - 4, Math.max(2, this.x(end) - this.x(begin)), 8);
  }

  /** What moved the camera far stands high. */
  private mark(c: CanvasRenderingContext2D, event: MapEvent): void {
    const small = event.kind === 'optimisation';
    c.fillStyle = eventColour(event.kind);
    c.beginPath();
    c.arc(this.x(event.t), small ? 13 : 9, small ? 2 : 4.5, 0, 2 * Math.PI);
    c.fill();
  }

  /**
   * A bar over the marks of what the map does by itself, and narrower than those are: a loop is known only some time after the keyframe that
   * closes it, so that its mark comes to lie where the map was saved with that keyframe, and either has to be seen.
   */
  private markCommand(c: CanvasRenderingContext2D, event: MapEvent): void {
    c.fillStyle = eventColour(event.kind);
    c.fillRect(Math.round(this.x(event.t)) - 1, 2, 3, 16);
  }

  private ticks(c: CanvasRenderingContext2D, end: number, line: number, height: number, style: CSSStyleDeclaration): void {
    const most = Math.max(2, this.width / 90);
    const step = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600].find((s) => end / s <= most) ?? 7200;
    c.fillStyle = style.getPropertyValue('--faint');
    c.font = '10px system-ui, sans-serif';
    c.textAlign = 'center';
    for (let t = 0; t <= end; t += step) {
      c.fillRect(this.x(t), line + 4, 1, 3);
      if (this.x(t) < this.width - 24) c.fillText(clock(t), Math.max(18, this.x(t)), Math.min(height - 1, line + 16));
    }
  }
}

export function clock(t: number): string {
  const s = Math.max(0, t);
  const minutes = Math.floor(s / 60);
  const rest = (s % 60).toFixed(s < 60 ? 1 : 0);
  return minutes > 0 ? `${minutes}:${rest.padStart(2, '0')}` : `${rest} s`;
}

/** One camera's unit is its own, and has no name. */
export function length(d: number, isMetric: boolean): string {
  if (!isMetric) return `${d.toPrecision(3)} units`;
  return d < 1 ? `${(100 * d).toFixed(d < 0.1 ? 1 : 0)} cm` : `${d.toFixed(2)} m`;
}

const degrees = (angle: number) => `${((180 / Math.PI) * angle).toFixed(2)}°`;

export function describe(event: MapEvent, isMetric = true): string {
  if (event.text) return `${event.kind} · ${event.text}`;
  if (event.loop) return `${event.kind} · ${describeLoop(event, event.loop, isMetric)}`;
  const moved = event.partBefore === event.part ? `moved ${length(event.moved, isMetric)}, turned ${degrees(event.turned)}`
    : `part ${event.partBefore === NO_ID ? '–' : event.partBefore} → ${event.part}`;
  return `${event.kind} · frame ${event.frame} · ${moved}${scaled(event.scale)}`;
}

const scaled = (scale: number | null) => (scale === null || scale === 1 ? '' : ` · scale ${scale.toFixed(4)}`);

/** How far the map was off when the camera came back, and, for one camera, by how much its unit of length. */
function describeLoop(event: MapEvent, loop: Loop, isMetric: boolean): string {
  const scale = scaled(loop.scale);
  const agree = `${loop.inliers} matches`;
  if (loop.joinsParts) return `joins two map parts · ${agree}${scale}`;
  return `off by ${length(event.moved, isMetric)}, ${degrees(event.turned)} after ${length(loop.travelled, isMetric)} · ${agree}${scale}`;
}
