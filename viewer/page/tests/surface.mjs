// The surface's mesh in a browser, of a run that lasts and of a finished one: node surface.mjs OUTPUT_FOLDER
import assert from 'node:assert/strict';
import {mkdirSync} from 'node:fs';
import {join} from 'node:path';
import {Program, explain, openBrowser, openPage, until} from './program.mjs';

const out = process.argv[2];
mkdirSync(out, {recursive: true});
const browser = await openBrowser();

/** Pixels of the picture that are neither background nor of a colour: the rendered desk is grey, and so is its mesh. */
const greyPixels = (page) => page.evaluate(() => {
  const canvas = document.querySelector('#stage');
  const copy = document.createElement('canvas');
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const data = context.getImageData(0, 0, copy.width, copy.height).data;
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [low, high] = [Math.min(data[i], data[i + 1], data[i + 2]), Math.max(data[i], data[i + 1], data[i + 2])];
    if (high - low <= 6 && high >= 40) ++count;
  }
  return count;
});

/** With nothing else in the picture, the mesh is there when its layer is on, and gone when it is off. */
async function expectMesh(page, what) {
  await until(`triangles of ${what}`, () => page.evaluate(() => window.twofold.stage.surface.size > 1000), 90000);
  await page.locator('#layer-surface').waitFor({state: 'visible', timeout: 20000});  // the layer can be switched
  await page.evaluate(() => {
    for (const layer of Object.keys(window.twofold.stage.layers)) if (layer !== 'surface') window.twofold.setLayer(layer, false);
  });
  let shown = 0;
  await until(`pixels of ${what}`, async () => (shown = await greyPixels(page)) > 10000);
  await page.screenshot({path: join(out, `${what.replaceAll(' ', '_')}.png`)});
  await page.evaluate(() => window.twofold.setLayer('surface', false));
  let hidden = 0;
  await until(`${what} is hidden`, async () => (hidden = await greyPixels(page)) < shown / 20);
  await page.evaluate(() => window.twofold.setLayer('surface', true));
  const triangles = await page.evaluate(() => window.twofold.stage.surface.size);
  console.log(`        ${what}: ${triangles} triangles, ${shown} pixels; ${hidden} with the layer off`);
  assert.deepEqual(page.faults, []);
}

try {
  const run = new Program(['run', 'synthetic:desk?sensor=rgbd&width=320&height=240&frames=300', '--preload', '--speed', '0.5', '--quiet',
    '--surface', '0.02', '--view', '0', '--out', join(out, 'surface_run')]);
  const page = await openPage(browser, await run.address());
  await expectMesh(page, 'mesh of a live run');
  await page.context().close();
  await run.stop();
  const view = new Program(['view', join(out, 'surface_run'), '--port', '0']);
  const late = await openPage(browser, await view.address());
  await expectMesh(late, 'mesh of a finished run');
  await view.stop();
} catch (error) {
  await explain(out);
  throw error;
} finally {
  await browser.close();
}
