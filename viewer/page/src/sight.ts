// The camera's image, and on it what was measured in it: inliers, outliers, and how far each is from where the pose puts it.
// Around them, the squares in which they were searched. Dim, the points of the map around: those first seen in the reference keyframe or its neighbours.
import type {Cloud} from './cloud.ts';
import type {Model} from './model.ts';
import {State, type Image, type LiveFrame, type Measured, type MeasuredPoint} from './wire.ts';

const MOST = 100000;  // points looked at
const KEPT = 12;      // images that wait for their pose, and likewise measurements
const LONGER = 8;     // residuals are drawn this many times as long as they are

export class Sight {
  private readonly canvas: HTMLCanvasElement;
  private waiting: Image[] = [];
  private measured: Measured[] = [];
  private drawing = false;
  private isOn = true;

  constructor(private readonly place: HTMLElement, private readonly model: Model, private readonly cloud: Cloud) {
    this.canvas = place.querySelector('canvas')!;
  }

  /** The panel opens with the first image. */
  setOn(on: boolean): void {
    this.isOn = on;
    if (!on) this.place.hidden = true;
  }

  toggleSize(): void {
    this.place.classList.toggle('large');
  }

  take(image: Image): void {
    this.waiting.push(image);
    if (this.waiting.length > KEPT) this.waiting.shift();
  }

  takeMeasured(measured: Measured): void {
    this.measured.push(measured);
    if (this.measured.length > KEPT) this.measured.shift();
  }

  /** Images are read ahead of the tracker: each is shown when its pose has come. */
  draw(): void {
    if (this.drawing) return;
    const at = this.waiting.findLastIndex((image) => this.poseOf(image) !== null);
    if (at < 0) return;
    const image = this.waiting[at];
    this.waiting.splice(0, at + 1);
    const frame = this.poseOf(image)!;
    this.drawing = true;
    createImageBitmap(new Blob([image.jpeg], {type: 'image/jpeg'})).then((bitmap) => {
      this.paint(bitmap, image, frame);
      bitmap.close();
    }).finally(() => (this.drawing = false));
  }

  private poseOf(image: Image): LiveFrame | null {
    return this.model.live.find((frame) => frame.frame === image.frame) ?? null;
  }

  private paint(bitmap: ImageBitmap, image: Image, frame: LiveFrame): void {
    this.place.hidden = !this.isOn;
    const c = this.canvas.getContext('2d', {willReadFrequently: true})!;  // it shall not wait for the big picture
    this.canvas.width = bitmap.width;
    this.canvas.height = bitmap.height;
    this.place.style.setProperty('--aspect', String(bitmap.width / bitmap.height));
    c.drawImage(bitmap, 0, 0);
    const scale = bitmap.width / image.width;
    const pixel = Math.max(1, bitmap.width / Math.max(1, this.canvas.clientWidth));  // of the screen
    const isTracked = frame.state === State.tracked;
    if (isTracked) this.paintMap(c, frame, scale, pixel);
    const measured = this.measured.find((other) => other.frame === image.frame)?.points ?? [];
    this.paintMeasured(c, measured, scale, pixel);
    const outliers = measured.reduce((sum, point) => sum + (point.inlier ? 0 : 1), 0);
    const found = measured.length === 0 ? `${frame.points} points found`
      : `${measured.length - outliers} points measured, ${outliers} outlier${outliers === 1 ? '' : 's'}; residuals × ${LONGER}; squares: searched`;
    const state = isTracked ? found : `lost: ${this.model.reasons[frame.reason] ?? ''}`;
    this.place.querySelector('figcaption')!.textContent = `frame ${image.frame} · ${state}`;
  }

  private paintMeasured(c: CanvasRenderingContext2D, points: MeasuredPoint[], scale: number, pixel: number): void {
    c.lineWidth = 1;
    c.strokeStyle = '#ffd666';
    for (const point of points) {
      if (point.radius === 0) continue;
      const side = 2 * scale * point.radius;
      c.strokeRect((point.predictedU + 0.5) * scale - side / 2, (point.predictedV + 0.5) * scale - side / 2, side, side);
    }
    c.lineWidth = pixel;
    for (const point of points) {
      c.strokeStyle = c.fillStyle = point.inlier ? '#35f0a8' : '#ff5a5f';
      const [u, v] = [(point.u + 0.5) * scale, (point.v + 0.5) * scale];
      c.beginPath();
      c.moveTo(u, v);
      c.lineTo(u + LONGER * scale * (point.expectedU - point.u), v + LONGER * scale * (point.expectedV - point.v));
      c.stroke();
      c.fillRect(u - 1.5 * pixel, v - 1.5 * pixel, 3 * pixel, 3 * pixel);
    }
  }

  private paintMap(c: CanvasRenderingContext2D, frame: LiveFrame, scale: number, pixel: number): void {
    const rig = this.model.hello?.rig;
    if (!rig) return;
    const near = new Set([frame.reference]);
    for (const edge of this.model.neighbours(frame.reference)) near.add(edge.from === frame.reference ? edge.to : edge.from);
    const R = rows(frame.orientation);
    const [tx, ty, tz] = frame.position;
    c.fillStyle = 'rgba(61, 155, 255, 0.55)';
    this.cloud.visit((x, y, z, anchor) => {
      if (!near.has(anchor)) return;
      const [dx, dy, dz] = [x - tx, y - ty, z - tz];
      const depth = R[2] * dx + R[5] * dy + R[8] * dz;
      if (depth < 0.05) return;
      const u = rig.cx + (rig.fx * (R[0] * dx + R[3] * dy + R[6] * dz)) / depth;
      const v = rig.cy + (rig.fy * (R[1] * dx + R[4] * dy + R[7] * dz)) / depth;
      if (u < 0 || v < 0 || u >= rig.width || v >= rig.height) return;
      c.fillRect(u * scale - pixel, v * scale - pixel, 2 * pixel, 2 * pixel);
    }, MOST);
  }
}

/** Rotation matrix of a quaternion, row by row. */
function rows([x, y, z, w]: readonly number[]): number[] {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
  ];
}
