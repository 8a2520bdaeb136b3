// Lines that change all the time, in buffers that only grow.
import * as THREE from 'three';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';

/** Pairs of ends with a colour each, collected anew for every change. */
export class Segments {
  positions = new Float32Array(6 * 256);
  colours = new Float32Array(6 * 256);
  count = 0;

  add(a: readonly number[], b: readonly number[], colour: THREE.Color): void {
    if (6 * (this.count + 1) > this.positions.length) {
      this.positions = grown(this.positions);
      this.colours = grown(this.colours);
    }
    const at = 6 * this.count++;
    for (let k = 0; k < 3; ++k) {
      this.positions[at + k] = a[k];
      this.positions[at + 3 + k] = b[k];
    }
    colour.toArray(this.colours, at);
    colour.toArray(this.colours, at + 3);
  }
}

function grown(array: Float32Array): Float32Array<ArrayBuffer> {
  const larger = new Float32Array(2 * array.length);
  larger.set(array);
  return larger;
}

/** Lines of a width in pixels: renderers without a graphics processor draw them many times faster than WebGL's own. Of those that are drawn over each other, the one of higher order is on top. */
export class WideLines {
  readonly object: LineSegments2;
  readonly segments = new Segments();
  private room = 0;

  constructor(readonly material: LineMaterial, order: number) {
    this.object = new LineSegments2(new LineSegmentsGeometry(), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = order;
  }
  begin(): Segments {
    this.segments.count = 0;
    return this.segments;
  }
  end(): void {
    const {positions, colours, count} = this.segments;
    if (this.room !== positions.length) {
      this.object.geometry.dispose();
      this.object.geometry = new LineSegmentsGeometry();
      this.object.geometry.setPositions(positions);
      this.object.geometry.setColors(colours);
      this.room = positions.length;
    } else {
      for (const name of ['instanceStart', 'instanceColorStart']) {
        const attribute = this.object.geometry.getAttribute(name) as THREE.InterleavedBufferAttribute;
        attribute.data.array.set(name === 'instanceStart' ? positions : colours);
        attribute.data.needsUpdate = true;
      }
    }
    this.object.geometry.instanceCount = count;
  }
}

export function wide(width: number, opacity = 1): LineMaterial {
  return new LineMaterial({linewidth: width, vertexColors: true, transparent: true, depthWrite: false, opacity});
}
