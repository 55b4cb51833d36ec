// The report of `impinge check --html` as its reader uses it: node report.mjs FOLDER PROGRAM
//
// A clean mesh, one with problems and one that is too large for the page are checked. The page is opened as a file, on a large
// screen and on a phone's with touch; meshes are opened, turned and visited place by place. Then a page of 1,000 meshes has to
// scroll without a long stop. An assembly's places are visited from its matrix and its list. Screenshots are written to FOLDER/shots.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdir, mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { launch } from "./browser.mjs";

const [folder, program] = process.argv.slice(2);
const shots = join(folder, "shots");
await mkdir(shots, { recursive: true });
const files = await mkdtemp(join(tmpdir(), "impinge-report-"));

// A wavy sheet of n by n squares, thickened into a closed slab. `pierced`: a spike goes through it, and one face is given twice.
function slab(n, pierced = false) {
  const lines = [], at = (i, j, top) => (top ? (n + 1) ** 2 : 0) + i * (n + 1) + j + 1;
  for (const top of [0, 1]) {
    for (let i = 0; i <= n; i++) {
      for (let j = 0; j <= n; j++) lines.push(`v ${i / n} ${0.1 * Math.sin((9 * i * j) / n / n) + 0.05 * top} ${j / n}`);
    }
  }
  const quad = (a, b, c, d) => lines.push(`f ${a} ${b} ${c}`, `f ${a} ${c} ${d}`);
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) {
      quad(at(i, j, 0), at(i + 1, j, 0), at(i + 1, j + 1, 0), at(i, j + 1, 0));
      quad(at(i, j, 1), at(i, j + 1, 1), at(i + 1, j + 1, 1), at(i + 1, j, 1));
    }
    quad(at(i + 1, 0, 0), at(i, 0, 0), at(i, 0, 1), at(i + 1, 0, 1));
    quad(at(i, n, 0), at(i + 1, n, 0), at(i + 1, n, 1), at(i, n, 1));
    quad(at(0, i, 0), at(0, i + 1, 0), at(0, i + 1, 1), at(0, i, 1));
    quad(at(n, i + 1, 0), at(n, i, 0), at(n, i, 1), at(n, i + 1, 1));
  }
  if (pierced) {
    const first = 2 * (n + 1) ** 2 + 1;
    lines.push("v 0.4 -0.3 0.5", "v 0.46 -0.3 0.5", "v 0.43 -0.3 0.55", "v 0.43 0.4 0.52");
    for (const [a, b, c] of [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]]) lines.push(`f ${first + a} ${first + b} ${first + c}`);
    lines.push(`f ${at(0, 0, 1)} ${at(0, 1, 1)} ${at(1, 1, 1)}`);
  }
  return lines.join("\n") + "\n";
}

function report(name, meshes, status = 0) {
  const list = join(files, `${name}.txt`);
  spawnSync("sh", ["-c", `printf '%s\\n' "$@" > "$0"`, list, ...meshes]);
  const page = join(files, `${name}.html`);
  const run = spawnSync(resolve(program), ["check", "--list", list, "--html", page, "--no-progress"], { cwd: files, encoding: "utf8" });
  assert.equal(run.status, status, run.stderr);
  return pathToFileURL(page).href;
}

// Pixels of the view that look like no background, and those that are red or blue.
const seen = (page) =>
  page.evaluate(async () => {
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    draw();
    const gl = canvas.getContext("webgl2"), [w, h] = [canvas.width, canvas.height], pixels = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    let [mesh, red, blue, hash] = [0, 0, 0, 0];
    for (let ix = 0; ix < pixels.length; ix += 4) {
      const [r, g, b] = pixels.subarray(ix, ix + 3);
      mesh += Math.abs(r - 237) + Math.abs(g - 240) + Math.abs(b - 245) > 12;
      red += r > g + 40 && r > b + 40;
      blue += b > r + 40 && b > g + 40;
      hash = (Math.imul(hash, 31) + r + 3 * g + 7 * b) | 0;
    }
    return { mesh: mesh / (w * h), red: red / (w * h), blue: blue / (w * h), hash };
  });

await writeFile(join(files, "clean.obj"), slab(24));
await writeFile(join(files, "pierced.obj"), slab(24, true));
await writeFile(join(files, "large.obj"), slab(320, true));
await writeFile(join(files, "broken.obj"), "v 0 0 nan\n");
const few = report("few", ["clean.obj", "pierced.obj", "large.obj", "broken.obj"], 1);
const browser = await launch({ gpu: false });
try {
  for (const [kind, options] of [
    ["desktop", { viewport: { width: 1200, height: 760 } }],
    ["phone", { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true }],
  ]) {
    const context = await browser.newContext(options), page = await context.newPage(), problems = [];
    page.on("pageerror", (error) => problems.push(String(error)));
    page.on("console", (text) => text.type() === "error" && problems.push(text.text()));
    await page.goto(few);
    const press = (selector) => (kind === "phone" ? page.locator(selector).tap() : page.locator(selector).click());
    const row = (name) => `tr:has(td[data-v="${name}"])`, line = () => page.locator(".at").textContent();
    assert.equal(await page.locator(".pic button.see").count(), 3);

    await press(`${row("clean.obj")} .pic button`);
    const clean = await seen(page);
    assert.ok(clean.mesh > 0.05 && clean.red === 0, JSON.stringify(clean));
    assert.equal(await line(), "0 places. 2,496 faces.");
    assert.equal(await page.locator("[data-do=next]").isVisible(), false);
    await press("[data-do=close]");

    await press(`${row("pierced.obj")} summary`);
    await press(`${row("pierced.obj")} button.place >> nth=0`);
    assert.match(await line(), /^Place 1 of \d+: self-intersections?: \d+ elements/);
    const place = await seen(page);
    assert.ok(place.mesh > 0.05 && place.red > 0.002, JSON.stringify(place));
    await page.screenshot({ path: join(shots, `report-${kind}-place.png`) });
    await page.keyboard.press("n");
    assert.match(await line(), /^Place 2 of /);
    await press("[data-do=previous]");
    assert.match(await line(), /^Place 1 of /);
    assert.equal((await seen(page)).hash, place.hash);
    await page.keyboard.press("ArrowLeft");
    assert.notEqual((await seen(page)).hash, place.hash);
    await press("[data-do=whole]");
    const whole = await seen(page);
    assert.ok(whole.mesh > 0.05 && whole.red > 0, JSON.stringify(whole));
    if (kind === "desktop") {
      await page.mouse.move(600, 400);
      await page.mouse.down();
      await page.mouse.move(700, 440, { steps: 5 });
      await page.mouse.up();
      const turned = await seen(page);
      assert.notEqual(turned.hash, whole.hash);
      await page.mouse.wheel(0, -400);
      assert.ok((await seen(page)).mesh > 1.2 * turned.mesh);
    }
    await page.screenshot({ path: join(shots, `report-${kind}-whole.png`) });
    await page.keyboard.press("Escape");
    assert.equal(await page.locator("dialog").isVisible(), false);

    await press(`${row("large.obj")} .pic button`);
    assert.match(await line(), /200,000 of 412,\d+ faces are here/);
    assert.ok((await seen(page)).red > 0);
    await press("[data-do=close]");
    await page.screenshot({ path: join(shots, `report-${kind}.png`) });
    assert.deepEqual(problems, []);
    await context.close();
  }

  // Three parts: one passes through the block, and the lid lies on it.
  const box = (name, low, high, first) => {
    const lines = [`g ${name}`];
    for (let ix = 0; ix < 8; ix++) lines.push(`v ${[0, 1, 2].map((k) => ((ix >> k) & 1 ? high : low)[k]).join(" ")}`);
    for (const side of ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"]) {
      lines.push(`f ${side.split(" ").map((n) => +n + first).join(" ")}`);
    }
    return lines.join("\n") + "\n";
  };
  const machine = box("block", [0, 0, 0], [2, 2, 2], 0) + box("through", [1, 0.5, 0.5], [3, 1.5, 1.5], 8) + box("lid", [0, 2, 0], [2, 2.5, 2], 16);
  await writeFile(join(files, "machine.obj"), machine);
  const run = spawnSync(resolve(program), ["check", "--assembly", "machine.obj", "--html", "machine.html", "--no-progress"], { cwd: files, encoding: "utf8" });
  assert.equal(run.status, 0, run.stderr);
  for (const [kind, options] of [
    ["desktop", { viewport: { width: 1200, height: 760 } }],
    ["phone", { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true }],
  ]) {
    const context = await browser.newContext(options), page = await context.newPage(), problems = [];
    page.on("pageerror", (error) => problems.push(String(error)));
    page.on("console", (text) => text.type() === "error" && problems.push(text.text()));
    await page.goto(pathToFileURL(join(files, "machine.html")).href);
    await page.screenshot({ path: join(shots, `assembly-${kind}.png`) });
    const press = (selector) => (kind === "phone" ? page.locator(selector).tap() : page.locator(selector).click());
    const line = () => page.locator(".at").textContent();
    await press("section > div > button.see");
    const whole = await seen(page);
    assert.equal(await line(), "2 places. 36 faces.");
    await press("[data-do=next]");
    assert.match(await line(), /^Place 1 of 2: block and through interpenetrate: /);
    const first = await seen(page);
    assert.ok(first.red > 0.01 && first.blue > 0.005 && first.hash !== whole.hash, JSON.stringify(first));
    await page.screenshot({ path: join(shots, `assembly-${kind}-place.png`) });
    // The third part is seen, though it is not of this place.
    await page.evaluate(() => (shown.others = []));
    assert.notEqual((await seen(page)).hash, first.hash);
    await press("[data-do=next]");
    assert.match(await line(), /^Place 2 of 2: block and lid touch: /);
    await press("[data-do=close]");
    // A cell of the matrix opens the same place as the list.
    await press("tbody tr:nth-child(2) td:nth-child(2) button");
    assert.equal((await seen(page)).hash, first.hash);
    await press("[data-do=close]");
    await press(".pairs button.place >> nth=1");
    assert.match(await line(), /^Place 2 of 2: /);
    assert.deepEqual(problems, []);
    await context.close();
  }

  // A dataset: the rows of four meshes, 250 times.
  const meshes = [["a.obj", slab(16)], ["b.obj", slab(16, true)], ["c.obj", slab(20)], ["d.obj", slab(12, true)]];
  for (const [name, text] of meshes) await writeFile(join(files, name), text);
  const many = report("many", meshes.map(([name]) => name)), path = fileURLToPath(many);
  const [head, rows, tail] = (await readFile(path, "utf8")).split(/(?<=<tbody>\n)|(?=<\/tbody>)/);
  await writeFile(path, head + rows.repeat(250) + tail);
  const context = await browser.newContext({ viewport: { width: 1200, height: 760 } }), page = await context.newPage();
  const from = performance.now();
  await page.goto(many);
  await seen(page).catch(() => {});
  const opened = performance.now() - from;
  // The longest time between two frames while the page is scrolled from its beginning to its end.
  const [longest, frames] = await page.evaluate(async () => {
    let [last, longest, frames] = [performance.now(), 0, 0];
    const end = document.documentElement.scrollHeight;
    for (let y = 0; y < end; y += 700) {
      scrollTo(0, y);
      await new Promise((done) => requestAnimationFrame(done));
      const now = performance.now();
      [longest, last, frames] = [Math.max(longest, now - last), now, frames + 1];
    }
    return [longest, frames];
  });
  console.log(`a report of 1,000 meshes opened in ${opened.toFixed(0)} ms; longest of ${frames} frames of scrolling: ${longest.toFixed(0)} ms`);
  await page.locator("th").nth(3).click();
  assert.equal(await page.locator("tbody tr").first().locator("td.name").getAttribute("data-v"), "b.obj");
  assert.equal(await page.locator("tbody tr").count(), 1000);
  await page.locator("tbody tr").first().locator(".pic button").click();
  assert.ok((await seen(page)).red > 0);
} finally {
  await browser.close();
  await rm(files, { recursive: true, force: true });
}
console.log("the report: all as expected");
