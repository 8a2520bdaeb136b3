// The decoder against bytes that the C++ side writes: tests/viewer/scene_test.cpp compares with the same file.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {test} from 'node:test';
import {Model} from '../src/model.ts';
import {Surface} from '../src/surface.ts';
import {describe, lateStretches, lateTally, lostStretches, tally} from '../src/timeline.ts';
import {State, decode, type Delta, type Frames, type LiveFrame, type MapEvent, type SurfaceMessage} from '../src/wire.ts';

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
  assert.deepEqual([frames[0].framesDropped, frames[0].framesLost], [null, 3]);
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

test('pieces of the surface', () => {
  const surface = decode(bytes(messages.surface)) as SurfaceMessage;
  assert.deepEqual([surface.kind, surface.whole, surface.part, surface.pieces.length], ['surface', true, 7, 1]);
  const [piece] = surface.pieces;
  assert.deepEqual(piece.cell, [1, -2, 3]);
  const expected = [0.5, -1, 1.5, 1, -1, 1.5, 1, -0.5, 1.5, 0.5, -0.5, 1.5];
  piece.positions.forEach((x, i) => assert.ok(Math.abs(x - expected[i]) < 1e-5, `${i}: ${x}`));
  assert.deepEqual([...piece.normals.slice(0, 3), ...piece.colours.slice(0, 4)], [0, 0, -127, 255, 128, 0, 255]);
  assert.deepEqual([...piece.corners], [0, 1, 2, 0, 2, 3, 1, 2, 3]);
});

test('damaged pieces of the surface are refused whole', () => {
  const whole = new Uint8Array(bytes(messages.surface));
  const damaged = (change: (view: DataView) => void): ArrayBuffer => {
    const copy = whole.slice().buffer;
    change(new DataView(copy));
    return copy;
  };
  const refused = (buffer: ArrayBuffer, why: RegExp) => assert.throws(() => decode(buffer), why);
  for (let length = 16; length < whole.length - 2; ++length) refused(whole.slice(0, length).buffer, /ends within a record|without an edge/);
  refused(damaged((view) => view.setUint32(8, 2, true)), /ends within a record/);           // pieces
  refused(damaged((view) => view.setUint32(36, 0xffffffff, true)), /ends within a record/);  // vertices
  refused(damaged((view) => view.setUint32(40, 0xffffffff, true)), /ends within a record/);  // triangles
  refused(damaged((view) => view.setUint16(whole.length - 4, 4, true)), /without one of its vertices/);
  for (const edge of [0, -1, NaN, Infinity]) refused(damaged((view) => view.setFloat32(16, edge, true)), /without an edge/);
});

test('what is shown of a surface is what came last', () => {
  const surface = new Surface();
  const message = decode(bytes(messages.surface)) as SurfaceMessage;
  surface.take(message);
  while (surface.update(1));
  assert.deepEqual([surface.size, surface.group.children.length, surface.part], [3, 1, 7]);
  const [piece] = message.pieces;
  surface.take({...message, whole: false, pieces: [{...piece, cell: [100, 0, 0], corners: piece.corners.slice(0, 3)}]});
  while (surface.update(1));
  assert.deepEqual([surface.size, surface.group.children.length], [4, 2]);
  surface.take({...message, whole: false, pieces: [{...piece, corners: new Uint16Array(0)}]});
  while (surface.update(1));
  assert.deepEqual([surface.size, surface.group.children.length], [1, 1]);
  surface.take({...message, pieces: []});
  while (surface.update(1));
  assert.deepEqual([surface.size, surface.group.children.length], [0, 0]);
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
    trackedShare: 1, points: 9, mapVersion: 1, stageMs, keyframesWaiting: 0, framesWaiting: 0, placesWaiting: 0, framesDropped: 0, framesLost: null});
  const frames = [frame(0, 10, [5]), frame(1, 12, [5]), frame(2, 70, [60, 4]), frame(3, 80, [61, 3]), frame(4, 90, [4]), frame(5, 9, [4])];
  const dropped = {...frame(6, 0, []), state: State.dropped, reason: 1};
  model.reasons = ['', 'dropped: a newer frame was there'];
  const path = [...frames, dropped].map((live) => ({...live, causal: nowhere, inReference: nowhere, turned: [0, 0, 0, 1] as [number, number, number, number],
    trackingMs: live.stageMs.reduce((sum, ms) => sum + ms, 0)}));
  model.take({...decode(bytes(delta(2, 2, 0))) as Delta, path});
  model.addLive(frames);
  assert.deepEqual(lateStretches(model).map((late) => [late.frames, late.reason]),
    [[2, 'tracking it took 64 ms'], [1, 'it waited: earlier frames, decoding, or no CPU'], [1, 'dropped: a newer frame was there']]);
  assert.deepEqual(lateTally(model), {frames: 3, commonest: 'tracking it took'}, 'dropped ones were never tracked');
  assert.deepEqual(lostStretches(model), []);
});

test('the commonest reason, however long each took', () => {
  const stretch = (frames: number, reason: string) => ({begin: 0, end: 1, frames, reason});
  assert.deepEqual(tally([]), {frames: 0, commonest: ''});
  assert.deepEqual(tally([stretch(3, 'it waited'), stretch(2, 'tracking it took 64 ms'), stretch(2, 'tracking it took 1204 ms')]),
    {frames: 7, commonest: 'tracking it took'});
});

// What is not as the server writes it.

const u32 = (...numbers: number[]) => numbers.map((n) => Buffer.from(Uint32Array.of(n).buffer).toString('hex')).join('');
const KIND = {delta: 1, frames: 2, image: 3, measured: 4, keyframeImage: 5};
const delta = (flags: number, block: number, count: number, revision = 0) => u32(KIND.delta, flags, revision, revision + 1) + u32(block, count);

test('messages that end too early are refused, wherever they end', () => {
  const ends = (message: string) => {  // where a block begins, a message may end
    const found = new Set([16]);
    const sizes = [0, 28, 4, 52, 4, 12, 8, 60, 4];
    const view = new DataView(bytes(message));
    for (let at = 16; at < view.byteLength;) found.add((at += 8 + view.getUint32(at + 4, true) * sizes[view.getUint32(at, true)]));
    return found;
  };
  const allowed = ends(messages.whole);
  for (let cut = 0; 2 * cut < messages.whole.length; ++cut) {
    const begin = () => decode(bytes(messages.whole.slice(0, 2 * cut)));
    if (allowed.has(cut)) assert.doesNotThrow(begin);
    else assert.throws(begin, /a message ends within (a record|its header)/, `${cut} bytes`);
  }
  for (let cut = 0; 2 * cut < messages.live.length; ++cut)
    assert.throws(() => decode(bytes(u32(KIND.frames, 1, 0, 0), messages.live.slice(0, 2 * cut))), /a message ends within a record/, `${cut} bytes`);
});

test('counts beyond the message are refused, in every block', () => {
  for (let block = 1; block <= 8; ++block) {
    for (const count of [1, 1000, 0x10000000, 0xffffffff])
      assert.throws(() => decode(bytes(delta(1, block, count))), /a message ends within a record/, `${count} of block ${block}`);
  }
  assert.throws(() => decode(bytes(u32(KIND.frames, 0xffffffff, 0, 0))), /within a record/);
  assert.throws(() => decode(bytes(u32(KIND.measured, 7, 0xffffffff, 0))), /within a record/);
});

test('what is behind the last record, and kinds that there are not, are refused', () => {
  assert.throws(() => decode(bytes(u32(KIND.frames, 1, 0, 0), messages.live, u32(0))), /4 bytes too long/);
  assert.throws(() => decode(bytes(u32(KIND.measured, 7, 0, 0), u32(0, 0))), /8 bytes too long/);
  assert.throws(() => decode(bytes(delta(1, 0, 0))), /unknown block 0/);
  assert.throws(() => decode(bytes(delta(1, 9, 0))), /unknown block 9/);
  assert.throws(() => decode(bytes(u32(0, 0, 0, 0))), /unknown message 0/);
  assert.throws(() => decode(bytes(u32(7, 0, 0, 0))), /unknown message 7/);
});

test('changes are of the revision that the page has', () => {
  const model = new Model();
  const take = (flags: number, from: number, to: number) => model.take(decode(bytes(u32(KIND.delta, flags, from, to))) as Delta);
  assert.throws(() => take(2, 3, 4), /since revision 3 came to one that has 0/);
  take(1, 0, 4);  // the whole of it, in two messages
  take(2, 0, 4);
  take(2, 4, 7);
  assert.throws(() => take(2, 4, 7), /since revision 4 came to one that has 7/);
  take(0, 7, 9);
  assert.throws(() => take(2, 9, 10), /since revision 9 came to one that has 7/, 'the rest is missing');
  take(3, 0, 12);
  take(2, 12, 13);
});
