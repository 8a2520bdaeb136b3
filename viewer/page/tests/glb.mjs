// GLB files as others see them: Khronos' validator has nothing to say, and three.js finds in them what the PLY file of the same run has,
// upright and in metres: node glb.mjs OUTPUT_FOLDER   (with glb_page.js, bundled, in it)
import assert from 'node:assert/strict';
import {readFileSync, readdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import validator from 'gltf-validator';
import {Program, countPixels, explain, openBrowser, openPage} from './program.mjs';

const out = process.argv[2];
const HOST = 'http://files.test';  // nowhere: answered from the output folder
const BACKGROUND = '#202830';

async function twofold(...args) {
  const program = new Program(args);
  assert.equal(await program.end, 0, `${args.join(' ')}: ${program.text}`);
}

async function pageOfFiles(browser) {
  const page = await openPage(browser, 'about:blank', {viewport: {width: 960, height: 720}});
  await page.route(`${HOST}/**`, (route) => {
    const {pathname} = new URL(route.request().url());
    if (pathname !== '/') return route.fulfill({path: join(out, pathname)});
    return route.fulfill({contentType: 'text/html', body: '<link rel="icon" href="data:,"><body style="margin: 0"><script src="glb_page.js"></script>'});
  });
  await page.goto(`${HOST}/`);
  return page;
}

/** Nothing, not even a hint; and damage is noticed, so that silence says something. */
async function expectValid(folder) {
  const bytes = new Uint8Array(readFileSync(join(out, folder, 'surface.glb')));
  const {issues, info} = await validator.validateBytes(bytes);
  assert.deepEqual(issues.messages, [], folder);
  const indices = new DataView(bytes.buffer, bytes.length - 4);  // the last corner of the last triangle
  indices.setUint32(0, info.totalVertexCount, true);
  assert.ok((await validator.validateBytes(bytes)).issues.numErrors > 0, 'a triangle of a vertex that is not there was not noticed');
  return info;
}

/**
 * @param up     in the mesh's own world
 * @param check  of what glb_page.ts found: what is known of this scene
 */
async function expectMesh(page, folder, up, check) {
  const info = await expectValid(folder);
  const found = await page.evaluate(([folder, up]) => window.look(folder, up), [folder, up]);
  console.log(`        ${folder}: ${found.triangles} triangles, box of ${found.box.size.map((x) => x.toFixed(3)).join(' x ')} m, ${found.facing.up} look up, ${found.facing.down} down, ${found.facing.agree.toFixed(4)} as normals say`);
  await page.screenshot({path: join(out, `${folder}.png`)});
  assert.deepEqual(page.faults, []);
  assert.equal(found.meshes, 1);
  assert.equal(found.metal, 0);
  assert.ok(found.triangles > 500);
  assert.deepEqual([info.totalTriangleCount, info.totalVertexCount], [found.triangles, found.vertices]);
  const {positions, normals, colours, triangles} = found.apart;
  assert.deepEqual({positions, normals, triangles}, {positions: 0, normals: 0, triangles: 0});
  assert.ok(colours < 0.51 / 255, `colours are ${colours} apart`);  // PLYLoader rounds light to a byte
  [0, 1, 0].forEach((wanted, k) => assert.ok(Math.abs(found.up[k] - wanted) < 1e-5, `up is ${found.up}`));
  assert.ok(found.facing.agree > 0.99, `${found.facing.agree} of the triangles go round as their normals say`);
  assert.ok(960 * 720 - await countPixels(page, 'canvas', BACKGROUND, 1) > 50000, 'too little is drawn');
  check(found);
}

const between = (what, value, low, high) => assert.ok(value >= low && value <= high, `${what}: ${value}, not within ${low} and ${high}`);

const browser = await openBrowser();
try {
  const page = await pageOfFiles(browser);

  // Along tracked poses, in the first camera's world: y is down. No colours: the rendered scene has none.
  await twofold('run', 'synthetic:desk?sensor=rgbd&width=320&height=240&frames=30', '--deterministic', '--quiet', '--surface', '0.02',
    '--out', join(out, 'glb_run'));
  await expectMesh(page, 'glb_run', [0, -1, 0], ({facing, colour}) => {
    assert.ok(facing.up > 10 * facing.down);
    assert.ok(Math.abs(colour[0] - colour[2]) < 1e-6);
  });

  // Along the truth, whose z is up, and which knows that the desk is 74 cm high; from images made orange.
  const recording = join(out, 'glb_recording');
  await twofold('render', 'synthetic:desk?sensor=rgbd&width=320&height=240&frames=4', '--out', recording);
  const images = 'mav0/cam0/data';
  for (const file of readdirSync(join(recording, images)).filter((name) => name.endsWith('.png'))) {
    const bytes = await page.evaluate((file) => window.tinted(file, 'rgb(255, 128, 64)'), `glb_recording/${images}/${file}`);
    writeFileSync(join(recording, images, file), Buffer.from(bytes, 'base64'));
  }
  await twofold('surface', `tum:${recording}`, '--poses', 'truth', '--voxel', '0.02', '--out', join(out, 'glb_colour'));
  await expectMesh(page, 'glb_colour', [0, 0, 1], ({facing, colour}) => {
    assert.ok(facing.up > 10 * facing.down);
    between('height of the desk and what lies on it', facing.height, 0.73, 0.9);
    assert.ok(colour[0] > 2 * colour[1] && colour[1] > 2 * colour[2], `colours: ${colour}`);
  });

  // A carton of 10 x 8 x 15 cm, less its foot, whose up is the turntable's axis.
  await twofold('object', 'synthetic:turntable?sensor=rgbd&frames=31', '--deterministic', '--out', join(out, 'glb_object'));
  const {up} = JSON.parse(readFileSync(join(out, 'glb_object/object.json'), 'utf8'));
  await expectMesh(page, 'glb_object', up, ({box}) => {
    between('height', box.size[1], 0.135, 0.155);
    for (const k of [0, 2]) between('breadth', box.size[k], 0.07, 0.14);
  });
} catch (error) {
  await explain(out);
  throw error;
} finally {
  await browser.close();
}
