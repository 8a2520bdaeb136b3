// Starts the program and a browser for tests, screenshots and measurements.
import {spawn} from 'node:child_process';
import {existsSync} from 'node:fs';
import {connect, createServer} from 'node:net';
import {chromium} from 'playwright-core';

export const TWOFOLD = process.env.TWOFOLD ?? 'build/release/apps/twofold/twofold';

/** Until `check` gives something true; throws after `ms`. */
export async function until(what, check, ms = 40000) {
  const end = performance.now() + ms;
  for (;;) {
    const value = await check();
    if (value) return value;
    if (performance.now() > end) throw new Error(`in vain: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** A running `twofold` that shows itself; `address` when it has said where. */
export class Program {
  constructor(args, cwd = '.') {
    this.text = '';
    this.ended = false;
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
    const program = {port: Number(url.port), host: url.hostname};
    network.server = createServer((near) => {
      const far = connect(program);
      for (const [socket, other] of [[near, far], [far, near]]) {
        network.sockets.add(socket);
        socket.on('error', () => {});
        socket.on('close', () => network.sockets.delete(socket));
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
  page.opened = performance.now();
  await page.goto(address);
  return page;
}

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
