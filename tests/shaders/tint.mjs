// Tint's opinion of WGSL: the npm package `webgpu` is Dawn, and its null backend needs neither GPU nor driver.
//   node tint.mjs FOLDER PROGRAMS.json
// FOLDER has node_modules/; the JSON is a list of { name, wgsl }. One line for each that Tint refuses; the exit status is then 1.
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [folder, programs] = process.argv.slice(2);
const entry = path.resolve(folder, 'node_modules/webgpu/index.js');
if (!fs.existsSync(entry)) {
  console.log(`${entry} is not there; tests/run installs it (the npm package webgpu)`);
  process.exit(1);
}
const { create } = await import(pathToFileURL(entry).href);
// Kept while anything of it is used: what it made does not keep it alive.
globalThis.gpu = create(['backend=null']);
const adapter = await gpu.requestAdapter();
const device = await adapter.requestDevice();
let refused = 0;
for (const { name, wgsl } of JSON.parse(fs.readFileSync(programs, 'utf8'))) {
  device.pushErrorScope('validation');
  const module = device.createShaderModule({ code: wgsl });
  const { messages } = await module.getCompilationInfo();
  const failed = await device.popErrorScope();
  const error = messages.find(message => message.type === 'error');
  if (!error && !failed) continue;
  refused++;
  console.log(error ? `${name}:${error.lineNum}:${error.linePos}: ${error.message}` : `${name}: ${failed.message}`);
  if (error) console.log(`    ${wgsl.split('\n')[error.lineNum - 1]}`);
}
process.exit(refused ? 1 : 0);
