// The page: bodies of a scene or of dropped files, and the exact answer about them as they are.

import { Detector, Scene } from "impinge";
import { bodiesOf, hasParts, looksNumbered, mayBePoses, read } from "./files.js";
import { Gpu, NotLoaded, lookForAdapter, withReaders } from "./gpu.js";
import { fromLink, toLink } from "./link.js";
import { extentOf, meshOf, pose } from "./motion.js";
import * as panel from "./panel.js";
import { ballAround, places as placesOf } from "./places.js";
import { SCENES } from "./shapes.js";
import { askStep, contactAt } from "./steps.js";
import { counted, element, grouped, say } from "./text.js";
import { View } from "./view.js";

// Seconds from the first pose of a scene to its last, and frames per second.
const SECONDS = 7;
const FRAME_RATE = 10;
// While a scene plays, the places are listed this often, in milliseconds.
const LIST_EVERY = 300;
// A place fills this part of the picture, and is not seen from nearer than this part of the scene.
const PLACE_SHARE = 0.4;
const LEAST_PLACE = 0.02;
// Bodies that are smaller parts of the picture are not seen.
const LEAST_BODY = 0.002;
// Longer names are shortened in the sentence about the answer.
const MOST_LETTERS = 36;

const [play, time, scene, size, as] = ["play", "time", "scene", "size", "as"].map(element);
const [self, method, up] = ["self", "method", "up"].map(element);
const useGpu = element("use-gpu");

// What is shown: `files` as they were read, or `null` for a scene of the page.
let files = null;
let bodies = [];
// From coordinates to those that are drawn: subtract the centre, divide by the radius.
let stage = { centre: [0, 0, 0], radius: 1, reach: 1 };
// The last moment: 1 for a scene that changes steadily, the last frame's number for frames, 0 if nothing moves.
let end = 0;
let isFramed = false;
let isFarApart = false;
let now = 0;
let direction = 1;
let isPlaying = false;

let detector = null;
// The bodies as the detector is asked about them.
let world = null;
let rows = new Uint32Array();
let places = [];
let place = -1;
let chosen = null;
// The elements of the contact that was gone to.
let touching = [];
let step = null;
let isMoved = true;
let mustDraw = true;
let before = null;
let listed = 0;
// Counts the frames that the CPU has answered.
let nAnswers = 0;
// The openings whose files are read, in order: what was opened last is shown, however long an earlier file takes. What is shown takes those
// from here that were opened before; one that shows nothing leaves them.
const reading = new Set();
// What was wrong with files that were read at the same time.
let complaints = [];

// Made by `begin`.
let view = null;

const onView = {
  change: () => (mustDraw = true),
  drag(ix, x, y, z) {
    const { offset } = bodies[ix];
    const by = isYUp() ? [x, z, -y] : [x, y, z];
    for (const axis of [0, 1, 2]) offset[axis] += by[axis] * stage.radius;
    element("back").hidden = false;
    isMoved = true;
  },
  press: () => document.body.classList.add("pressed"),
  click: (hit) => choose(hit),
  hover(hit, { clientX, clientY }) {
    const tip = element("tip");
    tip.hidden = hit === null || isPlaying;
    if (tip.hidden) return;
    tip.textContent = panel.nameOf(bodies, hit.body, hit.element);
    tip.style.left = `${Math.min(clientX + 14, window.innerWidth - tip.offsetWidth - 4)}px`;
    tip.style.top = `${clientY + 14}px`;
  },
};

const gpu = new Gpu({
  answer(n, ms, hash, asked) {
    show("gpu", n, ms, hash);
    const isSame = hash === asked.hash;
    gpuNote(isSame ? "The same hash on the same frame." : `The CPU's hash is ${asked.hash}.`, isSame ? "same" : "different");
    // Without this, a scene that was paused meanwhile would keep the answer about an older frame.
    if (asked.nAnswers !== nAnswers) isMoved = true;
  },
  note: (text, isBad) => gpuNote(text, isBad ? "different" : ""),
  stale: () => (isMoved = true),
});

function gpuNote(text, className) {
  Object.assign(element("gpu-note"), { textContent: text, className });
}

function show(id, n, ms, hash) {
  const row = element(id);
  row.hidden = false;
  row.querySelector(".pairs").textContent = grouped(n);
  row.querySelector(".ms").textContent = ms.toFixed(ms < 10 ? 2 : 0);
  row.querySelector(".hash").textContent = hash;
}

const complain = (text) => say("message", text);
const options = () => ({ method: method.value });
// Where files say nothing, y points up, as for the program. The scenes of the page, and the view, have z there.
const isYUp = () => files !== null && up.value === "y";
const which = () => (bodies.length === 1 || self.checked ? "all" : "between");

// Replaces the bodies. Throws, and changes nothing, if they are refused.
function setBodies(given, { centre, radius, reach = radius, begin = 0 } = {}) {
  const made = given.map((body) => {
    const all = body.frames ?? [body.positions];
    const isDouble = all.some((positions) => positions instanceof Float64Array);
    const now = new (isDouble ? Float64Array : Float32Array)(body.positions.length);
    return { corners: 3, ...body, offset: [0, 0, 0], now };
  });
  const filled = sceneOf(made);
  world?.dispose();
  world = filled;
  openDetector();
  bodies = made;
  isFramed = bodies.some(({ frames }) => frames?.length > 1);
  end = isFramed ? Math.max(...bodies.map(({ frames }) => (frames?.length ?? 1) - 1)) : 0;
  if (bodies.some(({ pose }) => pose)) end = 1;
  now = begin;
  direction = 1;
  const ball = centre ? { centre, radius } : ballAround(extentOf(bodies));
  stage = { ...ball, reach: reach ?? ball.radius };
  isFarApart = bodies.length > 1 && bodies.every((body) => ballAround(extentOf([body])).radius < LEAST_BODY * stage.radius);
  chosen = null;
  touching = [];
  step = null;
  place = -1;
  view.setBodies(bodies);
  showMotion();
  element("back").hidden = true;
  self.disabled = bodies.length === 1;
  if (self.disabled) self.checked = true;
  panel.showBodies(bodies, (ix, isHidden) => view.hide(ix, isHidden));
  panel.showChosen(null);
  leaveRoom();
  seeAll();
  isMoved = true;
  void openGpu();
}

function sceneOf(given) {
  const filled = new Scene();
  try {
    for (const body of given) {
      pose(body, 0, body.now);
      filled.add(meshOf(body));
    }
    return filled;
  } catch (error) {
    filled.dispose();
    throw error;
  }
}

function openDetector() {
  detector?.dispose();
  detector = new Detector(options());
}

function openGpu() {
  element("gpu").hidden = !useGpu.checked;
  for (const cell of element("gpu").querySelectorAll("span, code")) cell.textContent = "";
  return useGpu.checked ? gpu.open(options(), bodies) : gpu.close();
}

function showMotion() {
  element("motion").hidden = end === 0;
  for (const id of ["previous", "next"]) element(id).hidden = !isFramed;
  time.max = String(end);
  time.step = isFramed ? "1" : "0.001";
  setPlaying(isPlaying && end > 0);
}

function setPlaying(value) {
  // A frame that played stays as it is.
  if (isFramed && isPlaying && !value) now = Math.min(end, Math.floor(now));
  if (value !== isPlaying) isMoved = true;
  isPlaying = value;
  play.textContent = isPlaying ? "Pause" : "Play";
}

function setTime(value) {
  setPlaying(false);
  touching = [];
  now = Math.min(end, Math.max(0, value));
  isMoved = true;
}

const nextFrame = (by) => setTime(by > 0 ? Math.floor(now) + 1 : Math.ceil(now) - 1);

// What moves meanwhile: a scene runs forwards, then backwards; frames start again.
function advance(seconds) {
  if (isFramed) {
    now += seconds * FRAME_RATE;
    if (now >= end + 1) now = 0;
    return;
  }
  now += (direction * seconds) / SECONDS;
  if (now > 1 || now < 0) {
    direction = -direction;
    now = Math.min(1, Math.max(0, now));
  }
}

// Writes the point whose coordinates begin at `at` as it is drawn: `isTurned` if y points up.
function drawn(positions, at, to, isTurned) {
  const { centre, radius } = stage;
  const y = (positions[at + 1] - centre[1]) / radius;
  const z = (positions[at + 2] - centre[2]) / radius;
  to[at] = (positions[at] - centre[0]) / radius;
  to[at + 1] = isTurned ? -z : y;
  to[at + 2] = isTurned ? y : z;
  return to;
}

function draw() {
  // Frames are shown as they are while they play.
  const at = isFramed && isPlaying ? Math.min(end, Math.floor(now)) : now;
  const isTurned = isYUp();
  for (const [ix, body] of bodies.entries()) {
    pose(body, at, body.now);
    const to = view.positions(ix);
    for (let k = 0; k < to.length; k += 3) drawn(body.now, k, to, isTurned);
  }
  time.value = String(at);
  element("time-text").textContent = isFramed ? `${Number(at.toFixed(3))} of ${end}` : at.toFixed(3);
  const text = isFramed ? `frame ${at} of ${end}` : `${Math.round(100 * at)} %`;
  time.setAttribute("aria-valuetext", text);
}

function answer() {
  const start = performance.now();
  for (const [ix, body] of bodies.entries()) world.setPositions(ix, body.now);
  const { rows: found, length, hash } = detector.detect(world, { which: which() });
  rows = found;
  nAnswers += 1;
  show("cpu", length, performance.now() - start, hash);
  showQuestion();
  panel.showColliding(view.draw(rows));
  if (gpu.isReady) void gpu.ask(bodies, which(), { hash, nAnswers });
}

// What is asked, in words.
function showQuestion() {
  const what = bodies.some(({ corners }) => corners === 4) ? "element" : "triangle";
  say("verdict", rows.length === 4 ? `pair of ${what}s intersects` : `pairs of ${what}s intersect`);
  const n = bodies.reduce((sum, { index, corners }) => sum + index.length / corners, 0);
  const names = bodies.map(({ name }) => shortened(name)).join(", ");
  const whom = bodies.length === 1 ? "with itself" : self.checked ? "with each other and themselves" : "with each other";
  const notes = [`${names} ${whom}: ${counted(n, what)}`];
  const nWelded = bodies.reduce((sum, { map, positions }) => sum + (map ? map.length - positions.length / 3 : 0), 0);
  if (nWelded > 0) notes.push(`${counted(nWelded, "vertex", "vertices")} welded to others`);
  if (!element("back").hidden) notes.push("moved by hand");
  if (isFarApart) notes.push("so far apart that they are too small to be seen in one picture");
  say("scene-note", notes.join("; "));
}

// A name with its beginning and its end.
const shortened = (name) => (name.length > MOST_LETTERS ? `${name.slice(0, MOST_LETTERS / 2)}…${name.slice(-MOST_LETTERS / 2)}` : name);

// Finds and lists the places of the last answer.
function list() {
  places = placesOf(rows, bodies);
  if (place >= places.length) place = -1;
  panel.showPlaces(places, bodies, goTo);
  mark();
}

// Marks the place and the element that were chosen, with its partners.
function mark() {
  panel.markPlace(place);
  const partners = panel.showChosen(chosen, rows, bodies, choose);
  view.choose(chosen ? [[chosen.body, chosen.element], ...partners] : touching);
}

const seeAll = () => view.frame([0, 0, 0], 1, stage.reach / stage.radius);

function flyTo({ centre, radius }) {
  const near = Math.max(LEAST_PLACE, radius / stage.radius);
  view.flyTo(drawn(centre, 0, [], isYUp()), near / PLACE_SHARE);
}

function goTo(ix) {
  setPlaying(false);
  place = ix;
  flyTo(ballAround(places[ix]));
  const [body, number] = places[ix].first;
  choose({ body, element: number });
}

function nextPlace(by) {
  if (isPlaying) list();
  if (places.length > 0) goTo((place + by + places.length + (place < 0 && by < 0 ? 1 : 0)) % places.length);
}

// Marks an element and its partners; `null` marks none.
function choose(hit) {
  chosen = hit;
  touching = [];
  if (hit !== null) setPlaying(false);
  mark();
}

// What touches on the way from a frame to the next. It is asked once per frame, when nothing plays.
function showStep() {
  const isAsked = isFramed && !isPlaying;
  element("step").hidden = !isAsked;
  if (!isAsked) return;
  const from = Math.floor(now);
  const key = JSON.stringify([from, which(), bodies.map(({ offset }) => offset)]);
  if (step?.key === key) return;
  step = { key, from, first: null, text: "This is the last frame." };
  if (from < end) Object.assign(step, askStep(detector, world, bodies, from, which()));
  say("step-text", step.text);
  // A face of a tetrahedron has a number of its own, which the page does not know.
  const isHere = step.first && [step.first.bodyA, step.first.bodyB].every((ix) => bodies[ix].corners === 3);
  element("step-show").hidden = !isHere;
}

// Goes to the moment and the place of the step's first contact, and outlines a triangle of each side.
function showContact() {
  choose(null);
  setTime(step.from + step.first.toi);
  draw();
  const { box, triangles } = contactAt(step.first, bodies);
  touching = triangles;
  flyTo(ballAround(box));
}

function frame(clock) {
  requestAnimationFrame(frame);
  const passed = before === null ? 0 : Math.min(0.1, (clock - before) / 1000);
  before = clock;
  const isFlying = view.fly(clock);
  if (isPlaying) {
    advance(passed);
    isMoved = true;
  }
  if (!isMoved) {
    if (mustDraw || isFlying) view.render();
    if (mustDraw) linkSoon();
    mustDraw = false;
    return;
  }
  isMoved = false;
  mustDraw = false;
  try {
    draw();
    answer();
    if (!isPlaying || clock - listed > LIST_EVERY) {
      listed = clock;
      list();
    }
    showStep();
    linkSoon();
  } catch (error) {
    setPlaying(false);
    isMoved = false;
    complain(String(error.message ?? error));
  }
}

// Shows a scene of the page.
function showScene(name, { triangles = Number(size.value), withSelf = SCENES[name].self, plays = true } = {}) {
  reading.clear();
  complaints = [];
  complain("");
  tellReading();
  panel.showNotes([]);
  files = null;
  showFileControls();
  scene.value = name;
  self.checked = withSelf;
  isPlaying = plays;
  const { make, ...where } = SCENES[name];
  setBodies(make(triangles), where);
}

function showFileControls() {
  const isFiles = files !== null;
  scene.querySelector('[value="files"]').hidden = !isFiles;
  if (isFiles) scene.value = "files";
  element("size-label").hidden = isFiles;
  element("up-label").hidden = !isFiles;
  element("share").hidden = isFiles;
  const ways = { poses: isFiles && mayBePoses(files), parts: isFiles && hasParts(files) };
  element("as-label").hidden = !ways.poses && !ways.parts;
  for (const [way, isThere] of Object.entries(ways)) as.querySelector(`[value="${way}"]`).hidden = !isThere;
  document.body.classList.toggle("files", isFiles);
}

// Shows what was read from files. Nothing plays: the first answer is about the meshes as they are.
function showFiles(given, how) {
  const { bodies: made, refused } = bodiesOf(given, how);
  // First what may throw: whatever is shown then goes on.
  setBodies(made);
  setPlaying(false);
  if (made.length > 1) self.checked = false;
  files = given;
  panel.showNotes(given.meshes);
  as.value = how;
  showFileControls();
  history.replaceState(null, "", location.pathname + location.search);
  return refused;
}

export async function open(offered, folders = []) {
  const list = offered.filter(({ name }) => !folders.includes(name));
  if (reading.size === 0) complaints = [];
  complainToo(folders.map((name) => `${name} is a folder: open the files in it`));
  if (list.length === 0) return;
  const names = list.map(({ name }) => name).join(", ");
  const opening = { names };
  opening.ended = new Promise((done) => (opening.end = done));
  reading.add(opening);
  tellReading();
  try {
    const readers = await withReaders();
    // Lets the browser show the line above.
    await new Promise((done) => setTimeout(done));
    const given = await read(readers, list);
    // A point cache alone moves the meshes that are there, once those are read that were opened before.
    if (given.meshes.length === 0 && given.caches.length > 0) {
      while (earlierThan(opening).length > 0) await Promise.race(earlierThan(opening).map(({ ended }) => ended));
      given.meshes = files?.meshes ?? [];
    }
    if (!reading.has(opening)) return;
    if (given.meshes.length === 0) {
      given.refused.push(...given.caches.map(({ name }) => `${name} moves a mesh: drop the mesh, too`));
      return complainToo(given.refused);
    }
    const how = looksNumbered(given) ? "poses" : "bodies";
    try {
      given.refused.push(...showFiles(given, how));
    } catch (error) {
      if (how === "bodies") throw error;
      given.refused.push(error.message, ...showFiles(given, "bodies"));
    }
    for (const earlier of earlierThan(opening)) reading.delete(earlier);
    complainToo(given.refused);
  } catch (error) {
    if (!reading.has(opening)) return;
    complainToo([error instanceof NotLoaded ? `Not opened: ${names}; what you see was here before. ${error.message}` : String(error.message ?? error)]);
  } finally {
    if (reading.delete(opening)) tellReading();
    opening.end();
  }
}

// The openings before one; none if something that was opened later is shown.
function earlierThan(opening) {
  const all = [...reading];
  return all.slice(0, Math.max(0, all.indexOf(opening)));
}

function tellReading() {
  say("status", reading.size === 0 ? "" : `Reading ${[...reading].map(({ names }) => names).join(", ")} …`);
}

function complainToo(texts) {
  complaints.push(...texts);
  complain(complaints.join("\n"));
}

// The link of what is seen.
function link() {
  const moved = bodies.map(({ offset }) => offset);
  return toLink({ scene: scene.value, size: size.value, time: isPlaying ? null : now, self: self.checked, eye: view.eye, moved });
}

let linkTimer = null;
function linkSoon() {
  if (files !== null || isPlaying) return;
  clearTimeout(linkTimer);
  linkTimer = setTimeout(() => files === null && history.replaceState(null, "", link()), 400);
}

function followLink() {
  const linked = fromLink(location.hash, SCENES);
  const name = linked.scene ?? "ring";
  if (linked.size !== null && [...size.options].some(({ value }) => value === String(linked.size))) size.value = String(linked.size);
  showScene(name, { withSelf: linked.self ?? SCENES[name].self, plays: linked.time === null });
  if (linked.time !== null) setTime(linked.time);
  if (linked.moved?.length === 3 * bodies.length) {
    for (const [ix, { offset }] of bodies.entries()) offset.splice(0, 3, ...linked.moved.slice(3 * ix, 3 * ix + 3));
    element("back").hidden = linked.moved.every((x) => x === 0);
  }
  if (linked.eye) view.eye = linked.eye;
}

async function share() {
  history.replaceState(null, "", link());
  try {
    await navigator.clipboard.writeText(location.href);
    say("status", "The link is copied. It shows this scene as you see it.");
  } catch {
    say("status", "Copy the address of this page: it shows this scene as you see it.");
  }
  setTimeout(tellReading, 4000);
}

// A phone on its side, and one that is held upright.
const isLow = () => matchMedia("(max-height: 480px) and (orientation: landscape)").matches;
const isUpright = () => !isLow() && matchMedia("(max-width: 720px)").matches;

// Keeps the bodies out of the panels.
function leaveRoom() {
  const box = (id) => element(id).getBoundingClientRect();
  if (isLow()) return view.leaveRoom({ top: 0, right: window.innerWidth - box("answer").left, bottom: 0, left: 0 });
  const isNarrow = isUpright();
  const bottom = window.innerHeight - box(isNarrow ? "bottom" : "controls").top;
  document.documentElement.style.setProperty("--foot", `${bottom}px`);
  const right = isNarrow ? 0 : window.innerWidth - box("side").left;
  view.leaveRoom({ top: isNarrow ? box("answer").bottom : 0, right, bottom, left: 0 });
}

play.addEventListener("click", () => setPlaying(!isPlaying));
time.addEventListener("input", () => setTime(Number(time.value)));
element("previous").addEventListener("click", () => nextFrame(-1));
element("next").addEventListener("click", () => nextFrame(1));
element("step-show").addEventListener("click", showContact);
element("all").addEventListener("click", seeAll);
element("share").addEventListener("click", () => void share());
scene.addEventListener("change", () => showScene(scene.value));
size.addEventListener("change", () => showScene(scene.value, { withSelf: self.checked, plays: isPlaying }));
for (const control of [self, up]) control.addEventListener("change", () => (isMoved = true));
as.addEventListener("change", () => {
  try {
    complain(showFiles(files, as.value).join("\n"));
  } catch (error) {
    as.value = "bodies";
    complain(error.message);
  }
});
element("back").addEventListener("click", () => {
  for (const { offset } of bodies) offset.fill(0);
  element("back").hidden = true;
  isMoved = true;
});
method.addEventListener("change", () => {
  openDetector();
  step = null;
  isMoved = true;
  void openGpu();
});
useGpu.addEventListener("change", () => void openGpu());

const KEYS = {
  " ": () => end > 0 && setPlaying(!isPlaying),
  j: () => nextPlace(1),
  J: () => nextPlace(-1),
  f: seeAll,
  Escape: () => choose(null),
  ",": () => isFramed && nextFrame(-1),
  ".": () => isFramed && nextFrame(1),
};
const VIEW_KEYS = {
  ArrowLeft: () => view.turn(-0.1, 0),
  ArrowRight: () => view.turn(0.1, 0),
  ArrowUp: () => view.turn(0, 0.1),
  ArrowDown: () => view.turn(0, -0.1),
  "+": () => view.turn(0, 0, 0.9),
  "=": () => view.turn(0, 0, 0.9),
  "-": () => view.turn(0, 0, 1 / 0.9),
};
function press(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const { target, key } = event;
  // Buttons, lists and switches take these keys themselves.
  const isTaken = target.tagName === "SELECT" || (key === " " && /^(BUTTON|INPUT|SUMMARY)$/.test(target.tagName));
  const act = target.id === "view" ? (VIEW_KEYS[key] ?? KEYS[key]) : KEYS[key];
  if (isTaken || !act) return;
  event.preventDefault();
  act();
}
if (isLow() || isUpright()) {
  // All are closed, and of several with one name only one is open.
  for (const details of document.querySelectorAll("details")) Object.assign(details, { open: false, name: "side" });
}

// Once the module is loaded. Throws where there is no WebGL.
export function begin() {
  view = new View(element("view"), onView);
  followLink();
  window.addEventListener("keydown", press);
  window.addEventListener("hashchange", followLink);
  const panels = new ResizeObserver(leaveRoom);
  for (const id of ["answer", "side", "controls"]) panels.observe(element(id));
  requestAnimationFrame(frame);
  void useAdapter();
}

// WebGPU starts by itself on hardware. A software adapter is slower than the CPU build, so it waits for its switch.
async function useAdapter() {
  const adapter = await lookForAdapter();
  element("gpu-label").hidden = adapter === null;
  useGpu.checked = adapter === "hardware";
  if (useGpu.checked) void openGpu();
}

// For tests, and for the console.
window.page = {
  get view() { return view; },
  goTo,
  get bodies() { return bodies; },
  get rows() { return rows; },
  get places() { return places; },
  get step() { return step; },
};
