// The pictures of docs/viewer.md: node pictures.mjs SOURCE FOLDER
import assert from 'node:assert/strict';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {Program, openBrowser, openPage, places, report, until} from './program.mjs';

const [source, folder] = process.argv.slice(2);
const scratch = mkdtempSync(join(tmpdir(), 'viewer-'));
const [recording, out, map] = ['recording', 'run', 'cloister.tfm'];  // in that folder: their names are in the pictures
const browser = await openBrowser();
const picture = (page, name) => page.screenshot({path: join(folder, name), type: 'jpeg', quality: 75});

/** A keyframe in the middle of the picture, with its image. */
async function clickKeyframe(page) {
  const stage = await page.locator('#stage').boundingBox();
  const found = await places(page, 'keyframe', 150);
  const [x, y] = found.at(-1);
  await page.mouse.click(stage.x + x, stage.y + y);
  await page.locator('#keyframe-image').waitFor({state: 'visible'});
}

/** The way round the cloister ends where it began, with a loop: the newest event that says so, and the edges it left, in red. */
async function loop(page, run) {
  await until('a loop', async () => run.ended || (await report(page)).loops > 2, 240000);
  await page.waitForTimeout(3000);
  await page.locator('#events li', {hasText: /^loop/}).first().click();
  await page.keyboard.press('2');
  await page.waitForTimeout(3000);
  await picture(page, 'viewer_loop.jpg');
}

async function live() {
  const run = new Program(['run', recording, '--speed', '0.5', '--quiet', '--view', '0', '--save-map', map, '--out', out], scratch);
  const page = await openPage(browser, await run.address());
  await until('keyframes', async () => (await report(page)).keyframes > 5);
  await until('most of the run', async () => run.ended || (await page.evaluate(() => window.twofold.model.endTime())) > 16, 240000);
  await picture(page, 'viewer_live.jpg');
  await loop(page, run);
  await run.end;
}

async function finished() {
  const view = new Program(['view', out, '--port', '0'], scratch);
  const page = await openPage(browser, await view.address());
  await until('the path', async () => (await report(page)).path > 100);
  await page.keyboard.press('2');
  await page.waitForTimeout(1500);
  await clickKeyframe(page);
  await page.waitForTimeout(1500);
  await picture(page, 'viewer_finished.jpg');
  await view.stop();
}

async function mapFile() {
  const view = new Program(['view', map, '--port', '0'], scratch);
  const page = await openPage(browser, await view.address(), {colorScheme: 'light'});
  await until('the map', async () => (await report(page)).points > 100);
  await page.selectOption('#colouring', 'deviation');
  await page.waitForTimeout(2000);
  await picture(page, 'viewer_map.jpg');
  await view.stop();
}

try {
  const rendering = new Program(['render', source, '--out', recording], scratch);
  assert.equal(await rendering.end, 0, rendering.text);
  await live();
  await finished();
  await mapFile();
} finally {
  await browser.close();
  rmSync(scratch, {recursive: true});
}
