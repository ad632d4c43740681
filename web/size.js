// Prints how many bytes the page costs once, compressed, and fails above the limits: of what every
// visitor loads, and of what is loaded only where the race is shown in three dimensions.
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { gzipSync } from 'node:zlib';

const FIRST = { name: 'first load', most: 120 };
// Chunks by the module that they begin with; each is counted without what was loaded before it.
const LATER = [
  { name: '3-D', begins: /^view-/, most: 250 },
  { name: 'headset', begins: /^session-/, most: 60 },
  { name: 'sound', begins: /^player-/, most: 4 },
  { name: 'steward', begins: /^Steward-/, most: 8 },
  { name: 'telemetry', begins: /^Telemetry-/, most: 4 },
  { name: 'event', begins: /^EventPanel-/, most: 6 },
  { name: 'protest', begins: /^ProtestForm-/, most: 2 },
  { name: 'stints', begins: /^Stints-/, most: 2 },
  { name: 'coach', begins: /^CoachWords-/, most: 4 },
];
const folder = new URL('../race_server/live/gateway/page/', import.meta.url).pathname;
const assets = join(folder, 'assets');

function kibOf(path) {
  return gzipSync(readFileSync(path), { level: 9 }).length / 1024;
}

/** Returns the files that a file needs before it runs: imports that are not made on demand. */
function needs(name) {
  const text = readFileSync(join(assets, name), 'utf8');
  const found = text.matchAll(/(?:from|import)\s*["']\.\/([\w.-]+\.js)["']/g);
  return [...found].map((match) => match[1]);
}

function closure(names, before) {
  const all = new Set();
  const waiting = [...names];
  while (waiting.length) {
    const name = waiting.pop();
    if (all.has(name) || before.has(name)) continue;
    all.add(name);
    if (name.endsWith('.js')) waiting.push(...needs(name));
  }
  return all;
}

let isTooLarge = false;
function report({ name, most }, files, more = 0) {
  let total = more;
  for (const file of files) {
    const size = kibOf(join(assets, file));
    total += size;
    console.log(`${size.toFixed(1).padStart(7)} KiB  ${file}`);
  }
  console.log(`${total.toFixed(1).padStart(7)} KiB  ${name}, of at most ${most}`);
  isTooLarge ||= total > most;
}

const names = readdirSync(assets);
const index = readFileSync(join(folder, 'index.html'), 'utf8');
const first = closure(
  names.filter((name) => index.includes(name)),
  new Set(),
);
report(FIRST, first, kibOf(join(folder, 'index.html')));
const loaded = new Set(first);
for (const chunk of LATER) {
  const files = closure(
    names.filter((name) => chunk.begins.test(name)),
    loaded,
  );
  report(chunk, files);
  for (const file of files) loaded.add(file);
}
const rest = names.filter((name) => !loaded.has(name));
if (rest.length) console.log(`no limit is set for ${rest.join(', ')}`);
process.exit(isTooLarge || rest.length ? 1 : 0);
