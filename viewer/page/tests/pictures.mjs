// The pictures of docs/viewer.md: node pictures.mjs SOURCE FOLDER
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {Program, openBrowser, openPage, report, until} from './program.mjs';

const [source, folder] = process.argv.slice(2);
const scratch = mkdtempSync(join(tmpdir(), 'viewer-'));
const map = join(scratch, 'map.tfm');
const browser = await openBrowser();
const picture = (page, name) => page.screenshot({path: join(folder, name), type: 'jpeg', quality: 72});
try {
  const run = new Program(['run', source, '--preload', '--speed', '1', '--late', 'drop', '--quiet', '--view', '0', '--save-map', map, '--out', join(scratch, 'run')]);
  const page = await openPage(browser, await run.address());
  await until('keyframes', async () => (await report(page)).keyframes > 5);
  await page.keyboard.press('i');
  await until('most of the run', async () => run.ended || (await page.evaluate(() => window.twofold.model.endTime())) > 24, 240000);
  await picture(page, 'viewer_live.jpg');
  await run.end;
  const view = new Program(['view', map, '--port', '0']);
  const still = await openPage(browser, await view.address());
  await until('the map', async () => (await report(still)).points > 100);
  await still.keyboard.press('2');
  await still.waitForTimeout(2000);
  await picture(still, 'viewer_map.jpg');
  await view.stop();
} finally {
  await browser.close();
  rmSync(scratch, {recursive: true});
}
