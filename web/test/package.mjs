// The npm package as its users get it: node package.mjs FOLDER-WITH-TARBALL SCENES.json
//
// It is installed from its tarball into an empty folder. Node and a page then answer scenes whose pairs, impacts and
// hashes a native run has written. TypeScript checks a program that uses all of it.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cp, mkdtemp, readFile, readdir, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { setTimeout } from "node:timers/promises";
import { setFlagsFromString } from "node:v8";
import { runInNewContext } from "node:vm";
import { brotliCompressSync } from "node:zlib";
import { buildSync } from "esbuild";
import { COPIES, OTHERS, REFUSALS, STEPS } from "./answers.mjs";
import { launch, serve } from "./browser.mjs";

// Without them, it is smaller by: near pairs 6 kB, distance 13, contacts 42 (16 of these penetration), candidates 2, points and rays 25 (5 of
// these contains), bounds and lists 8, truncate 7. Together 7 more: the nearest few, locate, signedDistance, candidatesInRuns, groups,
// pinned vertices and pairs at rest, which the other languages have; 11 more: thickness by element and distances rounded down; 6 more: lists
// of near pairs with a margin; 6 more: excluded pairs as bits; 4 more: surfaces turned
// inwards, contacts that are not all, bodies of another scene, truncation of any size; 3 more: pairs at rest in intersections.
const MOST_BROTLI = 418_000;

const [built, scenesFile] = process.argv.slice(2);
const tarball = (await readdir(built)).find((name) => name.endsWith(".tgz"));
assert.ok(tarball, `${built} has a tarball`);

const folder = await mkdtemp(join(tmpdir(), "impinge-npm-"));
try {
  await writeFile(join(folder, "package.json"), '{ "private": true, "type": "module" }');
  const npm = ["install", "--silent", "--no-audit", "--no-fund", "--offline"];
  execFileSync("npm", [...npm, resolve(built, tarball)], { cwd: folder });
  await cp(scenesFile, join(folder, "scenes.json"));
  const here = new URL(".", import.meta.url);
  for (const name of ["answers.mjs", "use.ts", "empty.html"]) {
    await cp(new URL(name, here), join(folder, name));
  }
  // Files about which every door has the same answer.
  const doors = new URL("../../crates/impinge-cli/tests/doors/", here).pathname;
  await cp(doors, join(folder, "doors"), { recursive: true });
  const installed = join(folder, "node_modules/impinge");
  for (const [build, limit] of [["cpu", MOST_BROTLI], ["gpu", Infinity]]) {
    const bytes = await readFile(join(installed, build, "impinge_bg.wasm"));
    const size = brotliCompressSync(bytes).length;
    console.log(`module ${build}: ${bytes.length} bytes, ${size} in brotli`);
    assert.ok(size < limit, `${size} bytes, ${limit} allowed`);
  }

  assert.match(await readFile(join(installed, "README.md"), "utf8"), /^# impinge/);
  const tsc = new URL("../node_modules/.bin/tsc", here).pathname;
  const options = ["--noEmit", "--strict", "--exactOptionalPropertyTypes", "--target", "es2022", "--module", "nodenext"];
  execFileSync(tsc, [...options, "--lib", "es2022,dom", "use.ts"], { cwd: folder, stdio: "inherit" });
  console.log("types: checked");

  const example = new URL("../../examples/cloth-on-ball/", here).pathname;
  await cp(example, join(folder, "cloth-on-ball"), { recursive: true });
  const printed = execFileSync("node", ["cloth-on-ball/cloth_on_ball.mjs"], { cwd: folder, encoding: "utf8" });
  assert.equal(printed, await readFile(join(example, "expected.txt"), "utf8"));

  await testBundles(folder);

  // A scene forgets pairs at rest that nobody holds.
  setFlagsFromString("--expose-gc");
  const { KeptPairs } = await import(join(installed, "query.js"));
  const forgotten = [];
  const [held] = [1, 2, 3].map((of) => new KeptPairs(of, 0, () => forgotten.push(of)));
  for (let turn = 0; turn < 1000 && forgotten.length < 2; turn += 1) {
    runInNewContext("gc")();
    await setTimeout(1);
  }
  held.dispose();
  assert.deepEqual(forgotten.sort(), [1, 2, 3]);

  const scenes = JSON.parse(await readFile(scenesFile, "utf8"));
  assert.equal(scenes.length, 4);
  const inNode = execFileSync("node", ["answers.mjs"], { cwd: folder, encoding: "utf8", maxBuffer: 1 << 28 });
  const { said, answers: answersInNode, taken, more, read, doors: found } = JSON.parse(inNode);
  const expected = JSON.parse(await readFile(join(doors, "answers.json"), "utf8"));
  for (const answer of Object.values(expected)) delete answer.between;
  assert.deepEqual(found, expected);
  assert.deepEqual(said, REFUSALS);
  assert.deepEqual(taken, STEPS);
  assert.deepEqual(more, OTHERS);
  assert.deepEqual(read, {
    welded: [0, 0],
    faces: [0, 1, 2],
    positions: [0, 0, 0, 1, 0, 0, 0, 1, 0],
    map: [0, 1, 0, 2],
    notes: ["lines skipped, which are edges or faces of two corners: 1"],
    added: [1, 3, 1, 3],
    frames: [[1, 2, 3], [4, 5, 6]],
    noGpu: "device: there is no WebGPU here",
    broken: read.broken,
    buffers: Array(2).fill("invalid: bytes: an ArrayBuffer given, a Uint8Array is needed"),
    cut: read.cut,
    options: Array(2).fill('invalid: options: "wield" given, weld allowed'),
  });
  assert.match(read.broken, /^invalid: .*a\.txt/);
  assert.match(read.cut, /^invalid: .*cut\.mdd/);
  compare("Node, CPU", answersInNode, withImpacts(scenes));

  const server = await serve(folder);
  const browser = await launch();
  try {
    const page = await browser.newPage();
    const problems = [];
    page.on("pageerror", (error) => problems.push(error));
    await page.goto(`${server.url}empty.html`);
    const bundled = await page.evaluate(async () => {
      const { answer, wasm } = await import("./bundles/page.js");
      return answer(new URL(wasm, new URL("bundles/", location.href)));
    });
    assert.equal(bundled, 1);
    const answers = (gpu) =>
      page.evaluate(async (gpu) => {
        const { cpu, others, refusals, steps, webgpu } = await import("./answers.mjs");
        const scenes = await (await fetch("scenes.json")).json();
        if (gpu !== null) {
          const module = "./node_modules/impinge/webgpu.js";
          return { answers: await webgpu(module, scenes, gpu), more: await others(module) };
        }
        const said = await refusals("./node_modules/impinge/index.js");
        const taken = await steps("./node_modules/impinge/index.js");
        const more = await others("./node_modules/impinge/index.js");
        return { said, taken, more, answers: await cpu("./node_modules/impinge/index.js", scenes) };
      }, gpu);
    const onCpu = await answers(null);
    assert.deepEqual(onCpu.said, REFUSALS);
    assert.deepEqual(onCpu.taken, STEPS);
    assert.deepEqual(onCpu.more, OTHERS);
    compare("Chromium, CPU", onCpu.answers, withImpacts(scenes));
    for (const method of ["clusters", "cells"]) {
      const expected = scenes.map(({ name, pairs, hash, impacts, impactsHash }) => ({ name, pairs, hash, impacts, impactsHash }));
      const onGpu = await answers(method);
      assert.deepEqual(onGpu.more, OTHERS);
      compare(`Chromium, WebGPU, ${method}`, onGpu.answers, expected);
    }
    const held = await page.evaluate(async () => (await import("./answers.mjs")).copies());
    assert.deepEqual(held, COPIES);
    console.log("Chromium, WebGPU: copies of scenes are freed at once");
    assert.deepEqual(problems, []);
  } finally {
    await browser.close();
    server.close();
  }
} finally {
  await rm(folder, { recursive: true });
}

// The package in one file, for Node in both of its forms and for a page; the module is loaded from beside it, from bytes, or from a path.
async function testBundles(folder) {
  const question = `
    const scene = new Scene();
    for (const z of [0, 0.25]) scene.addTriangles(new Uint8Array([0, 1, 2]), new Float32Array([0, 0, z, 1, 0, -z, 0, 1, z]));
    return new Detector().count(scene);`;
  const source = `
    import init, { Detector, Scene } from "impinge";
    import wasm from "impinge/cpu/impinge_bg.wasm";
    export { wasm };
    export const answer = async (from = wasm) => { await init(from); ${question} };`;
  await writeFile(join(folder, "bundled.js"), source);
  const bundle = (options) => {
    const given = { absWorkingDir: folder, entryPoints: ["bundled.js"], bundle: true, outdir: "bundles", logLevel: "silent", ...options };
    const { errors, warnings } = buildSync(given);
    assert.deepEqual([errors, warnings.filter(({ id }) => id !== "empty-import-meta")], [[], []]);
  };
  const wasm = join(folder, "node_modules/impinge/cpu/impinge_bg.wasm");
  for (const [format, loader] of [["esm", "binary"], ["cjs", "file"]]) {
    const name = `${format}-${loader}`;
    bundle({ platform: "node", target: "node18", format, loader: { ".wasm": loader }, outExtension: { ".js": format === "esm" ? ".mjs" : ".cjs" }, entryNames: name });
    const { answer } = await import(join(folder, `bundles/${name}.${format === "esm" ? "mjs" : "cjs"}`));
    assert.equal(await answer(...(loader === "binary" ? [] : [wasm])), 1, name);
  }
  bundle({ platform: "browser", format: "esm", loader: { ".wasm": "file" }, entryNames: "page", minify: true });
  console.log("bundles: answered");
}

// Three methods answer each scene.
function withImpacts(scenes) {
  return scenes.flatMap(({ name, pairs, hash, impacts, impactsHash, first }) => {
    const answer = { name, pairs, hash, impacts, impactsHash, first };
    return [answer, answer, answer];
  });
}

function compare(where, answers, expected) {
  assert.deepEqual(answers, expected, where);
  console.log(`${where}: the native answers (${answers.length})`);
}
