// The camera's image, and on it the points of the map around: those first seen in the reference keyframe or its neighbours.
import type {Cloud} from './cloud.ts';
import type {Model} from './model.ts';
import {State, type Image, type LiveFrame} from './wire.ts';

const MOST = 100000;  // points looked at
const KEPT = 12;      // images that wait for their pose

export class Sight {
  private readonly canvas: HTMLCanvasElement;
  private waiting: Image[] = [];
  private drawing = false;

  constructor(private readonly place: HTMLElement, private readonly model: Model, private readonly cloud: Cloud) {
    this.canvas = place.querySelector('canvas')!;
  }

  take(image: Image): void {
    this.waiting.push(image);
    if (this.waiting.length > KEPT) this.waiting.shift();
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
    const c = this.canvas.getContext('2d')!;
    this.canvas.width = bitmap.width;
    this.canvas.height = bitmap.height;
    c.drawImage(bitmap, 0, 0);
    const scale = bitmap.width / image.width;
    const count = frame.state === State.tracked ? this.paintPoints(c, frame, scale) : 0;
    const state = frame.state === State.tracked ? `${frame.points} points measured, ${count} of the map around shown`
      : `lost: ${this.model.reasons[frame.reason] ?? ''}`;
    this.place.querySelector('figcaption')!.textContent = `frame ${image.frame} · ${state}`;
  }

  private paintPoints(c: CanvasRenderingContext2D, frame: LiveFrame, scale: number): number {
    const rig = this.model.hello?.rig;
    if (!rig) return 0;
    const near = new Set([frame.reference]);
    for (const edge of this.model.neighbours(frame.reference)) near.add(edge.from === frame.reference ? edge.to : edge.from);
    const R = rows(frame.orientation);
    const [tx, ty, tz] = frame.position;
    let count = 0;
    c.fillStyle = '#35f0a8';
    this.cloud.visit((x, y, z, anchor) => {
      if (!near.has(anchor)) return;
      const [dx, dy, dz] = [x - tx, y - ty, z - tz];
      const depth = R[2] * dx + R[5] * dy + R[8] * dz;
      if (depth < 0.05) return;
      const u = rig.cx + (rig.fx * (R[0] * dx + R[3] * dy + R[6] * dz)) / depth;
      const v = rig.cy + (rig.fy * (R[1] * dx + R[4] * dy + R[7] * dz)) / depth;
      if (u < 0 || v < 0 || u >= rig.width || v >= rig.height) return;
      c.fillRect(u * scale - 1, v * scale - 1, 2.5, 2.5);
      ++count;
    }, MOST);
    return count;
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
