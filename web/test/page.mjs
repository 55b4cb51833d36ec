// The page as a visitor uses it: node page.mjs FOLDER PROGRAM [VISIT...], all visits by default
//
// FOLDER/site is served. Files are dropped, and the answers compared with those of the program about the same files. Bodies are
// dragged, buttons and keys pressed, on a large screen, on a phone's screen with touch, and in a browser without WebGPU.
// Screenshots are written to FOLDER/shots.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdir, mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { Gpu } from "../page/gpu.js";
import { fromLink, toLink } from "../page/link.js";
import { launch, serve } from "./browser.mjs";

const [folder, program, ...only] = process.argv.slice(2);
const shots = join(folder, "shots");
await mkdir(shots, { recursive: true });
const server = await serve(join(folder, "site"));
const files = await mkdtemp(join(tmpdir(), "impinge-page-"));
const data = process.env.IMPINGE_DATA ?? "../shared/data";
const DESKTOP = { viewport: { width: 1200, height: 760 } };
const PHONE = { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true };

// A page and the problems that it had: errors, and files that were not there.
async function open(browser, options, hash = "") {
  const context = await browser.newContext({ permissions: ["clipboard-read", "clipboard-write"], ...options });
  const page = await context.newPage();
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("response", (response) => response.status() >= 400 && problems.push(response.url()));
  page.on("console", (text) => text.type() === "error" && problems.push(text.text()));
  await page.goto(server.url + hash);
  await page.waitForFunction(() => document.querySelector("#cpu .hash").textContent.length === 16);
  return { page, problems };
}

const text = (page, selector) => page.locator(selector).textContent();
const hashOf = (page, id) => text(page, `#${id} .hash`);
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

// Pauses at a time.
async function pauseAt(page, time) {
  await page.locator("#time").fill(String(time));
  await settled(page);
  assert.equal(await text(page, "#play"), "Play");
}

async function pairs(page) {
  const shown = await text(page, "#cpu .pairs");
  const counted = await page.evaluate(() => window.page.rows.length / 4);
  assert.equal(Number(shown.replaceAll(",", "")), counted);
  return counted;
}

// A point on the page where a body is seen, not one that another body hides.
const where = (page, ix) => page.evaluate((ix) => window.page.view.seenAt(ix), ix);

// Waits until WebGPU has answered the frame that is shown, with the CPU's hash.
async function sameHash(page) {
  await page.waitForFunction(
    () => {
      const hash = (id) => document.querySelector(`#${id} .hash`).textContent;
      const note = document.getElementById("gpu-note");
      if (note.className === "different") throw new Error(note.textContent);
      return hash("gpu").length === 16 && hash("gpu") === hash("cpu") && note.className === "same";
    },
    null,
    { timeout: 60_000 },
  );
}

// Drops files as a file manager does, and waits until they are read.
async function drop(page, ...names) {
  await offer(page, ...names);
  await page.waitForFunction(() => document.getElementById("status").hidden, null, { timeout: 60_000 });
  await settled(page);
}

async function offer(page, ...names) {
  const given = [];
  for (const name of names) {
    const path = name.includes("/") ? name : join(files, name);
    given.push({ name: path.split("/").at(-1), base64: (await readFile(path)).toString("base64") });
  }
  const dropped = await page.evaluateHandle((given) => {
    const transfer = new DataTransfer();
    for (const { name, base64 } of given) {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      transfer.items.add(new File([bytes], name));
    }
    return transfer;
  }, given);
  const isTaken = (dataTransfer) => !document.getElementById("view").dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
  assert.ok(await page.evaluate(isTaken, dropped), "a drop does not leave the page");
}

// What the program prints about files. A step whose start intersects has an exit code of its own.
function native(command, ...args) {
  const paths = args.map((arg) => (arg.includes("/") || !existsSync(join(files, arg)) ? arg : join(files, arg)));
  const { stdout, stderr, error } = spawnSync(resolve(program), [command, ...paths], { encoding: "utf8", maxBuffer: 1 << 28 });
  assert.ok(error === undefined && stdout.length > 0, `${command} ${args}: ${error ?? stderr}`);
  return stdout;
}

// The page's answer about files is the program's: the rows and the hash.
async function sameAsProgram(page, command, names, ...more) {
  const paths = names.map((name) => (name.includes("/") ? name : join(files, name)));
  const { hash, pairs: n, n_regions: nRegions } = JSON.parse(native(command, ...paths, ...more, "--json"));
  const csv = native(command, ...paths, ...more, "--rows", "-").trim().split("\n").slice(1);
  const rows = csv.map((line) => line.split(",").map(Number)).flat();
  assert.equal(await hashOf(page, "cpu"), hash, `${command} ${names}: the hash`);
  assert.equal(await pairs(page), typeof n === "number" ? n : csv.length);
  assert.deepEqual(await page.evaluate(() => [...window.page.rows]), rows, `${command} ${names}: the rows`);
  // The program's regions belong to two bodies each. Those of one body are the page's places.
  if (command === "self") assert.equal(await page.evaluate(() => window.page.places.length), nRegions, `${names}: the places`);
  return csv.length;
}

// A box from 0 to `size`, moved along x: vertices and faces of four corners.
function box(size, moved) {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => [bits & 1, (bits >> 1) & 1, bits >> 2].map((x) => x * size));
  const vertices = corners.map(([x, y, z]) => `v ${x + moved} ${y} ${z}`);
  const faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((face) => `f ${face}`);
  return [...vertices, ...faces].join("\n");
}

function stl(...triangles) {
  const facet = (corners) => corners.map((corner) => `vertex ${corner.join(" ")}`).join("\n");
  const facets = triangles.map((corners) => `facet normal 0 0 1\nouter loop\n${facet(corners)}\nendloop\nendfacet`);
  return ["solid made", ...facets, "endsolid made"].join("\n");
}

// A triangle in a buffer, in a scene that has one of its two nodes.
function gltf(uri) {
  const primitives = [{ attributes: { POSITION: 0 } }];
  return JSON.stringify({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }, { mesh: 0 }],
    meshes: [{ primitives }],
    accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] }],
    bufferViews: [{ buffer: 0, byteLength: 36 }],
    buffers: [{ uri, byteLength: 36 }],
  });
}

// A strip of eight triangles, bent by an angle per quad: it meets itself when bent far enough.
function strip(angle) {
  const points = [];
  let [x, z] = [0, 0];
  for (let ix = 0; ix <= 8; ix += 1) {
    for (const y of [0, 1]) points.push([x, y, z]);
    x += Math.cos(ix * angle);
    z += Math.sin(ix * angle);
  }
  return points;
}

const stripFaces = [...Array(8).keys()].flatMap((ix) => {
  const a = 2 * ix + 1;
  return [`f ${a} ${a + 1} ${a + 3}`, `f ${a} ${a + 3} ${a + 2}`];
});
const stripObj = (angle) => [...strip(angle).map((point) => `v ${point.join(" ")}`), ...stripFaces].join("\n");

function pc2(frames) {
  const bytes = Buffer.alloc(32 + frames.length * frames[0].length * 12);
  bytes.write("POINTCACHE2\0", "latin1");
  for (const [at, value] of [[12, 1], [16, frames[0].length], [28, frames.length]]) bytes.writeInt32LE(value, at);
  for (const [ix, x] of frames.flat(2).entries()) bytes.writeFloatLE(x, 32 + 4 * ix);
  return bytes;
}

const LONG = `${"a-scan-".repeat(30)}of-a-box.obj`;
const ANGLES = [0, 0.35, 0.7, 0.88, 0.6];

async function writeFiles() {
  const tip = stl([[0.5, 0.5, 0.5], [3, 0.5, 0.5], [0.5, 3, 0.5]]);
  // Without welding, neighbours of an STL file are strangers that touch.
  const [a, b, c, d, e] = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2], [0.25, 0.25, -1]];
  const soup = stl([a, b, c], [a, b, d], [a, c, d], [b, c, d], [e, [0.5, 0.25, 3], [0.25, 0.5, 3]]);
  // One part in 10^12 above the floor: in single precision it would stand on it.
  const floor = "v 0 0 1\nv 4 0 1\nv 0 4 1\nf 1 2 3";
  const above = "v 1 1 1.000000000001\nv 2 1 2\nv 1 2 2\nf 1 2 3";
  const made = {
    "box.obj": box(1, 0),
    "tip.stl": tip,
    "far.obj": box(1, 0.5),
    "away.obj": box(1, 1e6),
    [LONG]: box(1, 0),
    "soup.stl": soup,
    "floor.obj": floor,
    "above.obj": above,
    // Two triangles that share an edge and lie on each other.
    "folded.obj": "v 0 0 0\nv 2 0 0\nv 1 2 0\nv 1 1 0\nf 1 2 3\nf 2 1 4",
    "groups.obj": "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 1 1 -1\nv 2 1 1\nv 1 2 1\nv 4 4 0\ng low\nf 1 2 3\nf 2 7 3\ng high\nf 4 5 6",
    "broken.obj": "v 0 0\nf 1 2 3",
    "notes.txt": "",
    "bend.obj": stripObj(0),
    "bend.pc2": pc2(ANGLES.map(strip)),
    "short.pc2": pc2([[[0, 0, 0]]]),
    "one.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nf 1 2 3",
    "<i>.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nl 1 2",
    "beside.gltf": gltf("b.bin"),
    "b.bin": Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]).buffer),
    "whole.gltf": gltf(`data:application/octet-stream;base64,${Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]).buffer).toString("base64")}`),
    "start.obj": stripObj(0.6),
    "finish.obj": stripObj(1),
  };
  for (const [ix, angle] of ANGLES.entries()) made[`run_${ix + 8}.obj`] = stripObj(angle);
  for (const [name, content] of Object.entries(made)) await writeFile(join(files, name), content);
}

async function dropped(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  const note = () => text(page, "#scene-note");
  const isShown = (id) => page.locator(`#${id}`).isVisible();

  // One mesh: does it meet itself? It is there once, and as it is.
  await drop(page, "soup.stl");
  assert.equal(await sameAsProgram(page, "self", ["soup.stl"]), 2);
  assert.match(await note(), /^soup\.stl with itself: 5 triangles; 8 vertices welded/);
  assert.equal(await page.locator("#self").isChecked(), true);
  assert.equal(await page.locator("#self").isDisabled(), true);
  for (const id of ["motion", "share", "size", "as-label", "step"]) assert.equal(await isShown(id), false, `#${id} is hidden`);
  const firstPose = await page.evaluate(() => [...window.page.bodies[0].now]);
  assert.deepEqual(firstPose.slice(0, 9), [0, 0, 0, 2, 0, 0, 0, 2, 0]);
  await page.keyboard.press("Space");
  await settled(page);
  await page.screenshot({ path: join(shots, "self.png") });
  assert.deepEqual(await page.evaluate(() => [...window.page.bodies[0].now]), firstPose, "nothing bends it");
  // The only body is not moved: a drag turns the view.
  const [x, y] = await where(page, 0);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 60, y + 20, { steps: 4 });
  await page.mouse.up();
  await settled(page);
  await sameAsProgram(page, "self", ["soup.stl"]);

  // Neighbours count if they meet in more than what they share.
  await drop(page, "folded.obj");
  assert.equal(await sameAsProgram(page, "self", ["folded.obj"]), 1);

  // y points up on the screen, or z.
  const height = () => page.evaluate(() => Math.max(...window.page.view.positions(0).filter((_, at) => at % 3 === 2)));
  await drop(page, "tip.stl");
  assert.ok((await height()) > 0.5, "y points up");
  await page.locator("#up").selectOption("z");
  await settled(page);
  assert.ok((await height()) < 1e-6, "z points up");
  await sameAsProgram(page, "self", ["tip.stl"]);
  await page.locator("#up").selectOption("y");

  // Coordinates keep their precision.
  await drop(page, "floor.obj", "above.obj");
  assert.equal(await sameAsProgram(page, "pairs", ["floor.obj", "above.obj"]), 0);

  // Two meshes, and three: all are there. Self-collision is asked for only if it is switched on.
  await drop(page, "box.obj", "tip.stl");
  assert.ok((await sameAsProgram(page, "pairs", ["box.obj", "tip.stl"])) > 1);
  assert.equal(await page.locator("#self").isDisabled(), false);
  await page.screenshot({ path: join(shots, "dropped.png") });
  const three = ["box.obj", "tip.stl", "far.obj"];
  await drop(page, ...three);
  assert.match(await note(), /^box\.obj, tip\.stl, far\.obj with each other: 25 triangles/);
  await sameAsProgram(page, "pairs", three);
  const four = ["box.obj", "soup.stl", "tip.stl", "far.obj"];
  await drop(page, ...four);
  const between = await sameAsProgram(page, "pairs", four);
  await page.locator("#self").check();
  await settled(page);
  assert.equal(await sameAsProgram(page, "pairs", four, "--self"), between + 2);
  assert.match(await note(), /with each other and themselves/);
  // The legend has a row per body, with the number of its triangles that collide.
  const legend = await page.locator("#bodies li").allTextContents();
  const found = await page.evaluate(() => [...window.page.rows]);
  const colliding = new Set(found.filter((_, at) => at % 2 === 1 && found[at - 1] === 1));
  assert.equal(legend.length, 4);
  assert.equal(legend[1], ` soup.stl5 triangles, ${colliding.size} collide`.trim());
  // WebGPU is asked the same.
  await page.locator("#use-gpu").check();
  await sameHash(page);
  await page.locator("#self").uncheck();
  await settled(page);
  await sameHash(page);
  await page.locator("#use-gpu").uncheck();

  // A file of two groups is one mesh, until the visitor says that its groups are bodies.
  await drop(page, "groups.obj");
  await sameAsProgram(page, "self", ["groups.obj"]);
  await page.locator("#as").selectOption("parts");
  await settled(page);
  assert.match(await note(), /^low, high with each other: 3 triangles/);
  assert.ok((await sameAsProgram(page, "pairs", ["groups.obj"], "--bodies", "groups")) > 0);

  // Long names are shortened, so that the sentence is seen whole; and bodies that are too small to be seen are no riddle.
  await drop(page, LONG, "tip.stl");
  assert.match(await note(), /^a-scan-a-scan-a-sc…[^]{18}, tip\.stl with each other: 13 triangles$/);
  assert.ok(await page.evaluate(() => document.getElementById("scene-note").scrollHeight <= document.getElementById("scene-note").clientHeight));
  await drop(page, "box.obj", "away.obj");
  assert.match(await note(), /with each other: 24 triangles; so far apart that they are too small to be seen in one picture$/);

  // Files that cannot be read are named, and the others shown; the scene stays if none can.
  await drop(page, "broken.obj", "box.obj", "notes.txt");
  assert.match(await text(page, "#message"), /broken\.obj[^]*notes\.txt/);
  assert.match(await note(), /^box\.obj with itself: 12/);
  await drop(page, "notes.txt");
  assert.match(await note(), /^box\.obj with itself: 12/);
  await page.screenshot({ path: join(shots, "refused.png") });
  await drop(page, "box.obj", "short.pc2");
  assert.match(await text(page, "#message"), /short\.pc2 has frames of 1 vertex,/);
  // The button for files takes the same way.
  await page.locator("#files").setInputFiles(["box.obj", "far.obj"].map((name) => join(files, name)));
  await page.waitForFunction(() => document.getElementById("scene-note").textContent.startsWith("box.obj, far.obj"));
  await settled(page);
  await sameAsProgram(page, "pairs", ["box.obj", "far.obj"]);
  assert.deepEqual(problems, []);
  console.log("dropped files: the program's pairs and hashes; bad files are named");
  await page.context().close();
}

// What was left out of files is listed, as the program says it; and files that nothing reads are named.
async function notes(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  const note = () => text(page, "#scene-note");
  const listed = () => page.locator("#notes li").allTextContents();
  for (const names of [["one.obj", "<i>.obj"], ["whole.gltf"]]) {
    await drop(page, ...names);
    const { stderr } = spawnSync(resolve(program), [names.length > 1 ? "pairs" : "self", ...names.map((name) => join(files, name))], { encoding: "utf8" });
    const said = stderr.split("\n").filter((line) => line.startsWith("note: ")).map((line) => line.slice(6).replace(`${files}/`, ""));
    assert.ok(said.length >= names.length);
    assert.deepEqual(await listed(), said);
  }
  assert.match(await note(), /^whole\.gltf with itself: 1 triangle$/);
  assert.match((await page.locator("#bodies li").allTextContents())[0], /1 triangle, /);
  await drop(page, "whole.gltf", "b.bin");
  assert.match(await text(page, "#message"), /^b\.bin is left out: .*\.glb/);
  assert.match(await note(), /^whole\.gltf with itself/);
  await drop(page, "beside.gltf", "b.bin");
  assert.match(await text(page, "#message"), /^beside\.gltf: [^]*b\.bin is left out: .*\.glb/);
  await drop(page, "soup.stl");
  assert.deepEqual([await listed(), await page.locator("#notes").isVisible()], [[], false]);
  assert.deepEqual(problems, []);
  console.log("notes on files: those of the program; files that nothing reads are named");
  await page.context().close();
}

// The files that were opened last are shown, also if earlier ones take longer. What shows nothing cancels nothing.
async function order(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  const note = () => text(page, "#scene-note");
  const message = () => text(page, "#message");
  const triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3";
  // A file that takes until it is released.
  const dropSlow = (name) =>
    page.evaluate((name) => {
      const bytes = new Promise((done) => (window.release = (text) => done(new TextEncoder().encode(text).buffer)));
      const file = Object.assign(new File([], name), { arrayBuffer: () => bytes });
      window.dispatchEvent(Object.assign(new Event("drop"), { dataTransfer: { files: [file], items: [] } }));
    }, name);
  const release = async (content) => {
    await page.evaluate((content) => window.release(content), content);
    await page.waitForTimeout(100);
    await settled(page);
  };
  const shows = (pattern) => page.waitForFunction((pattern) => new RegExp(pattern).test(document.getElementById("scene-note").textContent), pattern);
  const says = (id, pattern) => page.waitForFunction(([id, pattern]) => new RegExp(pattern).test(document.getElementById(id).textContent), [id, pattern]);

  await dropSlow("slow.obj");
  await offer(page, "box.obj");
  await shows("^box\\.obj with itself");
  assert.equal(await page.locator("#status").isVisible(), false);
  await release(triangle);
  assert.match(await note(), /^box\.obj with itself/);
  await dropSlow("late.obj");
  await page.locator("#scene").selectOption("ring");
  await release(triangle);
  assert.match(await note(), /^worm/);
  assert.equal(await page.locator("#status").isVisible(), false);

  // A file that cannot be read, and one that nothing opens: both are named, and the earlier one is shown.
  await dropSlow("slow.obj");
  await offer(page, "notes.txt");
  await says("message", "notes\\.txt");
  assert.equal(await text(page, "#status"), "Reading slow.obj …");
  await release(triangle);
  assert.match(await note(), /^slow\.obj with itself: 1 triangle/);
  assert.match(await message(), /notes\.txt/);
  await dropSlow("slow.obj");
  await offer(page, "broken.obj");
  await says("message", "broken\\.obj");
  await release("v 0 0");
  assert.match(await message(), /broken\.obj[^]*slow\.obj/);
  assert.equal(await page.locator("#status").isVisible(), false);
  // Dropped text is no file, and changes nothing.
  await page.evaluate(() => window.dispatchEvent(Object.assign(new Event("drop"), { dataTransfer: { files: [], items: [] } })));
  assert.match(await message(), /broken\.obj[^]*slow\.obj/);
  // A point cache waits for the mesh that was opened before.
  await drop(page, "box.obj");
  assert.equal(await page.locator("#message").isVisible(), false);
  await dropSlow("bend.obj");
  await offer(page, "bend.pc2");
  await says("status", "^Reading bend\\.obj, bend\\.pc2 …$");
  await release(stripObj(0));
  await shows("^bend\\.obj with bend\\.pc2 with itself: 16 triangles");
  assert.deepEqual([await page.locator("#message").isVisible(), await page.locator("#status").isVisible()], [false, false]);
  assert.deepEqual(problems, []);
  console.log("the order of opening: the last is shown, and nothing is lost");
  await page.context().close();
}

// Frames: the pairs of each, and the first contacts on the way to the next, as the program prints them.
async function frames(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  const lines = (...args) => native("sequence", ...args, "--json").trim().split("\n").map((line) => JSON.parse(line));
  const compare = async (mesh, sequence) => {
    const expected = lines(mesh, sequence);
    const steps = lines(mesh, sequence, "--ccd");
    assert.equal(expected.length, ANGLES.length);
    for (const [ix, { hash, pairs: n }] of expected.entries()) {
      await pauseAt(page, ix);
      assert.deepEqual([await hashOf(page, "cpu"), await pairs(page)], [hash, n], `frame ${ix}`);
      if (ix + 1 === expected.length) continue;
      const { hash: stepHash, impacts, earliest } = steps[ix];
      const step = await page.evaluate(() => window.page.step);
      assert.deepEqual([step.hash, step.n], [stepHash, impacts], `the step from frame ${ix}`);
      assert.equal(step.first?.toi ?? null, earliest?.toi ?? null, `the first contact after frame ${ix}`);
    }
    return steps.filter(({ earliest }) => earliest !== null && earliest.toi > 0).length;
  };
  // Bodies that are refused leave the scene as it is, and playing. No small file is refused by it alone.
  await page.locator("#self").check();
  await page.evaluate(async () => {
    const { prototype } = (await import("impinge")).Scene;
    const { add } = prototype;
    prototype.add = () => {
      prototype.add = add;
      throw new Error("too much");
    };
  });
  await drop(page, "box.obj", "bend.obj");
  assert.equal(await text(page, "#message"), "too much");
  assert.match(await text(page, "#scene-note"), /with each other and themselves/);
  assert.equal(await page.locator("#self").isChecked(), true);
  assert.equal(await text(page, "#play"), "Pause");
  const before = await page.locator("#time").inputValue();
  await page.waitForFunction((before) => document.getElementById("time").value !== before, before);
  await page.locator("#self").uncheck();

  await drop(page, "bend.obj", "bend.pc2");
  assert.match(await text(page, "#scene-note"), /^bend\.obj with bend\.pc2 with itself: 16 triangles/);
  assert.ok((await compare("bend.obj", "bend.pc2")) > 0);
  assert.match(await text(page, "#step-text"), /last frame/);

  // It goes to the moment of the first contact, and on with the keys.
  await pauseAt(page, 2);
  assert.match(await text(page, "#step-text"), /^On the way to frame 3: \d+ contacts?\. First at 0\.\d+ of the way, (vertex|edge) \d+ and (face|edge) \d+\.$/);
  await page.locator("#step-show").click();
  await settled(page);
  const { step, at } = await page.evaluate(() => ({ step: window.page.step, at: document.getElementById("time-text").textContent }));
  assert.equal(at, `${Number((2 + step.first.toi).toFixed(3))} of 4`);
  await page.waitForTimeout(700);
  await page.screenshot({ path: join(shots, "contact.png") });
  await page.locator("#view").focus();
  await page.keyboard.press(".");
  await settled(page);
  assert.equal(await text(page, "#time-text"), "3 of 4");
  await page.locator("#previous").click();
  await settled(page);
  assert.equal(await text(page, "#time-text"), "2 of 4");

  // A point cache alone moves the mesh that is there.
  await drop(page, "bend.obj");
  assert.equal(await page.locator("#motion").isVisible(), false);
  await drop(page, "bend.pc2");
  assert.equal(await text(page, "#time-text"), "0 of 4");

  // Numbered files in any order are frames of one mesh.
  await drop(page, ...[10, 8, 12, 9, 11].map((ix) => `run_${ix}.obj`));
  assert.match(await text(page, "#scene-note"), /^run_8\.obj … run_12\.obj with itself/);
  await compare("run_8.obj", join(files, "run_%d.obj"));
  await page.locator("#as").selectOption("bodies");
  await settled(page);
  await sameAsProgram(page, "pairs", [10, 8, 12, 9, 11].map((ix) => `run_${ix}.obj`));

  // Two poses are two bodies, until the visitor says that they are one.
  await drop(page, "finish.obj", "start.obj");
  await sameAsProgram(page, "pairs", ["finish.obj", "start.obj"]);
  await page.locator("#as").selectOption("poses");
  await settled(page);
  assert.equal(await text(page, "#time-text"), "0 of 1");
  const { hash, impacts } = JSON.parse(native("step", "finish.obj", "start.obj", "--json"));
  const shown = await page.evaluate(() => window.page.step);
  assert.deepEqual([shown.hash, shown.n], [hash, impacts]);
  assert.deepEqual(problems, []);
  console.log("frames: the program's pairs, contacts and first times; numbered files, point caches, two poses");
  await page.context().close();
}

// Real meshes, where they are.
async function real(browser) {
  const path = (name) => resolve(data, "meshes", name);
  if (process.env.IMPINGE_NO_DATA || !existsSync(path("cow.off"))) return console.log(`real meshes: skipped, ${data} has none`);
  const { page, problems } = await open(browser, DESKTOP);
  for (const name of ["cow.off", "camelhead.off", "bunny.ply"]) {
    await drop(page, path(name));
    console.log(`  ${name}: ${await sameAsProgram(page, "self", [path(name)])} pairs`);
    await page.screenshot({ path: join(shots, `${name}.png`) });
    if (name !== "cow.off") continue;
    // Its places are the connected groups of its colliding triangles; one is gone to, and its triangle named.
    const { places, n } = await page.evaluate(() => ({ places: window.page.places.length, n: window.page.places[0].n }));
    assert.equal(Number(await text(page, "#n-places")), places);
    const items = page.locator("#place-list button");
    assert.equal(await items.count(), places);
    assert.equal(await items.first().textContent(), `${n} triangles`);
    const eye = await page.evaluate(() => window.page.view.eye);
    await items.first().click();
    await page.waitForTimeout(700);
    assert.notDeepEqual(await page.evaluate(() => window.page.view.eye), eye);
    assert.match(await text(page, "#chosen"), /^triangle [\d,]+ meets \d/);
    await page.screenshot({ path: join(shots, "place.png") });
  }
  const all = ["cow.off", "camelhead.off", "bunny.ply"].map(path);
  await drop(page, ...all);
  console.log(`  all three: ${await sameAsProgram(page, "pairs", all)} pairs`);
  await page.screenshot({ path: join(shots, "three.png") });
  assert.deepEqual(problems, []);
  console.log("real meshes: the program's pairs and hashes");
  await page.context().close();
}

async function large(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  // It plays: the time changes by itself.
  const first = await page.locator("#time").inputValue();
  await page.waitForFunction((first) => document.getElementById("time").value !== first, first);

  await pauseAt(page, 1);
  const atEnd = await pairs(page);
  const hashAtEnd = await hashOf(page, "cpu");
  assert.ok(atEnd > 100, `${atEnd} pairs at the end`);
  await settled(page);
  assert.equal(await hashOf(page, "cpu"), hashAtEnd, "a paused scene stays");
  await pauseAt(page, 0);
  assert.equal(await pairs(page), 0);
  await page.screenshot({ path: join(shots, "start.png") });
  await pauseAt(page, 1);
  assert.equal(await hashOf(page, "cpu"), hashAtEnd);

  // Both methods and both backends give one hash. There is no row of WebGPU before it is switched on.
  assert.equal(await page.locator("#gpu").isVisible(), false);
  await page.locator("#use-gpu").check();
  await sameHash(page);
  for (const method of ["cells", "clusters"]) {
    await page.locator("#method").selectOption(method);
    await settled(page);
    await sameHash(page);
    assert.equal(await hashOf(page, "gpu"), hashAtEnd);
  }
  await page.screenshot({ path: join(shots, "end.png") });

  // A body is dragged out of the others, and the pairs follow.
  const [x, y] = await where(page, 2);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 150, y, { steps: 5 });
  await page.mouse.move(x + 300, y, { steps: 5 });
  await settled(page);
  const apart = await pairs(page);
  assert.ok(apart < atEnd, `${apart} pairs after the drag, ${atEnd} before`);
  const movedBy = await page.evaluate(() => window.page.bodies.map(({ offset }) => Math.hypot(...offset)));
  assert.ok(movedBy[2] > 0 && movedBy[0] === 0 && movedBy[1] === 0, `moved by ${movedBy}`);
  await sameHash(page);
  await page.mouse.up();
  await page.locator("#use-gpu").uncheck();
  await settled(page);
  assert.equal(await page.locator("#gpu").isVisible(), false);

  // A drag beside the bodies turns the view, and moves nothing.
  const before = await page.evaluate(() => window.page.view.eye);
  const hash = await hashOf(page, "cpu");
  await page.mouse.move(500, 640);
  await page.mouse.down();
  await page.mouse.move(600, 600, { steps: 4 });
  await page.mouse.up();
  const eye = await page.evaluate(() => window.page.view.eye);
  assert.notDeepEqual(eye, before);
  assert.equal(await hashOf(page, "cpu"), hash);
  await page.screenshot({ path: join(shots, "dragged.png") });

  // The link shows the same in another tab: bodies, moment, view, switches.
  await page.locator("#share").click();
  await page.waitForFunction(() => document.getElementById("status").textContent.startsWith("The link is copied"));
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.equal(link, page.url());
  const other = await open(browser, DESKTOP, new URL(link).hash);
  const near = (a, b) => a.forEach((x, ix) => assert.ok(Math.abs(x - b[ix]) < 1e-3, `${a} and ${b}`));
  await settled(other.page);
  near(await other.page.evaluate(() => window.page.view.eye), eye);
  near(await other.page.evaluate(() => window.page.bodies[2].offset), await page.evaluate(() => window.page.bodies[2].offset));
  assert.equal(await text(other.page, "#play"), "Play");
  assert.equal(await text(other.page, "#time-text"), "1.000");
  assert.deepEqual(other.problems, []);
  await other.page.context().close();
  await page.locator("#back").click();
  await settled(page);
  assert.equal(await hashOf(page, "cpu"), hashAtEnd, "the bodies are back");

  // A click names a triangle and its partners. Escape ends that.
  await page.keyboard.press("f");
  await page.keyboard.press("j");
  await page.waitForTimeout(700);
  assert.match(await text(page, "#chosen"), /^triangle [\d,]+ of (worm|knot|ball) meets \d+: /);
  await page.screenshot({ path: join(shots, "chosen.png") });
  await page.keyboard.press("Escape");
  assert.equal(await page.locator("#chosen").isVisible(), false);
  await page.keyboard.press("f");
  const point = await where(page, 0);
  await page.mouse.move(...point);
  assert.match(await text(page, "#tip"), /^triangle [\d,]+ of worm$/);
  await page.mouse.click(...point);
  assert.match(await text(page, "#chosen"), /^triangle [\d,]+ of worm meets/);

  // A scene of frames in which no frame collides, but steps do. A pause shows a frame, not a moment between two.
  await page.locator("#scene").selectOption("fall");
  await page.waitForFunction(() => document.getElementById("time").value === "1");
  await page.locator("#play").click();
  await settled(page);
  assert.match(await text(page, "#time-text"), /^[1-6] of 6$/);
  let nContacts = 0;
  for (let ix = 0; ix < 6; ix += 1) {
    await pauseAt(page, ix);
    assert.equal(await pairs(page), 0);
    nContacts += await page.evaluate(() => window.page.step.n);
  }
  assert.ok(nContacts > 0);
  await page.locator("#size").selectOption("3000");
  await settled(page);
  assert.match(await text(page, "#scene-note"), /^cloth, ball with each other: [23],\d{3} triangles/);
  assert.deepEqual(problems, []);
  console.log("a large screen: played, dragged, turned, linked, chosen; CPU and WebGPU give one hash");
  await page.context().close();
}

// All that a visitor may press has a name, can be reached with Tab, and shows that it has the focus.
async function keyboard(browser) {
  const { page, problems } = await open(browser, DESKTOP);
  await pauseAt(page, 1);
  const unnamed = await page.evaluate(() => {
    const name = (control) => control.ariaLabel || control.textContent.trim() || [...(control.labels ?? [])].map((label) => label.textContent.trim()).join("");
    return [...document.querySelectorAll("button, input, select, canvas, summary")].filter((control) => !name(control)).map(({ outerHTML }) => outerHTML);
  });
  assert.deepEqual(unnamed, []);
  const reached = new Set();
  for (let ix = 0; ix < 60; ix += 1) {
    await page.keyboard.press("Tab");
    const [id, outline] = await page.evaluate(() => {
      const { activeElement: active } = document;
      const seen = active.closest(".button") ?? active;
      return [active.id, getComputedStyle(seen).outlineStyle !== "none" || getComputedStyle(seen).boxShadow !== "none"];
    });
    if (id) reached.add(id);
    if (id) assert.ok(outline, `#${id} shows the focus`);
  }
  for (const id of ["view", "play", "time", "files", "scene", "size", "self", "method", "use-gpu", "share"]) {
    assert.ok(reached.has(id), `#${id} is reached with Tab`);
  }
  await page.locator("#view").focus();
  const eye = await page.evaluate(() => window.page.view.eye);
  for (const key of ["ArrowLeft", "ArrowUp", "+"]) {
    const before = await page.evaluate(() => window.page.view.eye);
    await page.keyboard.press(key);
    assert.notDeepEqual(await page.evaluate(() => window.page.view.eye), before, key);
  }
  await page.keyboard.press("f");
  assert.deepEqual(await page.evaluate(() => window.page.view.eye.map((x) => x.toFixed(6))), eye.map((x) => x.toFixed(6)));
  await page.keyboard.press("Space");
  assert.equal(await text(page, "#play"), "Pause");
  await page.keyboard.press("Space");
  assert.equal(await text(page, "#play"), "Play");
  // Space on a button presses it, once.
  await page.locator("#play").focus();
  await page.keyboard.press("Space");
  assert.equal(await text(page, "#play"), "Pause");
  assert.deepEqual(problems, []);
  console.log("the keyboard: everything has a name, is reached and shows it");
  await page.context().close();
}

// Nothing is wider than the screen, nothing is cut, and all controls are on it.
async function fits(page, ...ids) {
  const { width, height } = page.viewportSize();
  const [wide, high] = await page.evaluate(() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]);
  assert.ok(wide <= width && high <= height, `the page has ${wide} by ${high} pixels`);
  for (const id of ids) {
    const { x, y, width: w, height: h } = await page.locator(`#${id}`).boundingBox();
    assert.ok(x >= 0 && x + w <= width && y >= 0 && y + h <= height, `#${id} is on the screen`);
  }
  const cut = await page.evaluate(() => {
    const panels = [...document.querySelectorAll("#answer, #controls, #side > *")].filter((panel) => panel.offsetParent !== null || panel.getClientRects().length > 0);
    return panels.filter((panel) => panel.scrollWidth > panel.clientWidth + 1).map(({ id, className }) => id || className);
  });
  assert.deepEqual(cut, [], "panels that are cut");
  // Enough is left for the bodies.
  const [top, bottom] = await page.evaluate(() => [document.getElementById("answer").getBoundingClientRect().bottom, document.getElementById("bottom").getBoundingClientRect().top]);
  return bottom - top;
}

async function phone(browser) {
  const { page, problems } = await open(browser, PHONE);
  assert.match(await page.locator("#hint").innerText(), /^Drag a body .* tap a triangle/);
  assert.ok(await page.locator("#hint").isVisible());
  await page.locator("#play").tap();
  for (const time of [0, 0.5]) {
    await pauseAt(page, time);
    const widest = await page.evaluate(() => {
      const { view, bodies } = window.page;
      const points = bodies.flatMap((_, ix) => {
        const all = view.positions(ix);
        return Array.from({ length: all.length / 300 }, (_, at) => view.camera.position.clone().fromArray(all, 300 * at).project(view.camera).x);
      });
      return Math.max(...points.map(Math.abs));
    });
    assert.ok(widest > 0.6 && widest < 1, `${widest} of the width at ${time}`);
  }
  await pauseAt(page, 1);
  const before = await pairs(page);
  const room = await fits(page, "play", "time", "files", "scene", "size", "self", "share", "answer");
  assert.ok(room > 350, `${room} pixels for the bodies`);
  await page.screenshot({ path: join(shots, "phone.png") });
  // Taps right at the edges of a closed panel open it.
  for (const [ix, ids] of [["bodies"], ["place-list"], ["method", "use-gpu"]].entries()) {
    const panel = () => page.locator("#side details").nth(ix).boundingBox();
    const { x, y, width } = await panel();
    const { height } = await page.locator("#side summary").nth(ix).boundingBox();
    assert.ok(height >= 24, `summary ${ix} is ${height} high`);
    await page.touchscreen.tap(x + width / 2, y + 3);
    await fits(page, "play", "files", "share", ...ids);
    await page.locator("#side summary").nth(ix).tap();
    const closed = await panel();
    await page.touchscreen.tap(closed.x + 4, closed.y + closed.height - 3);
    await fits(page, "play", "files", "share", ...ids);
    await page.locator("#side summary").nth(ix).tap();
  }
  await settled(page);
  // A finger drags the ball.
  const [x, y] = await where(page, 2);
  const touch = await page.context().newCDPSession(page);
  const send = (type, ...points) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  // Two fingers on it zoom, and leave it where it is.
  const away = () => page.evaluate(() => window.page.view.camera.position.distanceTo(window.page.view.controls.target));
  const far = await away();
  await send("touchStart", [x, y]);
  await send("touchMove", [x - 9, y]);
  await send("touchStart", [x - 9, y], [x + 30, y]);
  for (let step = 1; step <= 5; step += 1) await send("touchMove", [x - 9 - 10 * step, y], [x + 30 + 10 * step, y]);
  await send("touchEnd");
  await settled(page);
  assert.ok((await away()) < 0.7 * far, `${await away()} instead of ${far} away`);
  const offsets = await page.evaluate(() => window.page.bodies.flatMap(({ offset }) => offset));
  assert.ok(offsets.every((offset) => Math.abs(offset) < 1e-12), String(offsets));
  assert.ok(!(await page.locator("#hint").isVisible()));
  await page.locator("#all").tap();
  await settled(page);
  assert.ok(Math.abs((await away()) - far) < 1e-6);
  await send("touchStart", [x, y]);
  for (let step = 1; step <= 5; step += 1) await send("touchMove", [x, y - 30 * step]);
  await send("touchEnd");
  await settled(page);
  assert.ok((await pairs(page)) < before, "the pairs follow the finger");
  // A finger chooses a triangle, opens the list, and goes to a place.
  await page.locator("#back").tap();
  await settled(page);
  await page.touchscreen.tap(...(await where(page, 0)));
  await settled(page);
  assert.match(await text(page, "#chosen"), /^triangle [\d,]+ of worm/);
  await page.locator("#side summary").nth(1).tap();
  await page.locator("#place-list button").first().tap();
  await page.waitForTimeout(700);
  await fits(page, "play", "time", "files", "share", "chosen");
  await page.screenshot({ path: join(shots, "phone-places.png") });
  await page.locator("#side summary").nth(1).tap();
  await drop(page, "bend.obj", "bend.pc2");
  await pauseAt(page, 2);
  await fits(page, "play", "previous", "time", "next", "step-show", "files", "self");
  await page.screenshot({ path: join(shots, "phone-frames.png") });
  await drop(page, "broken.obj", "box.obj", "notes.txt", "tip.stl");
  await fits(page, "files", "message");
  // A folder, which Playwright cannot drop.
  await page.evaluate(() => {
    const items = [{ kind: "file", webkitGetAsEntry: () => ({ isDirectory: true, name: "scans" }) }];
    window.dispatchEvent(Object.assign(new Event("drop"), { dataTransfer: { files: [new File([], "scans")], items } }));
  });
  assert.equal(await text(page, "#message"), "scans is a folder: open the files in it");
  assert.deepEqual(problems, []);
  console.log("a phone's screen: everything fits; fingers drag, choose and go to places");
  await page.context().close();
}

// The controls are not wider than their panel.
async function isWithin(page, panel, ...ids) {
  const beyond = await page.evaluate(([panel, ids]) => {
    const [{ left, right }, ...own] = [panel, ...ids].map((id) => document.getElementById(id).getBoundingClientRect());
    return ids.filter((_, ix) => own[ix].left < left || own[ix].right > right);
  }, [panel, ids]);
  assert.deepEqual(beyond, [], `wider than #${panel}`);
}

// A phone on its side: the picture is free, and every control is reached, if need be by scrolling.
async function onItsSide(browser) {
  for (const viewport of [{ width: 844, height: 390 }, { width: 667, height: 375 }, { width: 568, height: 320 }]) {
    const { page, problems } = await open(browser, { ...PHONE, viewport });
    await page.locator("#play").tap();
    await pauseAt(page, 1);
    await isWithin(page, "controls", "play", "time", "time-text");
    await page.screenshot({ path: join(shots, `phone-on-its-side-${viewport.width}.png`) });
    // What is left of the panels has the bodies, and nothing lies over it.
    const left = await page.evaluate(() => Math.min(...[...document.querySelectorAll("#answer, #bottom")].map((panel) => panel.getBoundingClientRect().left)));
    assert.ok(left > 0.53 * viewport.width, `${left} pixels for the bodies`);
    const covered = await page.evaluate((left) => {
      const at = [];
      for (let x = 8; x < left - 8; x += 20) for (let y = 8; y < innerHeight - 8; y += 20) at.push(document.elementFromPoint(x, y).id);
      return at.filter((id) => id !== "view");
    }, left);
    assert.deepEqual(covered, []);
    for (const ix of [0, 1, 2]) {
      const [x, y] = await where(page, ix);
      assert.ok(x > 0 && x < left && y > 0 && y < viewport.height, `body ${ix} is at ${x}, ${y}`);
    }
    const reach = async () => {
      const ids = await page.evaluate(() => [...document.querySelectorAll("button[id], select, input[type=checkbox]")].filter((control) => control.checkVisibility()).map(({ id }) => id).filter((id) => id !== ""));
      for (const id of ids) {
        const isReached = await page.evaluate((id) => {
          const control = document.getElementById(id);
          control.scrollIntoView({ block: "nearest" });
          const { left, top, width, height } = control.getBoundingClientRect();
          const there = document.elementFromPoint(left + width / 2, top + height / 2);
          return left >= 0 && left + width <= innerWidth && (there === control || control.contains(there));
        }, id);
        assert.ok(isReached, `#${id} can be reached`);
      }
      return ids;
    };
    await page.locator("#side summary").nth(2).tap();
    const reached = await reach();
    for (const id of ["play", "scene", "size", "share", "self", "all", "method"]) assert.ok(reached.includes(id), `#${id} is there`);
    await drop(page, "bend.obj", "bend.pc2");
    await pauseAt(page, 2);
    assert.ok((await reach()).includes("step-show"));
    await isWithin(page, "controls", "play", "previous", "time", "next", "time-text");
    assert.deepEqual(problems, []);
    await page.context().close();
  }
  console.log("a phone on its side: the picture is free, and all controls are reached");
}

// Without the network the readers cannot be loaded: the page says so and what to do, and later opens files.
async function offline(browser) {
  const { page } = await open(browser, DESKTOP);
  const note = await text(page, "#scene-note");
  await page.route("**/impinge/gpu/*.js", (route) => route.abort());
  await drop(page, "box.obj");
  const said = await text(page, "#message");
  assert.ok(said.startsWith("Not opened: box.obj; what you see was here before. ") && said.includes("Try again once you are online; if"), said);
  assert.equal(await text(page, "#scene-note"), note);
  await page.unrouteAll();
  await drop(page, "box.obj");
  assert.match(await text(page, "#scene-note"), /^box\.obj with itself: 12/);
  // The module alone can be asked for again.
  await page.route("**/impinge/gpu/*.wasm", (route) => route.abort());
  await page.reload();
  await page.waitForFunction(() => document.querySelector("#cpu .hash").textContent.length === 16);
  await drop(page, "box.obj");
  assert.match(await text(page, "#message"), /^Not opened: box\.obj; .* Try again once you are online\.$/);
  await page.unrouteAll();
  await drop(page, "box.obj");
  assert.match(await text(page, "#scene-note"), /^box\.obj with itself: 12/);
  assert.equal(await page.locator("#message").isVisible(), false);
  console.log("without the network: files are not opened, and the page says so");
  await page.context().close();
}

// While the page loads it says so, nothing can be pressed, and files wait. What fails is said, and can be tried again.
async function loading(browser) {
  const context = await browser.newContext(DESKTOP);
  const page = await context.newPage();
  let release;
  const held = new Promise((done) => (release = done));
  await page.route("**/impinge/cpu/*.wasm", async (route) => {
    await held;
    await route.continue();
  });
  await page.goto(server.url);
  const shown = (id) => page.locator(`#${id}`).isVisible();
  await page.waitForFunction(() => document.getElementById("play").disabled);
  assert.match(await text(page, "#status"), /^Loading …/);
  assert.deepEqual([await shown("cpu"), await shown("retry"), await page.locator("#files").isDisabled()], [false, false, false]);
  assert.equal(await page.locator("button:enabled:visible, select:enabled:visible").count(), 0);
  await page.locator("#files").setInputFiles(join(files, "tip.stl"));
  assert.match(await text(page, "#status"), /Next: tip\.stl\.$/);
  await offer(page, "box.obj");
  assert.match(await text(page, "#status"), /Next: tip\.stl, box\.obj\.$/);
  await page.screenshot({ path: join(shots, "loading.png") });
  release();
  await page.waitForFunction(() => /^box\.obj with itself: 12/.test(document.getElementById("scene-note").textContent));
  assert.deepEqual([await shown("cpu"), await page.locator("#play").isDisabled(), await page.locator("#scene").isDisabled()], [true, false, false]);
  await page.unrouteAll();

  // The share that has come.
  const network = await context.newCDPSession(page);
  const throttle = (downloadThroughput) => network.send("Network.emulateNetworkConditions", { offline: false, latency: 0, downloadThroughput, uploadThroughput: -1 });
  await network.send("Network.enable");
  await throttle(1_000_000);
  await page.goto(`${server.url}?slow`, { waitUntil: "commit" });
  await page.waitForFunction(() => /^Loading … [1-9]\d? %$/.test(document.getElementById("status")?.textContent));
  await throttle(-1);

  const failing = [
    ["**/three/three.core.js", (route) => route.abort()],
    ["**/impinge/cpu/*.wasm", (route) => route.abort()],
    ["**/impinge/cpu/*.wasm", (route) => route.fulfill({ status: 503 })],
    ["**/impinge/cpu/*.wasm", async (route) => route.fulfill({ contentType: "application/wasm", body: (await (await route.fetch()).body()).subarray(0, 200_000) })],
  ];
  for (const [ix, [pattern, fail]] of failing.entries()) {
    await page.route(pattern, fail);
    await page.goto(`${server.url}?${ix}`);
    await page.locator("#retry").waitFor();
    assert.match(await text(page, "#message"), /^The page could not be loaded\. Try again once you are online\. \(/);
    assert.deepEqual([await shown("status"), await shown("cpu")], [false, false]);
    await offer(page, "box.obj");
    await page.screenshot({ path: join(shots, "not-loaded.png") });
    await page.unrouteAll();
    await page.locator("#retry").click();
    await page.waitForFunction(() => /^box\.obj with itself: 12/.test(document.getElementById("scene-note").textContent));
    assert.deepEqual([await shown("message"), await shown("retry"), await page.locator("#play").isDisabled()], [false, false, false]);
  }
  await early(page);
  await failsTwice(page);
  // Where not even that part comes which says so.
  await page.route("**/text.js", (route) => route.abort());
  await page.goto(`${server.url}?start`);
  await page.waitForFunction(() => document.getElementById("status").textContent === "The page could not be loaded. Reload it once you are online, and open files then.");
  console.log("while the page loads: it says so, files wait, and what failed is tried again");
  await context.close();
}

// Before the first script is there, nothing can be pressed, a drop does not leave the page, and files wait.
async function early(page) {
  let release;
  const held = new Promise((done) => (release = done));
  await page.route("**/text.js", async (route) => {
    await held;
    await route.continue();
  });
  await page.goto(`${server.url}?early`, { waitUntil: "commit" });
  await page.locator("#back").waitFor({ state: "attached" });
  assert.equal(await page.locator("button:enabled:not(#retry), select:enabled, input:enabled:not(#files)").count(), 0);
  await offer(page, "bend.obj");
  await page.locator("#files").setInputFiles(join(files, "bend.pc2"));
  release();
  await page.waitForFunction(() => /^bend\.obj with bend\.pc2 with itself/.test(document.getElementById("scene-note").textContent));
  await page.unrouteAll();
}

// Files wait through failures as long as the page need not be reloaded; before it is, they are named as not opened.
async function failsTwice(page) {
  const fails = async (pattern, times) => {
    await page.route(pattern, (route) => route.abort());
    await page.goto(`${server.url}?${times}`);
    await page.locator("#retry").waitFor();
    await offer(page, "box.obj");
    for (let n = 1; n < times; n += 1) {
      await page.locator("#retry").click();
      await page.locator("#retry").waitFor();
    }
    await page.unrouteAll();
  };
  await fails("**/impinge/cpu/*.wasm", 3);
  assert.match(await text(page, "#message"), /Try again once you are online\. \([^]*\) Next: box\.obj\.$/);
  await page.locator("#retry").click();
  await page.waitForFunction(() => /^box\.obj with itself/.test(document.getElementById("scene-note").textContent));
  await fails("**/three/three.core.js", 2);
  assert.match(await text(page, "#message"), /Reload it once you are online, and open files then\. \([^]*\) Not opened: box\.obj\.$/);
  assert.equal(await text(page, "#retry"), "Reload");
  await page.locator("#retry").click();
  await page.waitForFunction(() => /^worm/.test(document.getElementById("scene-note").textContent));
}

// Without WebGL the page says so, and does not advise to load it again.
async function withoutWebGl(browser) {
  const context = await browser.newContext(DESKTOP);
  const page = await context.newPage();
  await page.addInitScript(() => {
    const { prototype } = HTMLCanvasElement;
    const { getContext } = prototype;
    prototype.getContext = function (kind, ...more) {
      return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...more);
    };
  });
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  await page.goto(server.url);
  const said = "The page needs WebGL, which this browser does not offer.";
  await page.waitForFunction((said) => document.getElementById("message").textContent === said, said);
  assert.deepEqual([await page.locator("#retry").isVisible(), await page.locator("#status").isVisible()], [false, false]);
  assert.equal(await page.locator("button:enabled:visible, select:enabled:visible").count(), 0);
  await offer(page, "box.obj");
  assert.equal(await text(page, "#message"), `${said} Not opened: box.obj.`);
  await page.keyboard.press("f");
  assert.deepEqual(problems, []);
  console.log("without WebGL: the page says so");
  await context.close();
}

async function withoutGpu(browser) {
  const { page, problems } = await open(browser, { viewport: { width: 900, height: 600 } });
  await page.waitForTimeout(300);
  for (const id of ["gpu", "gpu-label"]) assert.equal(await page.locator(`#${id}`).isVisible(), false, `#${id} is hidden`);
  await pauseAt(page, 1);
  assert.ok((await pairs(page)) > 100);
  await page.screenshot({ path: join(shots, "without-webgpu.png") });
  assert.deepEqual(problems, []);
  console.log("without WebGPU: nothing of it is shown, and the CPU answers");
  await page.context().close();
}

// A link says what it was made from, and nonsense in it is ignored.
function links() {
  const state = { scene: "ring", size: "3000", time: 0.25, self: true, eye: [1, 2, 3, 4, 5, 6], moved: [[0, 0, 0], [0.5, 0, -1]] };
  const scenes = { ring: {} };
  assert.deepEqual(fromLink(toLink(state), scenes), { ...state, size: 3000, moved: state.moved.flat() });
  const nothing = { scene: null, size: null, time: null, self: null, eye: null, moved: null };
  for (const text of ["", "#", "#scene=toString&triangles=x&time=NaN&self=2&eye=1,2&moved=1e9,", "#%zz"]) {
    assert.deepEqual(fromLink(text, scenes), nothing, text);
  }
}

// Whatever is opened meanwhile, and however long a detector takes to go, the last one asked for stays, and no other one is held.
async function latest() {
  const made = [];
  class Detector {
    isDisposed = false;
    slow = new Promise((done) => (this.finish = done));
    static async open() {
      made.push(new Detector());
      return made.at(-1);
    }
    async detect({ bodies }) {
      if (bodies.includes("lost")) throw new Error("a lost device");
      return { length: 0, hash: bodies.join(), stats: {} };
    }
    async dispose() {
      this.isDisposed = true;
      await this.slow;
    }
  }
  class Scene {
    bodies = [];
    constructor() {
      made.at(-1).scene = this;
    }
    add({ faces }) {
      if (faces === "refused") throw new Error("a bad body");
      this.bodies.push(faces);
    }
    dispose() {
      this.isDisposed = true;
    }
  }
  const said = [];
  const on = { answer: (n, ms, hash) => said.push(hash), note: (text, isBad) => isBad && said.push(text), stale() {} };
  const gpu = new Gpu(on, async () => ({ Detector, Scene }));
  const body = (index) => [{ index, corners: 3 }];
  const held = () => made.filter(({ isDisposed, scene }) => !isDisposed && !scene.isDisposed).map(({ scene }) => scene.bodies.join());

  await gpu.open({}, body("first"));
  // The second waits for the first one to go, and the third does not.
  const both = [gpu.open({}, body("second")), gpu.open({}, body("third"))];
  await both[1];
  made[0].finish();
  await both[0];
  await gpu.ask([], "between");
  assert.deepEqual([said, held()], [["third"], ["third"]]);

  for (const { finish } of made) finish();
  await gpu.open({}, body("refused"));
  assert.deepEqual([said.pop(), held(), gpu.isReady], ["WebGPU failed: a bad body", [], false]);
  await gpu.open({}, body("lost"));
  await gpu.ask([], "between");
  assert.deepEqual([said.pop(), held(), gpu.isReady], ["WebGPU failed: a lost device", [], false]);
}

async function example(browser) {
  const page = await browser.newPage();
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  await page.goto(`${server.url}examples/three.html`);
  const text = () => page.locator("#pairs").textContent();
  await page.waitForFunction(() => /^[1-9]\d* pairs$/.test(document.getElementById("pairs").textContent));
  const first = await text();
  await page.waitForFunction((first) => document.getElementById("pairs").textContent !== first, first);
  await page.screenshot({ path: join(shots, "example.png") });
  assert.deepEqual(problems, []);
  console.log("the example for three.js: pairs found, and they change");
}

// The ray under the mouse and the nearest point, on a mesh that deforms.
async function cursor(browser) {
  const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  await page.goto(`${server.url}examples/cursor.html`);
  const says = (pattern) => page.waitForFunction((of) => new RegExp(of).test(document.getElementById("hit").textContent), pattern);
  await page.mouse.move(2, 2);
  await says("^nothing under the cursor; the probe is \\d\\.\\d+ away$");
  // Somewhere on the way down the middle the ray meets the knot.
  let found = false;
  for (let y = 100; y < 500 && !found; y += 20) {
    await page.mouse.move(400, y);
    const text = await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(document.getElementById("hit").textContent)))));
    found = /^triangle \d+, \d\.\d{3} away under the cursor/.test(text);
  }
  assert.ok(found, "a triangle is under the cursor");
  await page.screenshot({ path: join(shots, "cursor.png") });
  assert.deepEqual(problems, []);
  console.log("the example with a cursor: rays hit the mesh, and the probe has a nearest point");
}

try {
  links();
  await latest();
  await writeFiles();
  const visits = [dropped, notes, order, frames, real, large, keyboard, phone, onItsSide, offline, loading, withoutWebGl, example, cursor];
  for (const [options, all] of [[{ gpu: true }, visits], [{ gpu: false }, [withoutGpu]]]) {
    const those = all.filter(({ name }) => only.length === 0 || only.includes(name));
    const browser = await launch(options);
    try {
      for (const visit of those) await visit(browser);
    } finally {
      await browser.close();
    }
  }
} finally {
  server.close();
  await rm(files, { recursive: true });
}
