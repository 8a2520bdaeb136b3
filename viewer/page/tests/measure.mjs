// The figures of docs/results.md: node measure.mjs run|map|hour OUTPUT_FOLDER
import {mkdirSync, readFileSync, readdirSync} from 'node:fs';
import {join} from 'node:path';
import {Program, openBrowser, openPage, report, until} from './program.mjs';
import {Reader} from './reader.mjs';

const [what, out] = process.argv.slice(2);
mkdirSync(out, {recursive: true});

/** Seconds that a thread of a process has run. */
function threadSeconds(pid, name) {
  for (const task of readdirSync(`/proc/${pid}/task`)) {
    if (readFileSync(`/proc/${pid}/task/${task}/comm`, 'utf8').trim() !== name) continue;
    const fields = readFileSync(`/proc/${pid}/task/${task}/stat`, 'utf8').split(') ')[1].split(' ');
    return (Number(fields[11]) + Number(fields[12])) / 100;
  }
  return NaN;
}

function memory(pid) {
  return Number(readFileSync(`/proc/${pid}/status`, 'utf8').match(/VmRSS:\s+(\d+)/)[1]) / 1024;
}

/** A live run with viewers, one of which reads nothing if there are several. */
async function oneRun(viewers, name) {
  const source = 'synthetic:courtyard?frames=600&rounds=1';
  const view = viewers === null ? [] : ['--view', '0'];
  const run = new Program(['run', source, '--preload', '--speed', '1', '--late', 'drop', '--quiet', '--out', join(out, name), ...view]);
  let readers = [];
  if (viewers !== null) {
    const address = await run.address();
    await new Promise((resolve) => setTimeout(resolve, 1000));
    readers = Array.from({length: viewers}, (_, n) => new Reader(address, n + 1 < viewers || viewers === 1));
  }
  const begin = performance.now();
  let seconds = NaN;
  let began = NaN;
  let megabytes = 0;
  const sample = setInterval(() => {
    try {
      const now = threadSeconds(run.process.pid, 'viewer');
      if (Number.isNaN(began)) began = now;
      if (!Number.isNaN(now)) seconds = now - began;
      megabytes = Math.max(megabytes, memory(run.process.pid));
    } catch { /* it has ended */ }
  }, 250);
  await run.end;
  clearInterval(sample);
  for (const reader of readers) reader.close();
  const took = (performance.now() - begin) / 1000;
  const timing = JSON.parse(readFileSync(join(out, name, 'timing.json'), 'utf8'));
  const frame = timing.tracker.frame;
  const listener = timing.tracker['frame listener'];
  const told = readers.map((reader) => `${reader.messages} messages, ${(reader.bytes / 1e6).toFixed(1)} MB`).join('; ');
  const share = (100 * seconds) / took;
  console.log(`${name}: tracker p50 ${frame.p50_ms.toFixed(2)} p99 ${frame.p99_ms.toFixed(2)} max ${frame.max_ms.toFixed(2)} ms, listener p99 ` +
    `${listener ? (1000 * listener.p99_ms).toFixed(0) : 0} us, viewer ${share.toFixed(1)} % of a core, ${megabytes.toFixed(0)} MB; ${told}`);
  return {p99: frame.p99_ms, share, megabytes};
}

async function runs() {
  const kinds = [[null, 'no viewer'], [0, 'nobody looks'], [1, '1 viewer'], [4, '4 viewers, one reads nothing']];
  const found = new Map(kinds.map(([, name]) => [name, []]));
  for (let round = 0; round < Number(process.env.ROUNDS ?? 2); ++round) {
    for (const [viewers, name] of kinds) found.get(name).push(await oneRun(viewers, `${name} ${round}`));
  }
  const median = (name, figure) => quantile(found.get(name).map((run) => run[figure]), 0.5);
  const without = median('no viewer', 'p99');
  for (const [, name] of kinds.slice(1)) {
    const more = 100 * (median(name, 'p99') / without - 1);
    verdict(`tracker p99, ${name}`, 'at most 5 % more than without', `${more.toFixed(1)} %`, more <= 5);
  }
  const spread = found.get('no viewer').map((run) => run.p99);
  const share = median('1 viewer', 'share');
  console.log(`  runs without viewer differ by ${(100 * (Math.max(...spread) / Math.min(...spread) - 1)).toFixed(1)} % among themselves`);
  verdict('viewer\'s thread with one viewer', 'at most 3 % of a core', `${share.toFixed(1)} %`, share <= 3);
}

/** What was wanted, what there is, and whether that is enough. */
function verdict(what, wanted, got, isEnough) {
  console.log(`  ${what}: wanted ${wanted}, got ${got}: ${isEnough ? 'met' : 'MISSED'}`);
}

const quantile = (values, q) => values.sort((a, b) => a - b)[Math.floor(q * (values.length - 1))];

/** Generated maps in a browser with WebGL in software. */
async function maps() {
  const browser = await openBrowser();
  for (const points of [100000, 2000000]) {
    const load = new Program([String(points), '100']);
    const address = await load.address();
    const page = await openPage(browser, address);
    const first = await until('a picture', async () => (await report(page)).keyframes > 0 && performance.now() - page.opened);
    const all = await until('all points', async () => (await report(page)).points === points && performance.now() - page.opened, 60000);
    await page.waitForTimeout(6000);
    const delays = await page.evaluate(() => new Promise((resolve) => {
      const delays = [];
      let last = -1;
      const drawn = () => {
        const newest = window.twofold.model.live.at(-1);
        if (newest && newest.frame !== last) {
          last = newest.frame;
          delays.push((Date.now() % 0x80000000) - newest.frame);
        }
        if (delays.length < 100) requestAnimationFrame(drawn);
        else resolve(delays);
      };
      requestAnimationFrame(drawn);
    }));
    const before = await report(page);
    const began = performance.now();
    await page.waitForTimeout(5000);
    const after = await report(page);
    const drawn = (1000 * (after.drawn - before.drawn)) / (performance.now() - began);
    const heap = await page.evaluate(() => performance.memory.usedJSHeapSize / 1e6);
    console.log(`${points} points: keyframes after ${first.toFixed(0)} ms, all after ${all.toFixed(0)} ms, ${drawn.toFixed(1)} pictures a second, ` +
      `${after.frameMs.toFixed(0)} ms each with ${(100 * after.share).toFixed(0)} % of the points, pose to picture p50 ${quantile(delays, 0.5)} p95 ${quantile(delays, 0.95)} ms, heap ${heap.toFixed(0)} MB, server ${memory(load.process.pid).toFixed(0)} MB`);
    const delay = quantile(delays, 0.5);
    if (points <= 100000) verdict('first picture', '<= 1000 ms', `${first.toFixed(0)} ms`, first <= 1000);
    else verdict('load', '<= 5000 ms', `${all.toFixed(0)} ms`, all <= 5000);
    verdict('pictures a second', '>= 20', drawn.toFixed(1), drawn >= 20);
    verdict('pose to picture, median', '<= 100 ms', `${delay} ms`, delay <= 100);
    await page.screenshot({path: join(out, `${points}.png`)});
    await load.stop('SIGKILL');
    await page.context().close();
  }
  await browser.close();
}

/** What the browser holds while an hour of frames goes by, sixty times as fast. */
async function hour() {
  const browser = await openBrowser();
  const load = new Program(['20000', '90', '60']);
  const page = await openPage(browser, await load.address());
  const client = await page.context().newCDPSession(page);
  const heaps = [];
  for (let minute = 10; minute <= 60; minute += 10) {
    await page.waitForTimeout(10000);
    for (let n = 0; n < 2; ++n) await client.send('HeapProfiler.collectGarbage');  // the first finds what the second may free
    const heap = (await client.send('Runtime.getHeapUsage')).usedSize / 1e6;
    const held = await page.evaluate(() => [window.twofold.model.endTime() / 60, window.twofold.model.path.length]);
    heaps.push(heap);
    console.log(`minute ${held[0].toFixed(0)}: heap ${heap.toFixed(1)} MB, ${held[1]} frames of the path, server ${memory(load.process.pid).toFixed(1)} MB`);
  }
  const growth = heaps.at(-1) / heaps[0];  // the first ten minutes fill what is bounded
  verdict('heap of an hour', 'the last at most 1.25 times the first', growth.toFixed(2), growth <= 1.25);
  await load.stop('SIGKILL');
  await browser.close();
}

if (what === 'run') await runs();
else if (what === 'hour') await hour();
else await maps();
