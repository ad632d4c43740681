// Prints how many bytes the page costs once, compressed, and fails above the limit.
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { gzipSync } from 'node:zlib';

const MOST_KIB = 120;
const folder = new URL('../race_server/live/gateway/page/', import.meta.url).pathname;

function filesIn(path) {
  return readdirSync(path, { withFileTypes: true }).flatMap((entry) =>
    entry.isDirectory() ? filesIn(join(path, entry.name)) : [join(path, entry.name)],
  );
}

let total = 0;
for (const file of filesIn(folder).filter((name) => /\.(js|css|html)$/.test(name))) {
  const size = gzipSync(readFileSync(file), { level: 9 }).length;
  total += size;
  console.log(`${(size / 1024).toFixed(1).padStart(7)} KiB  ${file.slice(folder.length)}`);
}
console.log(`${(total / 1024).toFixed(1).padStart(7)} KiB  of at most ${MOST_KIB}`);
process.exit(total / 1024 > MOST_KIB ? 1 : 0);
