// Starts the program and a browser for tests, screenshots and measurements.
import {spawn} from 'node:child_process';
import {existsSync} from 'node:fs';
import {connect, createServer} from 'node:net';
import {join} from 'node:path';
import {chromium} from 'playwright-core';

export const TWOFOLD = process.env.TWOFOLD ?? 'build/release/apps/twofold/twofold';

const programs = [];
const pages = new Set();  // that are open
let isOutOfTime = false;  // `timeout` has said so
process.once('SIGTERM', () => {
  isOutOfTime = true;
  setTimeout(() => process.exit(124), 20000).unref();  // what is waited for may be no page
});
process.on('exit', () => {
  for (const program of programs) if (!program.ended) program.process.kill('SIGKILL');
});

/** What the page itself has thrown. */
const thrown = (page) => page.faults.filter((fault) => !/^(WebSocket connection|Failed to load resource)/.test(fault));

/** Until `check` gives something true; throws after `ms`, or when an open page has thrown something: nothing of it can be relied on then. */
export async function until(what, check, ms = 40000) {
  const end = performance.now() + ms;
  for (;;) {
    const value = await check();
    if (value) return value;
    const [fault] = [...pages].flatMap(thrown);
    if (fault) throw new Error(`a page's fault, while it was waited for ${what}: ${fault}`);
    if (isOutOfTime) throw new Error(`out of time: ${what}`);
    if (performance.now() > end) throw new Error(`in vain: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** For whoever has no more than the log of a test that failed: what the programs said, what is in the pages; their pictures go into a folder. */
export async function explain(folder) {
  for (const program of programs) console.error(`twofold ${program.args.join(' ')}\n  ${program.ended ? 'ended' : 'runs'}: ${program.text.slice(-2000).trim()}`);
  for (const [n, page] of [...pages].entries()) {
    console.error(`page ${page.url()}, faults: ${JSON.stringify(page.faults)}`);
    const hung = new Promise((_, reject) => setTimeout(() => reject(new Error('it does not answer')), 10000).unref());
    try {
      console.error(JSON.stringify(await Promise.race([page.evaluate(contents), hung]), null, 1));
      const path = join(folder, `failed_${n}.png`);
      await page.screenshot({path, timeout: 10000});
      console.error(`its picture: ${path}`);
    } catch (error) {
      console.error(`  ${error.message}`);
    }
  }
}

/** Within the page. */
function contents() {
  const text = (id) => document.getElementById(id)?.textContent;
  const sizes = [...document.querySelectorAll('canvas')].map((canvas) => `${canvas.id}: ${canvas.width}x${canvas.height}, shown ${canvas.clientWidth}x${canvas.clientHeight}`);
  const {twofold} = window;
  if (!twofold) return {message: text('message'), sizes};
  const {model, stage, timeline} = twofold;
  return {
    report: twofold.report(), state: text('state'), message: text('message'), fault: text('fault'), sizes,
    time: timeline.time, endTime: model.endTime(), dirty: stage.dirty, stale: twofold.stale, socket: twofold.connection.socket?.readyState,
    events: model.events.slice(-40).map(({kind, t, frame, text}) => `${kind} ${text} at ${t.toFixed(3)} s, frame ${frame}`),
  };
}

/** A running `twofold` that shows itself; `address` when it has said where. */
export class Program {
  constructor(args, cwd = '.') {
    this.args = args;
    this.text = '';
    this.ended = false;
    programs.push(this);
    this.process = spawn(TWOFOLD, args, {cwd, env: {...process.env, OPENBLAS_NUM_THREADS: '1'}});
    for (const stream of [this.process.stdout, this.process.stderr]) stream.on('data', (data) => (this.text += data));
    this.end = new Promise((resolve) => this.process.on('exit', (code) => {
      this.ended = true;
      resolve(code);
    }));
  }
  async address() {
    const found = () => this.text.match(/http:\S+token=\w+/);
    await until('the program\'s address', () => found() || this.ended, 90000);
    if (!found()) throw new Error(`the program ended: ${this.text}`);
    return found()[0];
  }
  stop(signal = 'SIGINT') {
    this.process.kill(signal);
    return this.end;
  }
}

/** A network between browser and program that can be cut. */
export class Network {
  static async to(address) {
    const network = new Network();
    const url = new URL(address);
    network.sockets = new Set();
    network.hung = new WeakSet();
    const program = {port: Number(url.port), host: url.hostname};
    network.server = createServer((near) => {
      const far = connect(program);
      for (const [socket, other] of [[near, far], [far, near]]) {
        network.sockets.add(socket);
        socket.on('error', () => {});
        socket.on('close', () => {
          network.sockets.delete(socket);
          if (!network.hung.has(other)) other.end();  // also after an error, of which a pipe says nothing
        });
        socket.pipe(other);
      }
    });
    await network.mend();
    url.port = String(network.port);
    network.address = url.href;
    return network;
  }
  mend() {
    return new Promise((resolve) => this.server.listen(this.port ?? 0, '127.0.0.1', () => {
      this.port = this.server.address().port;
      resolve();
    }));
  }
  /** Without a word: connections stay open, and nothing comes through any more. New ones are served. */
  hang() {
    for (const socket of this.sockets) {
      this.hung.add(socket);
      socket.unpipe();
      socket.pause();
    }
  }
  cut() {
    const closed = new Promise((resolve) => this.server.close(resolve));
    for (const socket of this.sockets) socket.destroy();
    return closed;
  }
}

export async function openBrowser() {
  const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find(existsSync);
  if (!executablePath) throw new Error('chromium is missing: scripts/setup --tests installs it');
  return chromium.launch({
    executablePath,
    handleSIGTERM: false,  // pages have yet to be explained
    args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
  });
}

/** A page that collects what goes wrong in it. */
export async function openPage(browser, address, options = {}) {
  const context = await browser.newContext({viewport: {width: 1280, height: 800}, colorScheme: 'dark', ...options});
  const page = await context.newPage();
  page.faults = [];
  page.on('console', (message) => message.type() === 'error' && page.faults.push(message.text()));
  page.on('pageerror', (error) => page.faults.push(String(error)));
  pages.add(page);
  page.on('close', () => pages.delete(page));
  page.opened = performance.now();
  await page.goto(address);
  return page;
}

/** Until nothing is left to be drawn: for pages to which nothing new comes. */
export const settled = (page) => until('a picture that is whole', () => page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => {
  const {dirty, fence} = window.twofold.stage;
  resolve(!dirty && !fence);
}))));

export const report = (page) => page.evaluate(() => window.twofold?.report() ?? {});

/** Pixels of a canvas whose colour is within `within` of a colour, each of red, green and blue. */
export function countPixels(page, selector, colour, within = 24) {
  return page.evaluate(([selector, colour, within]) => {
    const canvas = document.querySelector(selector);
    const copy = document.createElement('canvas');
    copy.width = canvas.width;
    copy.height = canvas.height;
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    const data = context.getImageData(0, 0, copy.width, copy.height).data;
    const wanted = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
    let count = 0;
    for (let i = 0; i < data.length; i += 4)
      if (data[i + 3] > 128 && wanted.every((x, k) => Math.abs(data[i + k] - x) <= within)) ++count;
    return count;
  }, [selector, colour, within]);
}

/** Places of the picture, in pixels, at which something can be picked. */
export const places = (page, what, apart) => page.evaluate(([what, apart]) => {
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
