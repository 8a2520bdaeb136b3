// A live run, a late joiner, a finished run and a map file in a browser: node browser.mjs OUTPUT_FOLDER
import assert from 'node:assert/strict';
import {mkdirSync} from 'node:fs';
import {join} from 'node:path';
import {Network, Program, countPixels, openBrowser, openPage, report, until} from './program.mjs';

const out = process.argv[2];
mkdirSync(out, {recursive: true});
const browser = await openBrowser();
const began = performance.now();
const done = (what, ms) => console.log(`${((performance.now() - began) / 1000).toFixed(0).padStart(4)} s  ${what}${ms === undefined ? '' : `: ${ms.toFixed(0)} ms`}`);
const has = async (page, what, selector, colour, least) => {
  let pixels = 0;
  await until(`${what}: ${least} pixels of ${colour}`, async () => (pixels = await countPixels(page, selector, colour)) >= least);
  done(`${what}: ${pixels} pixels of ${colour}`);
};
const says = (page, selector, words) => until(`${selector} says ${words}`, async () => words.test(await page.textContent(selector)));
/** A socket that breaks is what some of the tests are about. */
const expectNoFaults = (page) => assert.deepEqual(page.faults.filter((fault) => !/WebSocket|ERR_CONNECTION/.test(fault)), []);

async function liveRun() {
  const recording = new Program(['render', 'synthetic:courtyard?frames=300&rounds=1&width=320&height=240', '--out', join(out, 'recording')]);
  assert.equal(await recording.end, 0, recording.text);
  done('rendered');
  const run = new Program(['run', join(out, 'recording'), '--preload', '--speed', '0.1', '--late', 'drop', '--windows', '8,40', '--quiet',
    '--view', '0', '--view-control', '--out', join(out, 'run'), '--save-map', join(out, 'map.tfm')]);
  const network = await Network.to(await run.address());
  const page = await openPage(browser, network.address);
  await until('a first picture', async () => (await report(page)).drawn > 0);
  done('first picture after', performance.now() - page.opened);
  assert.ok(!page.url().includes('token'), 'the token stays in the address line');
  await until('fifteen keyframes', async () => (await report(page)).keyframes >= 15, 60000);
  assert.match(await page.textContent('#state'), /^(tracked|lost)/);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 60);
  await has(page, 'inner window', '#stage', '#ffb000', 60);
  await has(page, 'outer window', '#stage', '#3d9bff', 60);
  await has(page, 'the camera', '#stage', '#ffffff', 20);
  await page.keyboard.press('i');
  await has(page, 'points measured in the image', '#sight canvas', '#35f0a8', 60);
  assert.match(await page.textContent('#sight figcaption'), /points measured/);

  await lateJoiner(page, network.address);
  await page.keyboard.press('1');
  await page.waitForTimeout(1500);
  await page.screenshot({path: join(out, 'live.png')});
  await cutNetwork(page, network);
  await page.reload();
  await until('all of it after a reload', async () => (await report(page)).keyframes >= 15);
  done('reloaded');
  const live = await command(page, run);
  await network.cut();
  return live;
}

async function lateJoiner(page, address) {
  const late = await openPage(browser, address);
  await until('all of it', async () => {
    const [now, then] = [await report(page), await report(late)];
    return then.keyframes >= now.keyframes - 1 && then.points > 0.97 * now.points && then.path >= now.path - 20;
  });
  done('late joiner complete after', performance.now() - late.opened);
  expectNoFaults(late);
  await late.context().close();
}

async function cutNetwork(page, network) {
  await network.cut();
  await says(page, '#message', /connection lost|reached/);
  const before = await report(page);
  await page.waitForTimeout(3000);
  await network.mend();
  await until('the page recovers', async () => {
    const now = await report(page);
    return now.link === 'open' && now.newest > before.newest && now.path > before.path;
  });
  done('network cut and mended');
}

/** Saves the map, holds it, lets go of it, ends the run. */
async function command(page, run) {
  await page.click('#save-map');
  await says(page, '#events', /map saved.*map\.tfm/);
  await has(page, 'an event on the time line', '#timeline', '#6ac8ff', 20);
  await page.click('#pause-mapping');
  await until('mapping is paused', () => page.evaluate(() => document.querySelector('#pause-mapping').getAttribute('aria-pressed') === 'true'));
  await page.click('#pause-mapping');
  await says(page, '#events', /mapping resumed/);
  page.once('dialog', (dialog) => void dialog.accept());
  await page.click('#stop');
  await says(page, '#message', /over/);
  assert.equal(await run.end, 0, run.text);
  const now = await report(page);
  assert.ok(now.path >= 60 && now.keyframes >= 15 && now.inner > 0, JSON.stringify(now));
  done(`commands obeyed; the end is told: ${now.path} frames, ${now.keyframes} keyframes, ${now.events} events`);
  expectNoFaults(page);
  await page.context().close();
  return now;
}

async function finishedRun(live) {
  const view = new Program(['view', join(out, 'run'), '--port', '0']);
  const address = await view.address();
  const page = await openPage(browser, address);
  await until('the path', async () => (await report(page)).path >= live.path - 2);
  const {edges, truth} = await report(page);
  assert.ok(edges > 20 && truth > 20, `${edges} edges, ${truth} true positions`);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 200);
  await page.waitForTimeout(500);
  const whole = await countPixels(page, '#stage', '#2ee6a6');
  const box = await page.locator('#timeline').boundingBox();
  await page.mouse.click(box.x + box.width / 3, box.y + 24);
  await until('less of the path', async () => (await countPixels(page, '#stage', '#2ee6a6')) < 0.7 * whole);
  done('time slider');
  await page.keyboard.press('End');
  await until('all of the path', async () => (await countPixels(page, '#stage', '#2ee6a6')) > 0.9 * whole);
  await page.screenshot({path: join(out, 'finished.png')});
  await page.keyboard.press('t');
  await has(page, 'light theme', '#stage', '#00895e', 100);
  await page.screenshot({path: join(out, 'light.png')});
  expectNoFaults(page);
  await view.stop('SIGKILL');
  await says(page, '#message', /lost|reached/);
  done('it is said that the program was killed');
  await page.context().close();
  return new URL(address).port;
}

async function telephone(port) {
  const view = new Program(['view', join(out, 'map.tfm'), '--port', port]);
  const page = await openPage(browser, await view.address(), {viewport: {width: 390, height: 780}, hasTouch: true, isMobile: true});
  await until('the map', async () => (await report(page)).points > 500);
  await has(page, 'map on a telephone', '#stage', '#2ee6a6', 20);
  await page.screenshot({path: join(out, 'telephone.png')});
  await page.tap('#open-show');
  await until('the panel opens', () => page.locator('#show').isVisible());
  expectNoFaults(page);
  await page.context().close();
  return view;
}

/** Places of the picture, in pixels, at which something can be picked. */
const places = (page, what, apart) => page.evaluate(([what, apart]) => {
  const found = [];
  const {width, height} = document.querySelector('#stage').getBoundingClientRect();
  for (let x = 230; x < width - 300; x += 8) {
    for (let y = 30; y < height - 30; y += 8) {
      if (found.some(([u, v]) => Math.hypot(x - u, y - v) <= apart) || !window.twofold.stage.pick(x, y, what)) continue;
      found.push([x, y]);
      if (found.length === 2) return found;
    }
  }
  return found;
}, [what, apart]);

async function keyframesAndTape(view) {
  const page = await openPage(browser, await view.address());
  await until('the map', async () => (await report(page)).points > 500);
  await page.keyboard.press('2');
  await page.waitForTimeout(1000);
  const stage = await page.locator('#stage').boundingBox();
  const [keyframe] = await places(page, 'keyframe', 60);
  assert.ok(keyframe, 'a keyframe to click at');
  await page.mouse.click(stage.x + keyframe[0], stage.y + keyframe[1]);
  await says(page, '#keyframe', /Keyframe \d+/);
  done('keyframe clicked');
  await page.selectOption('#colouring', 'deviation');
  await page.keyboard.press('m');
  const points = await places(page, 'point', 120);
  assert.equal(points.length, 2, 'points to click at');
  for (const [x, y] of points) await page.mouse.click(stage.x + x, stage.y + y);
  await says(page, '#tape', /^\d[\d.]* c?m$/);
  done(`measured ${await page.textContent('#tape')}`);
  await page.screenshot({path: join(out, 'map.png')});
  const download = page.waitForEvent('download');
  await page.keyboard.press('s');
  assert.match((await download).suggestedFilename(), /^twofold-.*\.png$/);
  done('picture saved');
  expectNoFaults(page);
  await view.stop();
}

try {
  const live = await liveRun();
  const port = await finishedRun(live);
  await keyframesAndTape(await telephone(port));
  done(`test_viewer: all shown; screenshots in ${out}`);
} finally {
  await browser.close();
}
