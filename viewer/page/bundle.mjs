// Bundles the page and writes it as a C++ file of compressed bytes:
//   node bundle.mjs NODE_MODULES LICENSE OUTPUT.cpp
import {createRequire} from 'node:module';
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';
import {gzipSync} from 'node:zlib';

const [modules, license, output] = process.argv.slice(2).map((path) => resolve(path));
const source = join(dirname(fileURLToPath(import.meta.url)), 'src');
const {build} = createRequire(join(modules, 'bundle.js'))('esbuild');

const result = await build({
  entryPoints: {page: join(source, 'main.ts')},
  bundle: true,
  minify: true,
  target: ['es2022'],
  format: 'esm',
  nodePaths: [modules],
  metafile: true,
  write: false,
  outdir: 'out',
  logLevel: 'warning',
});

/** Licence texts of everything that the bundle holds; fails for a package that has none. */
function licences(inputs) {
  const packages = new Set();
  for (const input of inputs) {
    const match = input.match(/node_modules\/((?:@[^/]+\/)?[^/]+)\//);
    if (match) packages.add(match[1]);
  }
  const own = `Twofold\n\n${readFileSync(license, 'utf8')}`;
  const others = [...packages].sort().map((name) => {
    const {version} = JSON.parse(readFileSync(join(modules, name, 'package.json'), 'utf8'));
    return `${name} ${version}\n\n${readFileSync(join(modules, name, 'LICENSE'), 'utf8')}`;
  });
  return [own, ...others].join(`\n${'-'.repeat(80)}\n\n`);
}

const bundled = (extension) => result.outputFiles.find((file) => file.path.endsWith(extension)).contents;
const files = [
  ['/', 'text/html; charset=utf-8', readFileSync(join(source, 'index.html'))],
  ['/page.js', 'text/javascript; charset=utf-8', bundled('.js')],
  ['/page.css', 'text/css; charset=utf-8', bundled('.css')],
  ['/icon.svg', 'image/svg+xml', readFileSync(join(source, 'icon.svg'))],
  ['/licences.txt', 'text/plain; charset=utf-8', Buffer.from(licences(Object.keys(result.metafile.inputs)))],
];

/** A string literal, in lines; three digits for each byte, so that no digit behind it is taken for one of its own. */
function literal(bytes) {
  const lines = [];
  for (let i = 0; i < bytes.length; i += 40) {
    const escaped = [...bytes.subarray(i, i + 40)].map((byte) => '\\' + byte.toString(8).padStart(3, '0'));
    lines.push(`    "${escaped.join('')}"`);
  }
  return lines.join('\n');
}

const entries = files.map(([path, type, contents]) => {
  const bytes = gzipSync(contents, {level: 9});
  return `  {"${path}", "${type}", {\n${literal(bytes)},\n    ${bytes.length}}},`;
});
writeFileSync(output, `// Written by viewer/page/bundle.mjs.
#include "viewer/page_files.hpp"

namespace twofold {
namespace {

constexpr PageFile kFiles[] = {
${entries.join('\n')}
};

}  // namespace

std::span<const PageFile> page_files() {
  return kFiles;
}

}  // namespace twofold
`);
