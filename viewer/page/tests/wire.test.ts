// The decoder against bytes that the C++ side writes: tests/viewer/scene_test.cpp compares with the same file.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {Model} from '../src/model.ts';
import {describe, lateStretches, lostStretches} from '../src/timeline.ts';
import {State, decode, type Delta, type Frames, type LiveFrame, type MapEvent} from '../src/wire.ts';

const messages = JSON.parse(readFileSync(process.env.MESSAGES!, 'utf8')) as Record<string, string>;

function bytes(...hexadecimal: string[]): ArrayBuffer {
  return Uint8Array.from(Buffer.from(hexadecimal.join(''), 'hex')).buffer;
}

test('a whole map', () => {
  const delta = decode(bytes(messages.whole)) as Delta;
  assert.equal(delta.kind, 'delta');
  assert.ok(delta.whole && delta.last);
  assert.deepEqual([delta.from, delta.to], [0, 2]);
  assert.deepEqual(delta.keyframes.map((k) => [k.id, k.frame, k.t, k.position[0], k.window, k.points]), [[0, 0, 0, 0, 2, 7], [1, 10, 0.5, 1, 2, 7], [2, 20, 1, 2, 1, 7]]);
  assert.deepEqual(delta.edges, [{from: 0, to: 1, sharedPoints: 12, marginalised: false, loop: 0}, {from: 1, to: 2, sharedPoints: 12, marginalised: true, loop: 1}]);
  assert.equal(delta.points[0].count, 3);
  assert.deepEqual([...delta.points[0].floats.slice(8, 11)], [1, 0.25, 4]);
  const [frame] = delta.path;
  assert.deepEqual([frame.frame, frame.reference, frame.latencyMs, frame.trackingMs], [4, 2, 12.5, 3.5]);
  assert.deepEqual(frame.inReference, [0, 0, 0.125]);
  assert.deepEqual(frame.turned, [0, 0, 0, 1]);
});

test('a delta on top of it', () => {
  const model = new Model();
  model.take(decode(bytes(messages.whole)) as Delta);
  const delta = decode(bytes(messages.later)) as Delta;
  assert.ok(!delta.whole);
  assert.deepEqual(delta.pointsGone, [0]);
  model.take(delta);
  assert.deepEqual([...model.keyframes.keys()], [0, 2]);
  assert.deepEqual([...model.edges.keys()], ['1-2']);
  assert.deepEqual(model.finalPosition(model.path[0]), [2, 0, 0.125]);
});

test('live frames', () => {
  const header = '02000000' + '01000000' + '00000000' + '00000000';
  const {frames} = decode(bytes(header, messages.live)) as Frames;
  assert.equal(frames.length, 1);
  assert.deepEqual([frames[0].frame, frames[0].points, frames[0].trackedShare, frames[0].mapVersion], [4, 90, 0.75, 1]);
  assert.deepEqual(frames[0].stageMs.slice(0, 3), [1, 2.5, 0]);
  assert.deepEqual([frames[0].framesWaiting, frames[0].keyframesWaiting, frames[0].placesWaiting], [2, 7, null]);
});

test('measured points', () => {
  const header = '04000000' + '09000000' + '01000000' + '00000000';
  const point = '00002041' + '0000a041' + '00002841' + '00009841' + '00000000' + '00001041' + '0000a841' + '0000c040';
  assert.deepEqual(decode(bytes(header, point)), {kind: 'measured', frame: 9, points: [
    {u: 10, v: 20, expectedU: 10.5, expectedV: 19, inlier: false, predictedU: 9, predictedV: 21, radius: 6}]});
});

test('the image of a keyframe', () => {
  const header = '05000000' + '11000000' + '08000000' + '06000000';
  assert.deepEqual(decode(bytes(header, 'ffd8')), {kind: 'keyframe image', keyframe: 17, jpeg: new Uint8Array([0xff, 0xd8])});
});

const nowhere: [number, number, number] = [0, 0, 0];
const correction: MapEvent = {kind: 'pose graph', text: '', frame: 7, t: 1, keyframe: 2, partBefore: 0, part: 0, moved: 0.42,
  turned: Math.PI / 180, before: nowhere, after: nowhere, loop: null, scale: null};

test('events say what moved and by how much, loops of one camera the scale', () => {
  assert.equal(describe(correction), 'pose graph · frame 7 · moved 42 cm, turned 1.00°');
  assert.equal(describe({...correction, partBefore: 3}), 'pose graph · frame 7 · part 3 → 0');
  const loop = {from: 0, to: 2, joinsParts: false, scale: 1, inliers: 41, travelled: 53.2};
  const closed = {...correction, kind: 'loop', loop};
  assert.equal(describe(closed), 'loop · off by 42 cm, 1.00° after 53.20 m · 41 matches');
  assert.equal(describe({...closed, loop: {...loop, scale: 1.0625}}), 'loop · off by 42 cm, 1.00° after 53.20 m · 41 matches · scale 1.0625');
  assert.equal(describe({...closed, loop: {...loop, joinsParts: true, scale: 0.5}}), 'loop · joins two map parts · 41 matches · scale 0.5000');
});

test('late frames say what held them up', () => {
  const model = new Model();
  const frame = (n: number, latencyMs: number, stageMs: number[]): LiveFrame => ({frame: n, t: 0.05 * n, reference: 0, part: 0,
    state: State.tracked, reason: 0, keyframe: false, effort: 0, latencyMs, position: nowhere, orientation: [0, 0, 0, 1],
    trackedShare: 1, points: 9, mapVersion: 1, stageMs, keyframesWaiting: 0, framesWaiting: 0, placesWaiting: 0});
  const frames = [frame(0, 10, [5]), frame(1, 12, [5]), frame(2, 70, [60, 4]), frame(3, 80, [61, 3]), frame(4, 90, [4]), frame(5, 9, [4])];
  for (const live of frames) model.take({kind: 'delta', whole: false, last: true, from: 1, to: 2, points: [], pointsGone: [], keyframes: [],
    keyframesGone: [], edges: [], edgesGone: [], pathGone: [], path: [{...live, causal: nowhere, inReference: nowhere, turned: [0, 0, 0, 1], trackingMs: 0}]});
  model.addLive(frames);
  assert.deepEqual(lateStretches(model).map((late) => [late.frames, late.reason]),
    [[2, 'tracking it took 64 ms'], [1, 'it waited: earlier frames, decoding, or no CPU']]);
  assert.deepEqual(lostStretches(model), []);
});

test('messages that end too early are refused', () => {
  for (const cut of [8, 40, 200, 360]) assert.throws(() => decode(bytes(messages.whole.slice(0, 2 * cut))));
});
