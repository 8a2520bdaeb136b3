// Which points are drawn where not all can be.
import assert from 'node:assert/strict';
import {test} from 'node:test';
import * as THREE from 'three';
import {Cloud} from '../src/cloud.ts';
import {POINT_WORDS} from '../src/wire.ts';

/** So many points in a box of one metre about each of these centres, in the map's frame: z ahead. */
function cloudAt(centres: [number, number, number][], each: number): Cloud {
  const words = new Uint32Array(POINT_WORDS * centres.length * each);
  const floats = new Float32Array(words.buffer);
  const noise = (n: number) => ((n * 0.618034) % 1) - 0.5;
  for (let n = 0; n < centres.length * each; ++n) {
    const centre = centres[n % centres.length];  // they come mixed, as a map's points do
    words[POINT_WORDS * n] = n;
    for (let k = 0; k < 3; ++k) floats[POINT_WORDS * n + 1 + k] = centre[k] + noise((k + 1) * n + k);
  }
  const cloud = new Cloud();
  cloud.take([{count: centres.length * each, words, floats}], []);
  return cloud;
}

/** Points drawn of those for which `of` is true, by a camera at the origin that looks along z. */
function drawn(cloud: Cloud, budget: number, of: (z: number) => boolean): number {
  const camera = new THREE.PerspectiveCamera(60, 1, 0.1, 1000);
  camera.up.set(0, -1, 0);
  camera.lookAt(0, 0, 1);
  camera.updateMatrixWorld();
  cloud.group.updateMatrixWorld(true);
  const frustum = new THREE.Frustum().setFromProjectionMatrix(new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
  cloud.chooseDetail(camera, frustum, 700, 800 * 800, budget);
  let count = 0;
  cloud.visitShown((_x, _y, z) => (count += of(z) ? 1 : 0));
  return count;
}

const AHEAD: [number, number, number] = [0, 0, 3];
const FAR: [number, number, number] = [0, 0, 60];
const BEHIND: [number, number, number] = [0, 0, -3];

test('all points in view are drawn when there is time for them', () => {
  const cloud = cloudAt([AHEAD, FAR, BEHIND], 40000);
  assert.equal(drawn(cloud, 1e6, (z) => z > 0), 80000);
});

test('near points before far ones, and few for what is behind', () => {
  const cloud = cloudAt([AHEAD, FAR, BEHIND], 200000);
  const [near, far, behind] = [drawn(cloud, 60000, (z) => z > 0 && z < 10), drawn(cloud, 60000, (z) => z > 10), drawn(cloud, 60000, (z) => z < 0)];
  const all = near + far + behind;
  assert.ok(all > 50000 && all < 66000, `${near} near, ${far} far and ${behind} behind, of 60000`);
  assert.ok(near > 8 * far && far > 0, `${near} near ones, ${far} of what looks four hundred times as small`);
  assert.ok(near > 8 * behind, `${behind} behind, in a chunk that reaches there`);
});

test('points that are gone are not drawn', () => {
  const cloud = cloudAt([AHEAD, FAR], 20000);
  cloud.take([], Array.from({length: 20000}, (_, n) => 2 * n));
  assert.equal(cloud.size, 20000);
  assert.equal(drawn(cloud, 1e6, () => true), 20000);
});
