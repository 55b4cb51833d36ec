// The page as a visitor uses it: node page.mjs FOLDER
//
// FOLDER/site is served. Bodies are dragged, files dropped, buttons pressed, on a large screen, on a phone's screen with
// touch, and in a browser without WebGPU. Screenshots are written to FOLDER/shots.

import assert from "node:assert/strict";
import { mkdir } from "node:fs/promises";
import { join } from "node:path";
import { launch, serve } from "./browser.mjs";

const [folder] = process.argv.slice(2);
const shots = join(folder, "shots");
await mkdir(shots, { recursive: true });
const server = await serve(join(folder, "site"));

// A page and the problems that it had: errors, and files that were not there.
async function open(browser, options) {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("response", (response) => response.status() >= 400 && problems.push(response.url()));
  page.on("console", (text) => text.type() === "error" && problems.push(text.text()));
  await page.goto(server.url);
  await page.waitForFunction(() => document.querySelector("#cpu .hash").textContent.length === 16);
  return { page, problems };
}

const hashOf = (page, id) => page.locator(`#${id} .hash`).textContent();
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

// Pauses at a time between 0 and 1.
async function pauseAt(page, time) {
  await page.locator("#time").fill(String(time));
  await settled(page);
  assert.equal(await page.locator("#play").textContent(), "Play");
}

async function pairs(page) {
  const text = await page.locator("#cpu .pairs").textContent();
  const counted = await page.evaluate(() => window.page.rows.length / 4);
  assert.equal(Number(text.replaceAll(",", "")), counted);
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

// Drops files as a file manager does.
async function drop(page, ...given) {
  const dropped = await page.evaluateHandle((given) => {
    const transfer = new DataTransfer();
    for (const { name, text } of given) transfer.items.add(new File([text], name));
    return transfer;
  }, given);
  await page.dispatchEvent("#view", "drop", { dataTransfer: dropped });
}

// A box from 0 to `size`, moved along x.
function box(size, moved) {
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => [bits & 1, (bits >> 1) & 1, bits >> 2].map((x) => x * size));
  const vertices = corners.map(([x, y, z]) => `v ${x + moved} ${y} ${z}`);
  const faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((face) => `f ${face}`);
  return [...vertices, ...faces].join("\n");
}

async function large(browser) {
  const { page, problems } = await open(browser, { viewport: { width: 1200, height: 760 } });
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

  // Both methods and both backends give one hash.
  const gpuSwitch = page.locator("#use-gpu");
  assert.equal(await gpuSwitch.isDisabled(), false);
  await gpuSwitch.check();
  await sameHash(page);
  await page.locator("#method").selectOption("cells");
  await settled(page);
  await sameHash(page);
  assert.equal(await hashOf(page, "gpu"), hashAtEnd);
  await page.locator("#method").selectOption("clusters");
  await settled(page);
  await sameHash(page);
  assert.equal(await hashOf(page, "gpu"), hashAtEnd);
  await page.screenshot({ path: join(shots, "end.png") });

  // A body is dragged out of the others and back, and the pairs follow.
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
  await page.screenshot({ path: join(shots, "dragged.png") });
  await page.mouse.up();

  // A drag beside the bodies turns the view, and moves nothing.
  const before = await page.evaluate(() => window.page.view.camera.position.toArray());
  const hash = await hashOf(page, "cpu");
  await page.mouse.move(600, 640);
  await page.mouse.down();
  await page.mouse.move(700, 600, { steps: 4 });
  await page.mouse.up();
  const after = await page.evaluate(() => window.page.view.camera.position.toArray());
  assert.notDeepEqual(after, before);
  assert.equal(await hashOf(page, "cpu"), hash);

  await page.locator("#play").click();
  assert.equal(await page.locator("#play").textContent(), "Pause");
  await page.locator("#play").click();
  await page.locator("#size").selectOption("3000");
  await settled(page);
  const note = await page.locator("#scene-note").textContent();
  assert.match(note, /worm, knot, ball: [23],\d{3} triangles/);

  // Two boxes that overlap, of two formats.
  await pauseAt(page, 0);
  const stl = [
    "solid tip",
    "facet normal 0 0 1\nouter loop\nvertex 0.5 0.5 0.5\nvertex 3 0.5 0.5\nvertex 0.5 3 0.5\nendloop\nendfacet",
    "endsolid tip",
  ].join("\n");
  await drop(page, { name: "box.obj", text: box(1, 0) }, { name: "tip.stl", text: stl });
  await page.waitForFunction(() => document.getElementById("scene-note").textContent.startsWith("box.obj, tip.stl: 13 "));
  await pauseAt(page, 0);
  // The triangle leaves the box through two sides of two triangles each, or through their common edge.
  const crossed = await pairs(page);
  assert.ok(crossed >= 2 && crossed <= 4, `${crossed} pairs`);
  await sameHash(page);
  await page.screenshot({ path: join(shots, "dropped.png") });

  // One mesh meets its copy.
  await drop(page, { name: "alone.obj", text: box(2, 5) });
  await page.waitForFunction(() => document.getElementById("scene-note").textContent.startsWith("alone.obj, alone.obj: 24 "));
  await settled(page);
  assert.ok((await pairs(page)) > 0);

  // The button for files takes the same way.
  await page.locator("#files").setInputFiles([
    { name: "chosen.obj", mimeType: "", buffer: Buffer.from(box(1, 0)) },
    { name: "far.obj", mimeType: "", buffer: Buffer.from(box(1, 9)) },
  ]);
  await page.waitForFunction(() => document.getElementById("scene-note").textContent.startsWith("chosen.obj, far.obj: 24 "));
  await settled(page);
  assert.equal(await pairs(page), 0);

  // Bad files are refused by name, and the scene stays.
  const message = page.locator("#message");
  await drop(page, { name: "broken.obj", text: "v 0 0\nf 1 2 3" });
  await message.waitFor({ state: "visible" });
  assert.match(await message.textContent(), /broken\.obj/);
  await drop(page, { name: "notes.txt", text: "" });
  await page.waitForFunction(() => document.getElementById("message").textContent.includes("notes.txt"));
  assert.match(await page.locator("#scene-note").textContent(), /^chosen\.obj/);
  await drop(page, { name: "huge.obj", text: "v 1e300 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3" });
  await page.waitForFunction(() => /non-finite|outside|huge/.test(document.getElementById("message").textContent));
  await page.screenshot({ path: join(shots, "refused.png") });
  await page.locator("#time").fill("0.5");
  const demo = page.locator("#demo");
  if (await demo.isVisible()) await demo.click();
  await settled(page);
  assert.match(await page.locator("#scene-note").textContent(), /^worm, knot, ball/);

  await gpuSwitch.uncheck();
  await settled(page);
  assert.equal(await hashOf(page, "gpu"), "");
  assert.deepEqual(problems, []);
  console.log("a large screen: played, dragged, turned, dropped, refused; CPU and WebGPU give one hash");
}

async function phone(browser) {
  const screen = { viewport: { width: 390, height: 780 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true };
  const { page, problems } = await open(browser, screen);
  await page.locator("#play").tap();
  await pauseAt(page, 1);
  const before = await pairs(page);
  // Nothing is wider than the screen, and all buttons are on it.
  const [width, height] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerHeight]);
  assert.ok(width <= 390, `${width} pixels wide`);
  for (const id of ["play", "time", "size", "method", "use-gpu"]) {
    const { x, y, width: w, height: h } = await page.locator(`#${id}`).boundingBox();
    assert.ok(x >= 0 && x + w <= 390 && y >= 0 && y + h <= height, `#${id} is on the screen`);
  }
  await page.screenshot({ path: join(shots, "phone.png") });
  // A finger drags the ball.
  const [x, y] = await where(page, 2);
  const touch = await page.context().newCDPSession(page);
  const send = (type, at) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: at ? [{ x: at[0], y: at[1] }] : [] });
  await send("touchStart", [x, y]);
  for (let step = 1; step <= 5; step += 1) await send("touchMove", [x, y + 40 * step]);
  await send("touchEnd");
  await settled(page);
  assert.ok((await pairs(page)) < before, "the pairs follow the finger");
  assert.deepEqual(problems, []);
  console.log("a phone's screen: everything fits, a finger drags");
}

async function withoutGpu(browser) {
  const { page, problems } = await open(browser, { viewport: { width: 900, height: 600 } });
  await page.waitForFunction(() => document.getElementById("gpu-note").textContent.startsWith("No WebGPU: "));
  assert.equal(await page.locator("#use-gpu").isDisabled(), true);
  await pauseAt(page, 1);
  assert.ok((await pairs(page)) > 100);
  await page.screenshot({ path: join(shots, "without-webgpu.png") });
  assert.deepEqual(problems, []);
  console.log("without WebGPU: the page says so, and the CPU answers");
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

try {
  for (const [options, visits] of [[{ gpu: true }, [large, phone, example]], [{ gpu: false }, [withoutGpu]]]) {
    const browser = await launch(options);
    try {
      for (const visit of visits) await visit(browser);
    } finally {
      await browser.close();
    }
  }
} finally {
  server.close();
}
