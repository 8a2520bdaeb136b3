// A live run, a late joiner, a finished run and a map file in a browser: node browser.mjs OUTPUT_FOLDER
import assert from 'node:assert/strict';
import {mkdirSync} from 'node:fs';
import {join} from 'node:path';
import {Program, countPixels, openBrowser, openPage, report, until} from './program.mjs';

const out = process.argv[2];
mkdirSync(out, {recursive: true});
const browser = await openBrowser();
const done = (what, ms) => console.log(`  ${what}${ms === undefined ? '' : `: ${ms.toFixed(0)} ms`}`);
const has = async (page, what, selector, colour, least) => {
  let pixels = 0;
  await until(`${what}: ${least} pixels of ${colour}`, async () => (pixels = await countPixels(page, selector, colour)) >= least);
  done(`${what}: ${pixels} pixels of ${colour}`);
};

async function liveRun() {
  const recording = new Program(['render', 'synthetic:courtyard?frames=300&rounds=1&width=320&height=240', '--out', join(out, 'recording')]);
  assert.equal(await recording.end, 0, recording.text);
  const run = new Program(['run', join(out, 'recording'), '--preload', '--speed', '0.2', '--late', 'drop', '--quiet',
    '--view', '0', '--out', join(out, 'run'), '--save-map', join(out, 'map.tfm')]);
  const address = await run.address();
  const page = await openPage(browser, address);
  await until('a first picture', async () => (await report(page)).drawn > 0);
  done('first picture after', performance.now() - page.opened);
  assert.ok(!page.url().includes('token'), 'the token stays in the address line');
  await until('twenty keyframes', async () => (await report(page)).keyframes >= 20, 40000);
  assert.match(await page.textContent('#state'), /^(tracked|lost)/);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 100);
  await has(page, 'inner window', '#stage', '#ffb000', 100);
  await has(page, 'the camera', '#stage', '#ffffff', 20);
  assert.ok((await report(page)).frameMs < 1000);

  await page.keyboard.press('i');
  await until('an image', () => page.evaluate(() => document.querySelector('#sight canvas').width >= 320 &&
    /points measured/.test(document.querySelector('#sight figcaption').textContent)));
  done('camera image');
  const late = await openPage(browser, address);
  await until('all of it', async () => {
    const [now, then] = [await report(page), await report(late)];
    return then.keyframes >= now.keyframes - 1 && then.points > 0.97 * now.points && then.path >= now.path - 20;
  });
  done('late joiner complete after', performance.now() - late.opened);
  await page.screenshot({path: join(out, 'live.png')});

  const ended = run.stop();  // Ctrl-C: the run is finished in order
  await until('the end', async () => /over/.test(await page.textContent('#message')));
  assert.equal(await ended, 0, run.text);
  const now = await report(page);
  assert.ok(now.path >= 60 && now.keyframes >= 20 && now.inner > 0, JSON.stringify(now));
  await has(page, 'outer window', '#stage', '#3d9bff', 50);
  done(`the end is told: ${now.path} frames, ${now.keyframes} keyframes, ${now.events} events`);
  await late.close();
  page.faults = page.faults.filter((fault) => !/WebSocket|ERR_CONNECTION/.test(fault));  // the program is gone
  assert.deepEqual(page.faults, []);
  return now;
}

async function finishedRun(live) {
  const view = new Program(['view', join(out, 'run'), '--port', '0']);
  const page = await openPage(browser, await view.address());
  await until('the path', async () => (await report(page)).path >= live.path - 2);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 300);
  const whole = await countPixels(page, '#stage', '#2ee6a6');
  const box = await page.locator('#timeline').boundingBox();
  await page.mouse.click(box.x + box.width / 3, box.y + 24);
  await until('less of the path', async () => (await countPixels(page, '#stage', '#2ee6a6')) < 0.7 * whole);
  done('time slider');
  await page.keyboard.press('End');
  await page.keyboard.press('t');
  await has(page, 'light theme', '#stage', '#00895e', 200);
  await page.screenshot({path: join(out, 'finished.png')});
  assert.deepEqual(page.faults, []);

  const again = await view.address();
  await view.stop('SIGKILL');
  await until('it is said that the program is gone', async () => /lost|reached/.test(await page.textContent('#message')));
  const port = new URL(again).port;
  const next = new Program(['view', join(out, 'map.tfm'), '--port', port]);
  const fresh = await openPage(browser, await next.address(), {viewport: {width: 390, height: 780}, hasTouch: true, isMobile: true});
  await until('the map', async () => (await report(fresh)).points > 500);
  await has(fresh, 'map on a telephone', '#stage', '#2ee6a6', 20);
  await fresh.screenshot({path: join(out, 'telephone.png')});
  assert.deepEqual(fresh.faults, []);
  done('map file');
  await next.stop();
}

async function keyframesAndTape(browser) {
  const view = new Program(['view', join(out, 'map.tfm'), '--port', '0']);
  const page = await openPage(browser, await view.address());
  await until('the map', async () => (await report(page)).points > 500);
  await page.keyboard.press('2');
  await page.waitForTimeout(500);
  const spots = await page.evaluate(() => {
    const {stage, model} = window.twofold;
    const found = [];
    const {width, height} = document.querySelector('#stage').getBoundingClientRect();
    for (let x = 230; x < width - 300 && found.length < 2; x += 9)
      for (let y = 20; y < height - 20 && found.length < 2; y += 9)
        if (stage.pick(x, y, 'keyframe') && (found.length === 0 || Math.hypot(x - found[0][0], y - found[0][1]) > 60)) found.push([x, y]);
    return model.keyframes.size > 0 ? found : [];
  });
  assert.equal(spots.length, 2, 'keyframes to click at');
  const stage = await page.locator('#stage').boundingBox();
  await page.mouse.click(stage.x + spots[0][0], stage.y + spots[0][1]);
  await until('a keyframe\'s numbers', async () => /Keyframe \d+/.test(await page.textContent('#keyframe')));
  done('keyframe clicked');
  await page.selectOption('#colouring', 'deviation');
  await page.keyboard.press('m');
  const points = await page.evaluate(() => {
    const found = [];
    for (let x = 230; x < 960 && found.length < 2; x += 7)
      for (let y = 30; y < 560 && found.length < 2; y += 7)
        if (window.twofold.stage.pick(x, y, 'point') && (found.length === 0 || Math.hypot(x - found[0][0], y - found[0][1]) > 120)) found.push([x, y]);
    return found;
  });
  for (const [x, y] of points) await page.mouse.click(stage.x + x, stage.y + y);
  await until('a distance', async () => /^\d[\d.]* c?m$/.test(await page.textContent('#tape')));
  done(`measured ${await page.textContent('#tape')}`);
  await page.screenshot({path: join(out, 'map.png')});
  const download = page.waitForEvent('download');
  await page.keyboard.press('s');
  assert.match((await download).suggestedFilename(), /^twofold-.*\.png$/);
  done('picture saved');
  assert.deepEqual(page.faults, []);
  await view.stop();
}

try {
  const live = await liveRun();
  await finishedRun(live);
  await keyframesAndTape(browser);
  console.log(`test_viewer: all shown; screenshots in ${out}`);
} finally {
  await browser.close();
}
