// The page: bodies that deform, and the answers of the CPU and of WebGPU about the same frames.

import init, { Detector } from "impinge";
import { STAGE, demo, waving } from "./shapes.js";
import { View } from "./view.js";

// Seconds from the first pose of the demo to its last.
const SECONDS = 7;
const OPTIONS = { sharedVertex: "resolve" };

const element = (id) => document.getElementById(id);
const [play, time, size, method] = ["play", "time", "size", "method"].map(element);
const [useGpu, files, demoButton, message] = ["use-gpu", "files", "demo", "message"].map(element);

const view = new View(element("view"), drag, () => (mustDraw = true));
let bodies = [];
let detector = null;
let rows = new Uint32Array();
let isPlaying = true;
let isMoved = true;
let mustDraw = true;
let phase = 0;
let before = null;
// Counts the frames that the CPU has answered.
let frames = 0;

function show(id, pairs, ms, hash) {
  const row = element(id);
  row.querySelector(".pairs").textContent = pairs.toLocaleString("en");
  row.querySelector(".ms").textContent = ms.toFixed(ms < 10 ? 2 : 0);
  row.querySelector(".hash").textContent = hash;
}

function complain(error) {
  message.textContent = error === null ? "" : String(error.message ?? error);
  message.hidden = error === null;
}

// WebGPU answers when it can: always the latest frame, and never two at once.
const gpu = {
  module: null,
  detector: null,
  isBusy: false,
  // Counts changes of the bodies. An answer about other bodies is not shown.
  era: 0,
  note(text, name = "") {
    const note = element("gpu-note");
    note.textContent = text;
    note.className = name;
  },
};

// The build with WebGPU and the mesh readers is loaded when it is first needed.
async function gpuModule() {
  if (gpu.module === null) {
    gpu.module = await import("impinge/webgpu");
    await gpu.module.default();
  }
  return gpu.module;
}

async function openGpu() {
  gpu.era += 1;
  const era = gpu.era;
  const previous = gpu.detector;
  gpu.detector = null;
  // At once: what the row shows is an answer of the detector that goes.
  for (const cell of element("gpu").querySelectorAll("td")) cell.textContent = "";
  if (!useGpu.checked) {
    gpu.note(useGpu.disabled ? element("gpu-note").textContent : "WebGPU is off.");
    await previous?.dispose();
    return;
  }
  gpu.note("Compiling kernels …");
  try {
    await previous?.dispose();
    const { GpuDetector } = await gpuModule();
    const opened = await GpuDetector.open({ ...OPTIONS, method: method.value });
    for (const [ix, body] of bodies.entries()) await addTo(opened, body, view.positions(ix));
    if (era !== gpu.era) return void opened.dispose();
    gpu.detector = opened;
    isMoved = true;
  } catch (error) {
    if (era === gpu.era) gpu.note(`WebGPU failed: ${error.message}`, "different");
  }
}

async function askGpu(cpuHash) {
  const { detector: asked, era } = gpu;
  const thisFrame = frames;
  gpu.isBusy = true;
  try {
    for (const [ix] of bodies.entries()) void asked.setPositions(ix, view.positions(ix));
    const { pairs, hash, statistics } = await asked.everything();
    if (era !== gpu.era) return;
    show("gpu", pairs.length / 4, statistics.totalMs, hash);
    const isSame = hash === cpuHash;
    gpu.note(
      isSame ? "The same hash on the same frame." : `The hash of this frame on the CPU is ${cpuHash}`,
      isSame ? "same" : "different",
    );
  } catch (error) {
    if (era === gpu.era) {
      gpu.detector = null;
      gpu.note(`WebGPU failed: ${error.message}`, "different");
    }
  } finally {
    gpu.isBusy = false;
    // Without this, a scene that was paused meanwhile would keep the answer about an older frame.
    if (thisFrame !== frames) isMoved = true;
  }
}

function addTo(detector, { index, corners }, positions) {
  return corners === 4 ? detector.addTetrahedra(index, positions) : detector.add(index, positions);
}

// New detectors for the bodies that there are.
function openDetectors() {
  detector?.dispose();
  detector = new Detector({ ...OPTIONS, method: method.value });
  for (const [ix, body] of bodies.entries()) addTo(detector, body, view.positions(ix));
  isMoved = true;
  void openGpu();
}

function setBodies(given, stage) {
  bodies = given.map((body) => ({ ...body, offset: body.offset ?? [0, 0, 0] }));
  view.setBodies(bodies);
  pose();
  const { centre, radius } = stage ?? bounds();
  view.frame(centre, radius);
  const n = bodies.reduce((sum, { index, corners = 3 }) => sum + index.length / corners, 0);
  const names = bodies.map(({ name }) => name).join(", ");
  const isSolid = bodies.some(({ corners }) => corners === 4);
  const kind = isSolid ? "primitives" : "triangles";
  element("scene-note").textContent = `${names}: ${n.toLocaleString("en")} ${kind}, with self-collision`;
  openDetectors();
}

// The pose at the current time. It runs forwards, then backwards.
function pose() {
  const t = phase < 1 ? phase : 2 - phase;
  for (const [ix, body] of bodies.entries()) {
    const now = view.positions(ix);
    body.pose(body.positions, t, now);
    for (let at = 0; at < now.length; at += 1) now[at] += body.offset[at % 3];
  }
  time.value = String(t);
}

function bounds() {
  const [low, high] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (const [ix] of bodies.entries()) {
    for (const [at, x] of view.positions(ix).entries()) {
      low[at % 3] = Math.min(low[at % 3], x);
      high[at % 3] = Math.max(high[at % 3], x);
    }
  }
  const centre = low.map((x, axis) => (x + high[axis]) / 2);
  const radius = Math.hypot(...low.map((x, axis) => high[axis] - x)) / 2;
  return { centre, radius: radius > 0 && Number.isFinite(radius) ? radius : 1 };
}

function drag(ix, x, y, z) {
  const { offset } = bodies[ix];
  offset[0] += x;
  offset[1] += y;
  offset[2] += z;
  isMoved = true;
}

function frame(now) {
  requestAnimationFrame(frame);
  const passed = before === null ? 0 : Math.min(0.1, (now - before) / 1000);
  before = now;
  if (isPlaying) {
    phase = (phase + passed / SECONDS) % 2;
    isMoved = true;
  }
  if (!isMoved) {
    if (mustDraw) view.render();
    mustDraw = false;
    return;
  }
  isMoved = false;
  mustDraw = false;
  try {
    pose();
    const start = performance.now();
    for (const [ix] of bodies.entries()) detector.setPositions(ix, view.positions(ix));
    rows = detector.everything();
    frames += 1;
    show("cpu", rows.length / 4, performance.now() - start, detector.hash);
    view.draw(rows);
    if (gpu.detector !== null && !gpu.isBusy) void askGpu(detector.hash);
  } catch (error) {
    setPlaying(false);
    complain(error);
  }
}

function setPlaying(value) {
  isPlaying = value;
  play.textContent = isPlaying ? "Pause" : "Play";
}

function showDemo() {
  complain(null);
  demoButton.hidden = true;
  size.disabled = false;
  setBodies(demo(Number(size.value)), STAGE);
}

// One mesh meets a copy of itself; of more than two, the first two are taken.
async function open(list) {
  try {
    complain(null);
    const { readMesh } = await gpuModule();
    const meshes = [];
    for (const file of list.slice(0, 2)) {
      const mesh = readMesh(file.name, new Uint8Array(await file.arrayBuffer()), { weld: true });
      // Drawing needs single precision, and the answer is about what is drawn.
      mesh.positions = Float32Array.from(mesh.positions);
      if (mesh.index.length === 0) throw new Error(`${file.name} has no triangles and no tetrahedra`);
      meshes.push({ ...mesh, name: file.name });
    }
    if (meshes.length === 0) return;
    const sizes = meshes.map(({ positions }) => extent(positions));
    const apart = 0.2 * Math.max(...sizes);
    if (meshes.length === 1) {
      meshes.push({ ...meshes[0], offset: [apart, apart / 2, apart / 4] });
      sizes.push(sizes[0]);
    }
    const opened = meshes.map((mesh, ix) => ({ ...waving(mesh.name, mesh, sizes[ix]), offset: mesh.offset }));
    try {
      setBodies(opened);
    } catch (error) {
      // The detector refuses what it cannot answer exactly, such as coordinates beyond its range.
      showDemo();
      throw error;
    }
    demoButton.hidden = false;
    size.disabled = true;
  } catch (error) {
    complain(error);
  }
}

// The diagonal of the box around positions.
function extent(positions) {
  const [low, high] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (const [at, x] of positions.entries()) {
    low[at % 3] = Math.min(low[at % 3], x);
    high[at % 3] = Math.max(high[at % 3], x);
  }
  const diagonal = Math.hypot(...low.map((x, axis) => high[axis] - x));
  return diagonal > 0 && Number.isFinite(diagonal) ? diagonal : 1;
}

play.addEventListener("click", () => setPlaying(!isPlaying));
time.addEventListener("input", () => {
  setPlaying(false);
  phase = Number(time.value);
  isMoved = true;
});
size.addEventListener("change", showDemo);
demoButton.addEventListener("click", showDemo);
method.addEventListener("change", openDetectors);
useGpu.addEventListener("change", () => void openGpu());
files.addEventListener("change", () => {
  void open([...files.files]);
  files.value = "";
});
window.addEventListener("keydown", (event) => {
  if (event.code !== "Space" || /^(BUTTON|INPUT|SELECT)$/.test(event.target.tagName)) return;
  event.preventDefault();
  setPlaying(!isPlaying);
});
window.addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
});
for (const end of ["dragleave", "drop"]) {
  window.addEventListener(end, () => document.body.classList.remove("dropping"));
}
window.addEventListener("drop", (event) => {
  event.preventDefault();
  void open([...event.dataTransfer.files]);
});

// WebGPU starts by itself on hardware. A software adapter is slower than the CPU build, so it waits for its switch.
async function lookForGpu() {
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  if (!adapter) {
    const why = !window.isSecureContext
      ? "pages have it over https or from localhost only"
      : navigator.gpu
        ? "the browser finds no adapter"
        : "this browser does not have it";
    gpu.note(`No WebGPU: ${why}. The CPU answers alone, with the same pairs.`);
    return;
  }
  useGpu.disabled = false;
  const isSoftware = adapter.info?.isFallbackAdapter || /swiftshader|llvmpipe/i.test(adapter.info?.architecture ?? "");
  useGpu.checked = !isSoftware;
  if (isSoftware) gpu.note("WebGPU is here in software only, so it is off.");
  else await openGpu();
}

try {
  await init();
  showDemo();
  requestAnimationFrame(frame);
  await lookForGpu();
} catch (error) {
  complain(error);
}

// For tests, and for the console.
window.page = { view, get bodies() { return bodies; }, get rows() { return rows; } };
