// Gives every shader text in a folder to Chrome's compiler: node shaders.mjs FOLDER
//
// Chrome follows the WGSL grammar more strictly than naga, so a text that wgpu accepts on every desktop may
// still be refused by browsers. `scripts/web-shaders` writes the folder and calls this.

import { readdir, readFile } from "node:fs/promises";
import { join } from "node:path";
import { launch, serve } from "./browser.mjs";

// naga accepts this text, but the grammar requires parentheses. It shows that this script notices a refusal.
const REFUSED = `
  @group(0) @binding(0) var<storage, read_write> out: array<u32>;
  @compute @workgroup_size(1) fn main() { out[0] = out[1] | out[2] << 1u; }`;

const folder = process.argv[2];
const names = (await readdir(folder)).filter((name) => name.endsWith(".wgsl")).sort();
if (names.length === 0) throw new Error(`${folder} has no shader`);

const server = await serve(new URL(".", import.meta.url).pathname);
const browser = await launch();
let n_refused = 0;
try {
  const page = await browser.newPage();
  await page.goto(`${server.url}empty.html`);
  await page.evaluate(async () => {
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) throw new Error("this Chromium offers no WebGPU adapter");
    globalThis.device = await adapter.requestDevice();
  });
  const errors = (code) =>
    page.evaluate(async (code) => {
      const info = await globalThis.device.createShaderModule({ code }).getCompilationInfo();
      const found = info.messages.filter(({ type }) => type === "error");
      return found.map(({ lineNum, linePos, message }) => `${lineNum}:${linePos} ${message}`);
    }, code);

  if ((await errors(REFUSED)).length === 0) {
    throw new Error("Chrome takes a text that it must refuse: this check proves nothing");
  }
  for (const name of names) {
    const found = await errors(await readFile(join(folder, name), "utf8"));
    for (const line of found) console.error(`${name}:${line}`);
    n_refused += found.length > 0;
  }
  console.log(`${names.length} shaders, ${n_refused} refused by Chromium ${browser.version()}`);
} finally {
  await browser.close();
  server.close();
}
process.exitCode = n_refused > 0 ? 1 : 0;
