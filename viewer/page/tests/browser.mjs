// A live run, a late joiner, a finished run and a map file in a browser: node browser.mjs OUTPUT_FOLDER
import assert from 'node:assert/strict';
import {mkdirSync} from 'node:fs';
import {join} from 'node:path';
import {Network, Program, countPixels, explain, openBrowser, openPage, places, report, settled, until} from './program.mjs';

const out = process.argv[2];
mkdirSync(out, {recursive: true});
const browser = await openBrowser();
const began = performance.now();
const done = (what, ms) => console.log(`${((performance.now() - began) / 1000).toFixed(0).padStart(4)} s  ${what}${ms === undefined ? '' : `: ${ms.toFixed(0)} ms`}`);
/**
 * A promised time beside the one that was taken. It is printed; only a multiple of it fails the test, since other programs have the
 * processors of a tester's machine, too: ten times as long is not load any more, but a page that is broken.
 */
const GENEROUS = 10;
const within = (what, wanted, ms) => {
  console.log(`        ${what}: wanted <= ${wanted} ms, got ${ms.toFixed(0)} ms: ${ms <= wanted ? 'met' : 'MISSED'}`);
  assert.ok(ms <= GENEROUS * wanted, `${what} took ${ms.toFixed(0)} ms, ${wanted} ms were promised`);
};
/** Drawn as fast as it can. */
async function picturesASecond(page) {
  const rate = await page.evaluate(() => new Promise((resolve) => {
    const {stage} = window.twofold;
    const [before, began] = [stage.drawn, performance.now()];
    const again = () => {
      stage.redraw();
      const seconds = (performance.now() - began) / 1000;
      if (seconds < 3) requestAnimationFrame(again);
      else resolve((stage.drawn - before) / seconds);
    };
    again();
  }));
  console.log(`        pictures a second: wanted >= 20, got ${rate.toFixed(1)}: ${rate >= 20 ? 'met' : 'MISSED'}`);
  assert.ok(rate > 0, 'nothing is drawn');
}
const has = async (page, what, selector, colour, least) => {
  let pixels = 0;
  await until(`${what}: ${least} pixels of ${colour}`, async () => (pixels = await countPixels(page, selector, colour)) >= least);
  done(`${what}: ${pixels} pixels of ${colour}`);
};
const says = (page, selector, words) => until(`${selector} says ${words}`, async () => words.test(await page.textContent(selector)));
/** A socket that breaks is what some of the tests are about. */
const expectNoFaults = (page) => assert.deepEqual(page.faults.filter((fault) => !/WebSocket|ERR_CONNECTION/.test(fault)), []);

/** At three frames a second the run lasts for 200 s: what is done while it does took 133 s with eleven other programs beside. */
async function liveRun() {
  const recording = new Program(['render', 'synthetic:courtyard?frames=600&rounds=1&width=320&height=240', '--out', join(out, 'recording')]);
  assert.equal(await recording.end, 0, recording.text);
  done('rendered');
  const run = new Program(['run', join(out, 'recording'), '--preload', '--speed', '0.1', '--late', 'drop', '--windows', '8,40', '--quiet',
    '--view', '0', '--view-control', '--out', join(out, 'run'), '--save-map', join(out, 'map.tfm')]);
  const network = await Network.to(await run.address());
  const page = await openPage(browser, network.address);
  await until('a first picture', async () => (await report(page)).drawn > 0);
  within('first picture', 1000, performance.now() - page.opened);
  assert.ok(!page.url().includes('token'), 'the token stays in the address line');
  await until('fifteen keyframes', async () => (await report(page)).keyframes >= 15, 60000);
  await says(page, '#state', /^(tracked|lost)/);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 60);
  await has(page, 'inner window', '#stage', '#ffb000', 60);
  await has(page, 'outer window', '#stage', '#3d9bff', 60);
  await has(page, 'the camera', '#stage', '#ffffff', 20);
  await until('the camera\'s image, without a key', () => page.isVisible('#sight'));
  await has(page, 'points measured in the image', '#sight canvas', '#35f0a8', 60);
  await has(page, 'search regions in the image', '#sight canvas', '#ffd666', 60);
  await says(page, '#sight figcaption', /points measured/);

  assert.ok(await page.evaluate(() => window.twofold.strip.plot.ctx.getContextAttributes().willReadFrequently), 'the stages\' plot waits for the big picture');
  await engineInWords(page);
  await picturesASecond(page);
  await page.keyboard.press('3');  // the view stands still while keyframes are clicked at
  await keyframeImage(page);
  await lateJoiner(page, network.address);
  await page.keyboard.press('1');
  await page.waitForTimeout(1500);
  await page.screenshot({path: join(out, 'live.png')});
  await cutNetwork(page, network);
  await hangNetwork(page, network);
  await page.reload();
  await until('all of it after a reload', async () => (await report(page)).keyframes >= 15);
  done('reloaded');
  const live = await command(page, run);
  await network.cut();
  return live;
}

/** How far it is behind, what waits, what was late: with names, and nothing of it, nor of the head, out of the page at 1400 pixels. */
async function engineInWords(page) {
  const small = page.viewportSize();
  await page.setViewportSize({width: 1400, height: 800});
  for (const words of [/behind the recording\d[\d.]* m?s, \d[\d.]* frames/, /tracker’s queue\d+ frames?, read ahead/, /mapper’s queue\d+ keyframe/,
    /loop closer’s queue\d+ keyframe/, /late(none|\d+: (it waited|tracking it took))/, /lostnone/, /dropped(none|\d)/]) await says(page, '#engine', words);
  const hidden = await page.evaluate(() => {
    const boxes = [...document.querySelectorAll('#title, #state, #figures > div, #commands > button, header > nav > button')].filter((part) => part.offsetWidth > 0);
    const lines = [...document.querySelectorAll('#engine > div')].filter((line) => line.getBoundingClientRect().bottom > document.querySelector('#strip-row').getBoundingClientRect().bottom);
    const rights = boxes.map((part) => part.getBoundingClientRect());
    const covered = boxes.filter((_, n) => rights[n].right > innerWidth || rights[n].height > 40 || rights.some((other, m) => m !== n && rights[n].left < other.right - 1 && other.left < rights[n].right - 1));
    return [...covered, ...lines].map((part) => part.textContent);
  });
  assert.deepEqual(hidden, [], 'out of the page, or one over the other');
  assert.match(await page.textContent('#figures'), /frame[\d,]+keyframes\d+points[\d,]+/);
  assert.match(await page.textContent('#windows'), /inner.*outer/);
  assert.equal(await page.evaluate(() => window.twofold.model.hello.efforts.at(-1)), 'drop frames');
  await page.setViewportSize(small);
  done('the engine in words, the head whole at 1400 pixels');
}

/** No window is known: the legend has the colour that all keyframes have. */
async function greyKeyframes(page) {
  assert.ok(!(await page.isVisible('#windows')), 'windows in the legend');
  const [sample, drawn] = await page.evaluate(() => {
    const colour = window.twofold.stage.palette.keyframe;
    return [getComputedStyle(document.querySelector('#layer-keyframes').parentElement.querySelector('i')).backgroundColor, `#${colour.getHexString()}`];
  });
  const [r, g, b] = [1, 3, 5].map((at) => parseInt(drawn.slice(at, at + 2), 16));
  assert.equal(sample, `rgb(${r}, ${g}, ${b})`);
  done('keyframes are as the legend has them');
}

/** A click at a keyframe shows what the camera saw there; another one something else. @return the places, where the view stood still */
async function keyframeImage(page) {
  const stage = await page.locator('#stage').boundingBox();
  const shown = [];
  const found = await places(page, 'keyframe', 60);
  for (const [x, y] of found) {
    await page.mouse.click(stage.x + x, stage.y + y);
    await until('the keyframe\'s image', () => page.evaluate((before) => {
      const image = document.querySelector('#keyframe-image');
      return !image.hidden && image.complete && image.naturalWidth === 320 && image.src !== before && image.src;
    }, shown.at(-1) ?? ''));
    shown.push(await page.getAttribute('#keyframe-image', 'src'));
  }
  assert.equal(shown.length, 2, 'keyframes to click at');
  done('images of two keyframes');
  return found;
}

async function lateJoiner(page, address) {
  const late = await openPage(browser, address);
  await until('all of it', async () => {
    const [now, then] = [await report(page), await report(late)];
    return then.keyframes >= now.keyframes - 1 && then.points > 0.97 * now.points && then.path >= now.path - 20;
  });
  within('late joiner', 2000, performance.now() - late.opened);
  expectNoFaults(late);
  await late.context().close();
}

async function cutNetwork(page, network) {
  await network.cut();
  await says(page, '#message', /connection lost|reached/);
  const before = await report(page);
  await page.waitForTimeout(10000);
  await network.mend();
  await until('the page recovers', async () => {
    const now = await report(page);
    return now.link === 'open' && now.newest > before.newest && now.path > before.path;
  });
  done('network cut for ten seconds and mended');
}

/** A page that is told nothing finds it out itself. */
async function hangNetwork(page, network) {
  const before = await report(page);
  network.hang();
  await until('the page gives the silent connection up and comes back', async () => {
    const now = await report(page);
    return now.link === 'open' && now.newest > before.newest + 60 && now.path > before.path;
  });
  done('network hung without a word, and noticed');
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
  await until('all that the run had to say', () => page.evaluate(() => window.twofold.connection.tries > 0));  // the socket was closed behind it
  const now = await report(page);
  now.picture = await mapPicture(page);
  assert.ok(now.path >= 60 && now.keyframes >= 15 && now.inner > 0, JSON.stringify(now));
  done(`commands obeyed; the end is told: ${now.path} frames, ${now.keyframes} keyframes, ${now.events} events`);
  expectNoFaults(page);
  await page.context().close();
  return now;
}

/** What is left of the map when the run is over, from above, without what only a live run has. */
async function mapPicture(page) {
  await page.evaluate(() => {
    document.body.classList.add('finished');
    document.querySelector('#commands').hidden = true;
    for (const layer of ['keyframes', 'covisible', 'marginalised', 'returns', 'causal']) window.twofold.setLayer(layer, false);
  });
  await page.keyboard.press('2');
  await settled(page);
  const picture = await page.evaluate(() => document.querySelector('#stage').toDataURL());
  await page.evaluate(() => {
    for (const layer of ['keyframes', 'covisible', 'marginalised', 'returns', 'causal']) window.twofold.setLayer(layer, true);
  });
  return picture;
}

/** Share of what either picture shows that the other one does not have within two pixels. */
const difference = (page, pictures) => page.evaluate(async (pictures) => {
  const [a, b] = await Promise.all(pictures.map(async (source) => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [image.width, image.height];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const {data} = context.getImageData(0, 0, image.width, image.height);
    const isShown = (u, v) => u >= 0 && v >= 0 && u < image.width && v < image.height &&
      Math.max(...data.subarray(4 * (v * image.width + u), 4 * (v * image.width + u) + 3)) > 96;
    return {width: image.width, height: image.height, isShown};
  }));
  if (a.width !== b.width || a.height !== b.height) return `${a.width}x${a.height} and ${b.width}x${b.height}`;
  let shown = 0;
  let missing = 0;
  for (const [one, other] of [[a, b], [b, a]]) {
    for (let v = 0; v < a.height; ++v) {
      for (let u = 0; u < a.width; ++u) {
        if (!one.isShown(u, v)) continue;
        ++shown;
        let near = false;
        for (let dv = -2; dv <= 2 && !near; ++dv) for (let du = -2; du <= 2 && !near; ++du) near = other.isShown(u + du, v + dv);
        if (!near) ++missing;
      }
    }
  }
  return missing / shown;
}, pictures);

async function finishedRun(live) {
  const view = new Program(['view', join(out, 'run'), '--port', '0', '--secrets', join(out, 'secrets')]);
  const address = await view.address();
  const page = await openPage(browser, address);
  await until('path and points', async () => {
    const {path, points} = await report(page);
    return path >= live.path - 2 && points >= 0.97 * live.points;
  });
  const {edges, truth} = await report(page);
  assert.ok(edges > 20 && truth > 20, `${edges} edges, ${truth} true positions`);
  await greyKeyframes(page);
  const different = await difference(page, [live.picture, await mapPicture(page)]);
  assert.ok(different < 0.02, `the run's last picture and that of the finished run: ${different}`);
  done(`the same picture as at the run's end, but for ${(100 * different).toFixed(2)} %`);
  await page.keyboard.press('2');
  await has(page, 'final path', '#stage', '#2ee6a6', 200);
  await settled(page);
  const whole = await countPixels(page, '#stage', '#2ee6a6');
  const box = await page.locator('#timeline').boundingBox();
  await page.mouse.click(box.x + box.width / 3, box.y + 24);
  await until('less of the path', async () => (await countPixels(page, '#stage', '#2ee6a6')) < 0.7 * whole);
  done('time slider');
  await page.keyboard.press('End');
  await until('all of the path', async () => (await countPixels(page, '#stage', '#2ee6a6')) > 0.9 * whole);
  const [x, y] = (await keyframeImage(page)).at(-1);
  const {x: left, y: top} = await page.locator('#stage').boundingBox();
  await page.mouse.click(left + x, top + y);
  assert.ok(await page.isVisible('#keyframe-image'), 'a second click takes the image away');
  await page.screenshot({path: join(out, 'finished.png')});
  await page.keyboard.press('t');
  await has(page, 'light theme', '#stage', '#00895e', 100);
  await page.screenshot({path: join(out, 'light.png')});
  expectNoFaults(page);
  await view.stop('SIGKILL');
  await says(page, '#message', /lost|reached/);
  done('it is said that the program was killed');
  const {port} = new URL(address);
  const again = new Program(['view', join(out, 'run'), '--port', port, '--secrets', join(out, 'secrets')]);
  assert.equal(await again.address(), address, 'the address stays the same');
  await until('the page comes back to the program that was started anew', async () => (await report(page)).link === 'open');
  done('started anew: the page came back');
  await again.stop();
  await page.context().close();
  return port;
}

/** Round a cloister, back to where it began: event and edges of the loop, in their colours. */
async function closedLoop() {
  const recording = join(out, 'cloister');
  const rendering = new Program(['render', 'synthetic:cloister', '--out', recording]);
  assert.equal(await rendering.end, 0, rendering.text);
  const run = new Program(['run', recording, '--preload', '--speed', '2', '--quiet', '--view', '0', '--out', join(out, 'loop_run')]);
  const page = await openPage(browser, await run.address());
  await until('a loop', async () => (await report(page)).loops > 0, 90000);
  assert.match(await page.evaluate(() => window.twofold.model.hello.efforts.at(-1)), /no frame is dropped/);
  await says(page, '#events', /loop/);
  await page.evaluate(() => {  // the edge is short once the map has been bent: as near as two metres
    const {model, stage} = window.twofold;
    const edge = [...model.edges.values()].find((one) => one.loop > 0);
    stage.setView('free');
    stage.lookAt(model.keyframes.get(edge.to).position);
    stage.camera.position.lerp(stage.controls.target, 1 - 2 / stage.camera.position.distanceTo(stage.controls.target));
    stage.redraw();
  });
  await has(page, 'edges of a closed loop', '#stage', '#ff5a5f', 20);
  await has(page, 'the loop on the time line', '#timeline', '#ffd166', 10);
  await savedWithLoop(page);
  await page.screenshot({path: join(out, 'loop.png')});
  expectNoFaults(page);
  await run.stop();
  await page.context().close();
}

/** The map was saved with the keyframe that then closed a loop, which is told later: the time line shows both. */
async function savedWithLoop(page) {
  const tip = await page.evaluate(() => {
    const {model, timeline} = window.twofold;
    const loop = model.events.find((event) => event.kind === 'loop');
    model.events = [{...loop, kind: 'map saved', text: 'map.tfm', loop: null}, loop];
    timeline.draw();
    const canvas = document.querySelector('#timeline');
    const {left, top} = canvas.getBoundingClientRect();
    canvas.dispatchEvent(new PointerEvent('pointermove', {clientX: left + timeline.x(loop.t), clientY: top + 9}));
    return document.querySelector('#tip').textContent;
  });
  for (const [what, colour] of [['the saved map', '#6ac8ff'], ['the loop below it', '#ffd166']]) {
    const pixels = await countPixels(page, '#timeline', colour);
    assert.ok(pixels >= 20, `${what}: ${pixels} pixels of ${colour} on the time line`);
  }
  assert.match(tip, /^map saved · map\.tfm\nloop · [^\n]+$/);
  done('a map that was saved with the keyframe of a loop, and the loop');
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

async function keyframesAndTape(view) {
  const page = await openPage(browser, await view.address());
  await until('the map', async () => (await report(page)).points > 500);
  await greyKeyframes(page);
  await page.keyboard.press('2');
  await settled(page);
  const stage = await page.locator('#stage').boundingBox();
  const [keyframe] = await places(page, 'keyframe', 60);
  assert.ok(keyframe, 'a keyframe to click at');
  await page.mouse.click(stage.x + keyframe[0], stage.y + keyframe[1]);
  await says(page, '#keyframe', /Keyframe \d+/);
  done('keyframe clicked');
  assert.ok(!(await page.locator('#keyframe-image').isVisible()), 'a map file has no images');
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
  await closedLoop();
  const port = await finishedRun(live);
  await keyframesAndTape(await telephone(port));
  done(`test_viewer: all shown; screenshots in ${out}`);
} catch (error) {
  await explain(out);
  throw error;
} finally {
  await browser.close();
}
