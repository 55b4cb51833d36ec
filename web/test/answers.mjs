// Answers the scenes with the installed package. package.mjs runs this file in Node and imports it in a page.

function addAll(scene, bodies) {
  for (const { corners, index, positions, end } of bodies) {
    const kind = corners === 4 ? "tetrahedra" : "faces";
    const body = scene.add({ [kind]: Uint32Array.from(index), positions: Float32Array.from(positions) });
    scene.setEndPositions(body, Float32Array.from(end));
  }
}

function mustBe(is, text) {
  if (!is) throw new Error(text);
}

// Pairs of different bodies are the rows of all pairs whose bodies differ, and parts of an answer are its rows.
function mustFit(all, between, scene) {
  const rows = [...all].filter(([a, , b]) => a !== b);
  mustBe(String(rows) === String([...between]), `${between.length} pairs of different bodies, not ${rows.length}`);
  let n = 0;
  for (const a of scene.bodies) {
    n += all.selfOf(a).length / 2;
    for (const b of scene.bodies.filter((b) => b > a)) n += all.between(a, b).length / 2;
    const hit = new Set([...all].flatMap(([c, i, d, j]) => [[c, i], [d, j]]).filter(([c]) => c === a).map(([, i]) => i));
    mustBe(all.colliding(a).length === hit.size, `${hit.size} elements of ${a} are in a pair`);
  }
  mustBe(n === all.length, `${n} pairs by bodies, not ${all.length}`);
}

export async function cpu(module, scenes) {
  const { default: init, Detector, Scene } = await import(module);
  await init();
  const answers = [];
  for (const { name, sharedVertex, bodies } of scenes) {
    // "resolve" is what a query does unless it is told.
    const query = sharedVertex === "resolve" ? {} : { sharedVertex };
    const scene = new Scene();
    addAll(scene, bodies);
    for (const method of ["auto", "clusters", "cells"]) {
      const detector = new Detector({ method });
      const pairs = detector.detect(scene, query);
      mustFit(pairs, detector.detect(scene, { ...query, which: "between" }), scene);
      mustBe(detector.count(scene, query) === pairs.length && detector.any(scene, query), "count and any");
      const impacts = detector.impacts(scene);
      const { kind, toi } = [...impacts].find(({ atStart }) => !atStart);
      const first = { kind, toi };
      answers.push({ name, pairs: pairs.length, hash: pairs.hash, impacts: impacts.length, impactsHash: impacts.hash, first });
      detector.dispose();
    }
    scene.dispose();
  }
  return answers;
}

export async function webgpu(module, scenes, method) {
  const { default: init, Detector, Scene } = await import(module);
  await init();
  const answers = [];
  for (const { name, sharedVertex, bodies } of scenes) {
    const detector = await Detector.open({ method });
    const scene = new Scene();
    addAll(scene, bodies);
    const query = { sharedVertex };
    // Nothing is awaited: questions keep their order, and each is about the scene as it was.
    const asked = [detector.detect(scene, query), detector.detect(scene, { ...query, which: "between" }), detector.count(scene, query)];
    const steps = [detector.impacts(scene), detector.isFree(scene)];
    const before = scene.bodies.map((body) => scene.positions(body));
    for (const body of scene.bodies) scene.setPositions(body, before[body].map((x) => x + 1000 * body));
    const [pairs, between, n] = await Promise.all(asked);
    const [impacts, isFree] = await Promise.all(steps);
    const { stats } = pairs;
    mustBe(stats.backend !== "cpu" && stats.method === method, `answered by ${stats.backend} with ${stats.method}`);
    mustFit(pairs, between, scene);
    mustBe(n === pairs.length && !isFree, "count and isFree");
    // Questions that failed leave the stats of those that were answered.
    const last = detector.stats;
    const failed = [await refusal(() => detector.detect(scene, { between: [0, 99] })), await refusal(() => detector.near(scene, -1))];
    mustBe(failed.every((text) => text.startsWith("invalid: ")) && detector.stats === last, `stats of a failed question, ${failed}`);
    await detector.dispose();
    answers.push({ name, pairs: pairs.length, hash: pairs.hash, impacts: impacts.length, impactsHash: impacts.hash });
  }
  return answers;
}

// How many copies of scenes the module holds: after a question is asked while another one is answered, once its signal is aborted, and after it was
// refused.
export async function copies() {
  const { default: init, Detector, Scene, read } = await import("./node_modules/impinge/webgpu.js");
  const { SceneHandle: { prototype } } = await import("./node_modules/impinge/gpu/impinge.js");
  await init();
  const held = new Set();
  const { snapshot, __destroy_into_raw: destroy } = prototype;
  prototype.snapshot = function () {
    const copy = snapshot.call(this);
    held.add(copy);
    return copy;
  };
  prototype.__destroy_into_raw = function () {
    held.delete(this);
    return destroy.call(this);
  };
  const sizes = [];
  const [detector, scene] = [await Detector.open(), new Scene()];
  scene.add(read("triangle.obj", new TextEncoder().encode("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")));
  for (const question of ["count", "isFree"]) {
    const first = detector.count(scene);
    const controller = new AbortController();
    const { signal } = controller;
    const asked = [refusal(() => detector[question](scene, { signal })), refusal(() => detector[question](scene, { signal: AbortSignal.abort() }))];
    sizes.push(held.size);
    controller.abort();
    sizes.push(held.size, await first, ...(await Promise.all(asked)), held.size);
    sizes.push(await refusal(() => detector[question](scene, { between: [0, 9] })), held.size);
  }
  const last = detector.dispose();
  for (const question of ["count", "isFree"]) sizes.push(await refusal(() => detector[question](scene)), held.size);
  await last;
  Object.assign(prototype, { snapshot, __destroy_into_raw: destroy });
  return sizes;
}

const CANCELLED = ["cancelled: cancelled", "cancelled: cancelled", 0];
const GONE = ["invalid: this detector has been disposed of", 0];
const UNKNOWN = ["invalid: there is no body 9: 1 have been added, and 0 of them removed", 0];

export const COPIES = [2, 1, 0, ...CANCELLED, ...UNKNOWN, 2, 1, 0, ...CANCELLED, ...UNKNOWN, ...GONE, ...GONE];

// Where a mesh from a file meets itself.
function found({ Detector, Scene }, { faces, tetrahedra, positions }) {
  const [detector, scene] = [new Detector(), new Scene()];
  const selfOf = scene.add({ faces, tetrahedra, positions });
  const { length: pairs, hash } = detector.detect(scene, { selfOf });
  detector.dispose();
  scene.dispose();
  return { pairs, hash };
}

// The text of the error that a call throws, or of its rejection; of those of the package with their code.
async function refusal(call) {
  try {
    await call();
  } catch (error) {
    return `${error.code ?? error.constructor.name}: ${error.message}`;
  }
  return "nothing was refused";
}

// What another window has, in Node another context.
async function otherWindow() {
  if (globalThis.document) return document.body.appendChild(document.createElement("iframe")).contentWindow;
  const { runInNewContext } = await import("node:vm");
  return runInNewContext("globalThis");
}

const TRIANGLE = [0, 0, 0, 1, 0, 0, 0, 1, 0];

// Calls that must be refused, and what they say.
export async function refusals(module) {
  const { default: init, Detector, ImpingeError, Scene, weld } = await import(module);
  const said = {};
  said.early = await refusal(() => new Detector());
  await init();
  const [detector, scene] = [new Detector(), new Scene()];
  const index = new Uint16Array([0, 1, 2]);
  const triangle = new Float64Array(TRIANGLE);
  const a = scene.addTriangles(index, triangle);
  const ask = (question, ...rest) => refusal(() => detector[question](scene, ...rest));
  said.number = await refusal(() => scene.setPositions(a, new Float32Array([0, 0, NaN, 1, 0, 0, 0, 1, 0])));
  said.index = await refusal(() => scene.addTriangles(new Uint32Array([0, 1, 7]), triangle));
  said.ragged = await refusal(() => scene.addTriangles(index, triangle.subarray(1)));
  said.plain = await refusal(() => scene.addTriangles([0, 1, 2], triangle));
  said.list = await refusal(() => scene.addPoints([...triangle]));
  said.kinds = await refusal(() => scene.add({ faces: index, edges: index, positions: triangle }));
  said.mesh = await refusal(() => scene.add({ index, positions: triangle }));
  said.matrix = await refusal(() => scene.setTransform(a, [1, 0, 0]));
  said.thickness = await refusal(() => scene.setThickness(a, -1));
  said.unknown = await ask("detect", { selfOf: 4 });
  said.wrong = await ask("detect", { between: [a, "b"] });
  said.few = await ask("detect", { between: "b" });
  said.two = await ask("detect", { between: [a] });
  said.self = await ask("detect", { between: [a, a] });
  said.method = await refusal(() => new Detector({ method: "octree" }));
  said.setting = await refusal(() => new Detector({ metod: "cells" }));
  said.settings = await refusal(() => new Detector(5));
  said.query = await ask("detect", 5);
  said.fixed = await ask("safeDistances", 1, { fixed: a });
  said.exclude = await ask("detect", { exclude: [a, a] });
  said.ring = await ask("detect", { exclude: [{ ring: 1 }] });
  said.rings = await ask("detect", { exclude: { rings: 2 } });
  said.answer = await ask("detect", { exclude: [detector.near(scene, 1)] });
  said.matrix4 = await refusal(() => scene.setTransform(a, { elements: Array(16).fill(0) }));
  said.filter = await refusal(() => scene.setFilter(a, 2n ** 64n));
  said.pinned = await refusal(() => scene.setPinned(a, ["no", "no", "no"]));
  said.pinnedNumbers = await refusal(() => scene.setPinned(a, [2, 1, 0]));
  said.nothing = await refusal(() => scene.add());
  said.arrays = await refusal(() => scene.add(triangle, index));
  said.forgotten = await refusal(() => scene.add({ faces: undefined, positions: triangle }));
  said.welded = await refusal(() => weld({ faces: undefined, positions: triangle }));
  said.within = await ask("detect", { progress: () => detector.count(scene) });
  said.margin = await refusal(() => new Detector({ reuseMargin: -1 }));
  said.limits = [];
  for (const of of [{ reuseMargin: Infinity }, { maxPairs: 0.5 }, { memoryBudget: -1 }]) said.limits.push(await refusal(() => new Detector(of)));
  new Detector({ maxPairs: Infinity, memoryBudget: Infinity }).dispose();
  said.clearance = await ask("impacts", { clearance: -1 });
  said.start = await ask("isFree", { start: "never" });
  said.field = await ask("earliest", { selfOf: a, seperation: 5 });
  said.which = await ask("impacts", { which: "none" });
  said.both = await ask("impacts", { which: "self", of: a });
  said.separation = await ask("impacts", { separation: NaN });
  said.text = await ask("near", "1");
  said.endless = await ask("near", Infinity);
  said.inflation = await ask("candidates", -1);
  said.control = await ask("distance", a, a, { start: "skip" });
  said.scene = await refusal(() => detector.detect({}));
  said.pairs = await ask("contacts", []);
  said.kind = await refusal(() => detector.near(scene, 1).of("fv"));
  // Which pairs: a question that cannot honour an option says so. All others give an answer.
  const which = { kinds: ["ef"], sharedVertex: "skip", exclude: [[a, a]], ownedBy: [[0, 0, 0], [1, 1, 1]], which: "between", of: a };
  const questions = { detect: [], count: [], any: [], impacts: [], earliest: [], isFree: [], advance: [], candidates: [0], near: [0] };
  said.options = {};
  for (const [question, rest] of Object.entries(questions)) {
    for (const [option, value] of Object.entries(which)) {
      const text = await ask(question, ...rest, { [option]: value });
      if (text !== "nothing was refused") said.options[`${question} ${option}`] = text.replace(/ given.*/, "");
    }
  }
  // Signals and progress.
  const reason = new Error("enough");
  said.aborted = await ask("detect", { signal: AbortSignal.abort(reason) });
  said.reason = await refusal(() => {
    try {
      detector.distance(scene, a, a, { signal: AbortSignal.abort(reason) });
    } catch (error) {
      throw error instanceof ImpingeError ? error.cause : error;
    }
  });
  said.signal = await ask("detect", { signal: true });
  said.closest = await ask("closest", triangle, { which: "self" });
  said.text16 = await refusal(() => scene.setTransform(a, "1000010000100001"));
  said.texts = await refusal(() => scene.setTransform(a, Array(16).fill("1")));
  said.big = await refusal(() => scene.setTransform(a, new BigInt64Array(16)));
  said.thick = await refusal(() => scene.setThickness(a, ["1", null, [2]]));
  const away = new Float32Array(9);
  structuredClone(away, { transfer: [away.buffer] });
  said.away = [];
  for (const call of ["setThickness", "setPositions", "setTransform", "setPinned"]) said.away.push(await refusal(() => scene[call](a, away)));
  said.away.push(await refusal(() => scene.addPoints(away)), await ask("closest", away));
  // What is freed while a question is answered.
  const rest = scene.restPairs(1);
  said.held = [];
  const early = [() => scene.dispose(), () => detector.dispose(), () => rest.dispose(), () => scene.setPositions(a, triangle)];
  const freed = (said) => {
    for (const call of early) {
      try {
        said.push(call() ?? "nothing was refused");
      } catch (error) {
        said.push(`${error.constructor === ImpingeError}, ${error.code}`);
      }
    }
    return false;
  };
  detector.near(scene, 1);
  const { stats } = detector;
  said.near = await ask("near", 1, { progress: () => (said.held.length > 0 ? undefined : freed(said.held)) });
  const second = scene.addTriangles(index, triangle);
  said.heldInRuns = [];
  const within = [];
  detector.candidatesInRuns(scene, 1, () => { within.push(detector.stats === stats); return freed(said.heldInRuns); });
  said.usable = [scene.positions(a).length, detector.near(scene, 1, { of: a }).length > 0, rest.dispose() === undefined, String(within)];
  // Stats are those of what was answered last.
  const { stats: last } = detector;
  said.failed = [await ask("near", -1), detector.stats === last, new Detector().stats.totalMs];
  // Changes of all beside those of one kind; contacts, and a step, whose bodies are others now.
  const all = detector.near(scene, 1);
  scene.setEndPositions(second, triangle.map((x) => x + 1));
  const impacts = detector.impacts(scene);
  said.changes = [all, impacts].map((list) => [list.changes(list.of("vf")), list.of("vf").changes(list)].map(({ kept }) => kept.length / 2));
  said.changes.push(all.of("vf").length, impacts.of("vf").length);
  // After edges were set, unless they are the same, and of another scene.
  const sameKept = (list, old) => list.changes(old).kept.length / 2 === old.length;
  const ownEdges = scene.edges(second);
  scene.setEdges(second, ownEdges.slice());
  said.numbers = [sameKept(detector.near(scene, 1), all)];
  scene.setEdges(second, Uint32Array.of(...ownEdges.slice(2), ...ownEdges.slice(0, 2)));
  said.numbers.push(await refusal(() => detector.near(scene, 1).changes(all)), sameKept(detector.near(scene, 1).of("vf"), all.of("vf")));
  scene.setEdges(second, null);
  const detected = detector.detect(scene);
  scene.remesh(second, { positions: triangle, faces: index });
  said.numbers.push(await refusal(() => detector.near(scene, 1).of("vf").changes(all.of("vf"))), await refusal(() => detector.detect(scene).changes(detected)));
  scene.setEndPositions(second, triangle.map((x) => x + 1));
  said.numbers.push(await refusal(() => detector.impacts(scene).changes(impacts)));
  const elsewhere = new Scene();
  for (let n = 0; n < 2; n += 1) elsewhere.addTriangles(index, triangle);
  said.numbers.push(await refusal(() => detector.near(elsewhere, 1).changes(all)));
  elsewhere.dispose();
  const corners = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
  const closed = [0, 0.125].map((by) => scene.addTriangles(new Uint8Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]), corners.map((x) => x + by)));
  const older = detector.contacts(scene, detector.detect(scene, { between: closed }));
  detector.contacts(scene, detector.detect(scene, { between: closed }));
  const depth = () => refusal(() => detector.penetration(scene, older, ...closed));
  said.older = [await depth()];
  scene.setPositions(closed[1], corners.map((x) => x + 0.25));
  said.older.push(await depth());
  const pairs = detector.detect(scene, { between: closed });
  scene.setPositions(closed[0], corners);
  const late = detector.contacts(scene, pairs);
  said.older.push(await refusal(() => detector.penetration(scene, late, ...closed)));
  const other = new Scene();
  const two = closed.map(() => other.addTriangles(index, triangle));
  said.older.push(await refusal(() => detector.penetration(other, older, ...two)), await refusal(() => detector.contacts(other, pairs)));
  scene.setPositions(closed[1], corners.map((x) => x + 0.125));
  const inCell = detector.contacts(scene, detector.detect(scene, { between: closed, ownedBy: [[-1, -1, -1], [1, 1, 1]] }));
  said.older.push(await refusal(() => detector.penetration(scene, inCell, ...closed)));
  const whole = detector.contacts(scene, detector.detect(scene, { between: closed }));
  scene.setPinned(closed[0], Array(4).fill(true));
  said.older.push(await refusal(() => detector.penetration(scene, whole, ...closed)));
  scene.setPinned(closed[0], Array(4).fill(false));
  const step = detector.advance(scene);
  for (const body of closed) scene.remove(body);
  const added = scene.addTriangles(index, triangle);
  said.added = await refusal(() => step.apply(scene));
  for (const body of [second, added]) scene.remove(body);
  // The refused calls left it as it was.
  const b = scene.addTriangles(new Uint8Array([0, 1, 2]), Float32Array.from(triangle));
  said.found = [...detector.detect(scene, { between: [a, b] }).rows];
  scene.setPositions(b, triangle.map((x) => x + 4));
  said.apart = detector.any(scene);
  const least = await refusal(() => new Detector({ memoryBudget: 1 }).detect(scene));
  said.budget = least.replace(/, but.*/, "");
  scene.setPositions(b, triangle);
  scene.addTriangles(index, triangle);
  const most = await refusal(() => new Detector({ maxPairs: 1 }).detect(scene));
  said.most = most.replace(/ \d pairs/, " pairs");
  scene.dispose();
  said.gone = await ask("detect");
  detector.dispose();
  said.disposed = await ask("detect");
  return said;
}

export const REFUSALS = {
  early: "invalid: impinge is not loaded yet: await init() first",
  number: "invalid: body 0: vertex 0 has a non-finite position (0, 0, NaN)",
  index: "invalid: body 1: element 0 names vertex 7, but there are 3 vertices",
  ragged: "invalid: positions: 8 numbers given, not a multiple of 3",
  plain: "invalid: index: an Array given, a Uint32Array, a Uint16Array or a Uint8Array is needed",
  list: "invalid: positions: an Array given, a Float32Array or a Float64Array is needed",
  kinds: "invalid: mesh: elements of several kinds given, one of faces, tetrahedra and edges allowed",
  mesh: 'invalid: mesh: "index" given, positions, faces, tetrahedra or edges allowed',
  matrix: "invalid: transform: 3 numbers given, 16 numbers allowed, column by column, as elements of a Matrix4",
  thickness: "invalid: thickness: -1 given, a finite number that is not below 0 allowed",
  unknown: "invalid: there is no body 4: 1 have been added, and 0 of them removed",
  wrong: 'invalid: body: "b" given, a number that a scene returned is needed',
  few: 'invalid: between: "b" given, two bodies are needed',
  two: "invalid: between: 0 given, two bodies are needed",
  self: "invalid: between: body 0 given twice, selfOf: 0 asks for its self-collision",
  method: 'invalid: method: "octree" given, "auto", "clusters", "cells" or "naive" allowed',
  setting: 'invalid: settings: "metod" given, method, recluster, memoryBudget, maxPairs or reuseMargin allowed',
  settings: "invalid: settings: 5 given, an object is needed",
  query: "invalid: query: 5 given, an object is needed",
  fixed: "invalid: fixed: 0 given, an array is needed",
  exclude: "invalid: exclude: 0 given, as in [[a, b]] an array of two bodies or an object is needed",
  ring: 'invalid: exclude: "ring" given, rings or groups allowed',
  rings: "invalid: exclude: an Object given, an array is needed",
  answer: "invalid: exclude: a NearPairs given, an answer; scene.restPairs() finds pairs that are left out",
  matrix4: "invalid: transform: an Object given, 16 numbers allowed, column by column, as elements of a Matrix4",
  filter: "invalid: category: 18446744073709551616n given, a whole number of 64 bits is needed",
  pinned: 'invalid: pinned: "no" given, true or false is needed',
  pinnedNumbers: "invalid: pinned: 2 given, true or false is needed",
  nothing: "invalid: mesh: undefined given, an object with positions is needed, as in { positions, faces }",
  arrays: "invalid: mesh: a Float64Array given, an object with positions is needed, as in { positions, faces }",
  forgotten: "invalid: faces: undefined given; a geometry without an index has the faces 0, 1, 2, 3, …, and points have no faces",
  welded: "invalid: faces: undefined given; a geometry without an index has the faces 0, 1, 2, 3, …, and points have no faces",
  within: "invalid: a scene or a detector is used while it answers a question, or after the module has stopped",
  margin: "invalid: reuseMargin: -1 given, a finite number that is not below 0 allowed",
  limits: [
    "invalid: reuseMargin: Infinity given, a finite number that is not below 0 allowed",
    "invalid: maxPairs: 0.5 given, 0 to 9007199254740991 or Infinity allowed",
    "invalid: memoryBudget: -1 given, 0 to 9007199254740991 or Infinity allowed",
  ],
  clearance: "invalid: clearance: -1 given, a finite number that is not below 0 allowed",
  start: 'invalid: start: "never" given, "report", "skip" or "verify" allowed',
  field:
    'invalid: query: "seperation" given, which, between, selfOf, of, kinds, sharedVertex, exclude, ownedBy, start, separation, clearance, ' +
    "clearanceShare, precision, distances, closestPoints, fixed, hits, nNearest, most, signal or progress allowed",
  which: 'invalid: which: "none" given, "all", "between" or "self" allowed',
  both: 'invalid: query: "which" and "of" given, one of them allowed',
  separation: "invalid: separation: NaN given, a finite number that is not below 0 allowed",
  text: 'invalid: distance: "1" given, a number is needed',
  endless: "invalid: distance: Infinity given, a finite number that is not below 0 allowed",
  inflation: "invalid: inflation: -1 given, a finite number that is not below 0 allowed",
  control: 'invalid: control: "start" given, signal or progress allowed',
  scene: "invalid: scene: a Scene of the same module is needed",
  pairs: "invalid: pairs: what detect() returned is needed",
  kind: 'invalid: kind: "fv" given, "vf", "ee", "ev", "vv", "ef" or "ff" allowed',
  options: {
    "detect kinds": "invalid: kinds: kinds of pairs of vertices, edges and faces",
    "count kinds": "invalid: kinds: kinds of pairs of vertices, edges and faces",
    "any kinds": "invalid: kinds: kinds of pairs of vertices, edges and faces",
    "impacts kinds": "invalid: kinds: ef",
    "earliest kinds": "invalid: kinds: ef",
    "isFree kinds": "invalid: kinds: ef",
    "advance kinds": "invalid: kinds: ef",
    "advance ownedBy": "invalid: ownedBy: a cell for the way that a step can be taken",
  },
  aborted: "cancelled: cancelled",
  reason: "Error: enough",
  signal: "invalid: signal: an AbortSignal is needed",
  closest: "invalid: query: pairs of two bodies, or self-collision given, all bodies, or one by `of` allowed",
  text16: "invalid: transform: a string given, 16 numbers allowed, column by column, as elements of a Matrix4",
  texts: 'invalid: transform: "1" given, a number is needed',
  big: "invalid: transform: 0n given, a number is needed",
  thick: 'invalid: thickness: "1" given, a number is needed',
  away: ["thickness", "positions", "transform", "pinned", "positions", "positions"].map((name) => `invalid: ${name}: a Float32Array given whose memory was given away`),
  held: Array(4).fill("true, invalid"),
  near: "cancelled: cancelled",
  heldInRuns: Array(4).fill("true, invalid"),
  usable: [9, true, true, "true"],
  failed: ["invalid: distance: -1 given, a finite number that is not below 0 allowed", true, 0],
  changes: [[6, 6], [6, 6], 6, 6],
  numbers: [
    true,
    "invalid: body 1: the pairs were found before it was re-meshed or its edges were set, and name other elements",
    true,
    ...Array(3).fill("invalid: body 1: the pairs were found before it was re-meshed or its edges were set, and name other elements"),
    "invalid: old: an answer about another scene given, those about the same scene allowed",
  ],
  older: [
    "nothing was refused",
    "invalid: body 3: this was found for other positions than it has now, so nothing is known of it; ask again",
    "invalid: body 2: this was found for other positions than it has now, so nothing is known of it; ask again",
    "invalid: contacts: contacts of another scene given, those of this scene allowed",
    "invalid: pairs: pairs of another scene given, those of this scene allowed",
    "invalid: contacts: without some of the two, because of a cell, given, those of all pairs of the two allowed",
    "invalid: body 2: its groups or pinned vertices were set after the pairs were found; ask again",
  ],
  added: "invalid: body 4: it was added after this was found, so nothing is known of it; ask again",
  found: [0, 0, 5, 0],
  apart: false,
  budget: "budget: the memory budget is 1 bytes",
  most: "too_many_pairs: pairs and more were found, and at most 1 are allowed",
  gone: "invalid: this scene has been disposed of",
  disposed: "invalid: this detector has been disposed of",
};

// A triangle whose edge is inside another, and a third that falls on both; and a welded seam.
export async function steps(module) {
  const { default: init, Detector, Scene, weld } = await import(module);
  await init();
  const [detector, scene] = [new Detector(), new Scene()];
  const index = new Uint8Array([0, 1, 2]);
  const flat = scene.addTriangles(index, new Float32Array(TRIANGLE));
  const across = scene.addTriangles(index, new Float32Array([0.25, 0.25, -1, 0.25, 0.25, 1, 2, 2, 0]));
  const start = "verify";
  const unasked = [detector.impacts(scene).startIntersects, detector.isFree(scene)];
  const asked = [detector.impacts(scene, { start }).startIntersects, detector.isFree(scene, { start })];
  const { fraction: stuck, startIntersects, first: none } = detector.advance(scene, { start });
  const clean = detector.impacts(scene, { selfOf: flat, start }).startIntersects;
  scene.remove(across);
  const falling = scene.addTriangles(index, new Float64Array([0.25, 0.25, 1, 0.5, 0.25, 2, 0.25, 0.5, 2]));
  scene.setEndPositions(falling, new Float64Array([0.25, 0.25, -1, 0.5, 0.25, 0, 0.25, 0.5, 0]));
  const { toi } = detector.earliest(scene, { precision: "f64", clearance: 0.5, clearanceShare: 0.75 });
  const advance = detector.advance(scene, { start, precision: "f64", clearance: 10, clearanceShare: 0.25 });
  const { first, nTried, fraction } = advance;
  const height = advance.positions(falling)[2];
  advance.apply(scene);
  const still = detector.isFree(scene);
  // Two triangles that share an edge, with its vertices repeated; the second in another frame.
  const seam = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1, -0, 1, 1, 0]);
  const { mesh, map, positions } = weld({ positions: seam, faces: new Uint16Array([0, 1, 2, 3, 5, 4]), edges: new Uint8Array([1, 9]) });
  const moved = positions(Float64Array.from(seam, (x) => x + 1));
  detector.dispose();
  scene.dispose();
  return {
    unasked,
    asked,
    stuck: [stuck, startIntersects, none],
    clean,
    toi,
    // With a clearance the time has a margin for rounding.
    first: [first.kind, first.bodyA, first.bodyB, first.toi > 0.37 && first.toi <= 0.375],
    isTried: nTried > 0,
    reached: [fraction > 0.37 && fraction <= 0.375, Math.abs(height - (1 - 2 * fraction)) < 1e-9],
    others: [advance.startIntersects, advance.positions(flat), still],
    welded: [...mesh.positions],
    faces: [...mesh.faces],
    edges: [...mesh.edges],
    isSolid: "tetrahedra" in mesh,
    map: [...map],
    moved: [moved.constructor.name, ...moved],
    short: await refusal(() => positions(seam.subarray(3))),
    ragged: await refusal(() => weld({ positions: seam.subarray(1) })),
    misspelt: await refusal(() => weld({ positions: seam, index: new Uint8Array(3) })),
  };
}

export const STEPS = {
  unasked: [null, true],
  asked: [true, false],
  stuck: [0, true, null],
  clean: false,
  toi: 0.25,
  first: ["vf", 2, 0, true],
  isTried: true,
  reached: [true, true],
  others: [false, null, true],
  welded: [0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0],
  faces: [0, 1, 2, 1, 3, 2],
  edges: [1, 9],
  isSolid: false,
  map: [0, 1, 2, 1, 2, 3],
  moved: ["Float64Array", 1, 1, 1, 2, 1, 1, 1, 2, 1, 2, 2, 1],
  short: "invalid: positions: 15 numbers given for a weld of 6 vertices",
  ragged: "invalid: positions: 17 numbers given, not a multiple of 3",
  misspelt: 'invalid: mesh: "index" given, positions, faces, tetrahedra or edges allowed',
};

// A strand and points above a triangle, and two tetrahedra as closed surfaces of which one's tip is in the other. The scene is that of
// either module, and so is the detector: each answer is awaited.
export async function others(module) {
  const { default: init, Detector, Scene, weld } = await import(module);
  await init();
  const detector = Detector.open ? await Detector.open() : new Detector();
  let scene = new Scene();
  const index = new Uint8Array([0, 1, 2]);
  const flat = scene.addTriangles(index, new Float32Array(TRIANGLE));
  const strand = scene.addEdges(new Uint8Array([0, 1]), new Float32Array([0.25, 0.25, 1, 0.25, 0.25, 2]));
  const cloud = scene.addPoints(new Float64Array([5, 5, 5, 0.5, 0.25, 3]));
  const near = await detector.near(scene, 1, { which: "between", closestPoints: true });
  const [pair] = near;
  const candidates = await detector.candidates(scene, 0.5, { kinds: ["vf", "ee"] });
  const nearest = await detector.distance(scene, strand, flat);
  const isFree = () => detector.isFree(scene, { between: [flat, strand] });
  const kept = [await isFree()];
  scene.setThickness(strand, 1);
  kept.push(await isFree());
  const thick = await detector.near(scene, 0, { between: [flat, strand] });
  scene.setTransform(cloud, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -3, 1]);
  const onFlat = [...(await detector.detect(scene)).rows];
  const [now, rest] = [scene.positions(cloud)[5], scene.restPositions(cloud)[5]];
  scene.setEndTransform(cloud, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1]);
  const turned = [scene.endPositions(cloud)[5], await refusal(() => scene.setEndTransform(cloud, [1]))];
  scene.setEndPositions(cloud, null);
  scene.setFilter(cloud, 2, 2n);
  const filtered = await detector.any(scene, { which: "between" });
  scene.setFilter(cloud);
  const excluded = await detector.count(scene, { exclude: [[flat, cloud]] });
  scene.remesh(cloud, { edges: new Uint8Array([0, 1]), positions: new Float32Array([0, 0, -1, 0.5, 0.5, 1]) });
  const described = [scene.kind(cloud), scene.nElements(cloud), scene.nVertices(cloud), [...scene.elements(cloud)], [...scene.edges(flat)]];
  scene.setEndPositions(strand, new Float32Array(6));
  const end = [scene.endPositions(strand)?.length, scene.endPositions(flat)];
  scene.setEndPositions(strand, null);
  end.push(scene.endPositions(strand));
  scene.dispose();
  scene = new Scene();
  const faces = new Uint8Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
  const solid = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]);
  const low = scene.addTriangles(faces, solid);
  const tip = scene.addTriangles(faces, solid.map((x, ix) => x + [0.1, 0.125, -0.875][ix % 3]));
  const pairs = await detector.detect(scene);
  const contacts = await detector.contacts(scene, pairs);
  const [curves, [region]] = [contacts.curves(), contacts.regions()];
  const penetration = await detector.penetration(scene, contacts, tip, low);
  const [deep] = penetration.regions;
  const none = await detector.contacts(scene, await detector.detect(scene, { which: "self" }));
  // Points and rays; the scene is that of the two solids.
  const points = new Float32Array([0.125, 0.125, 0.125, 0, 0, 0.5, 3, 0, 0, 0.25, 0.25, 1]);
  const places = [...(await detector.contains(scene, low, points))];
  const closest = await detector.closest(scene, points, { of: low, most: 1 });
  const far = await detector.closest(scene, Float64Array.from(points));
  const origins = new Float64Array([0.125, 0.25, 4, 5, 5, 5]);
  const down = new Float64Array([0, 0, -1, 0, 0, -1]);
  const hits = await detector.cast(scene, origins, down, { of: low });
  const all = await detector.cast(scene, origins, down, { hits: "all" });
  const any = await detector.cast(scene, origins, down, { hits: "any", most: 1 });
  const probes = {
    places,
    closest: [closest.length, closest.at(1), closest.at(2), [...closest.features], far.at(-2).body, far.length],
    hits: [hits.length, [...hits.hit], hits.of(0), hits.of(1), hits.hash.length],
    all: [all.of(0).map(({ body, t }) => [body, t > 3]), [...all.offsets], all.t.length, [...any.hit], any.of(0)],
    ragged: await refusal(() => detector.closest(scene, points.subarray(1))),
    list: await refusal(() => detector.contains(scene, low, [0, 0, 0])),
    rays: await refusal(() => detector.cast(scene, origins, down.subarray(3))),
    hit: await refusal(() => detector.cast(scene, origins, down, { hits: "last" })),
    most: await refusal(() => detector.closest(scene, points, { most: -1 })),
    open: await refusal(() => detector.contains(scene, 7, points)),
  };
  // Two triangles, 1 apart, of which the upper one wants to go through the lower one.
  const step = new Scene();
  const [lower, upper] = [0, 1].map((z) => step.addTriangles(index, new (z ? Float64Array : Float32Array)(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? z : x)))));
  const near2 = await detector.nearest(step);
  const nearest3 = [];
  for (const query of [{ which: undefined }, { between: [upper, lower] }]) nearest3.push((await detector.nearest(step, query)).distance);
  for (const query of [{ of: upper }, { which: "self", of: upper }]) nearest3.push(await refusal(() => detector.nearest(step, query)));
  const safe = await detector.safeDistances(step, 9, { which: "between" });
  const held = await detector.safeDistances(step, 9, { which: "between", fixed: [lower] });
  const lists = await detector.neighbours(step, 1.5, { which: "between" });
  const ringed = await detector.near(scene, 9, { selfOf: low, exclude: [{ rings: 1 }] });
  step.setEndPositions(upper, new Float64Array(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? -1 : x))));
  const truncation = await detector.truncate(step, { start: "verify" });
  const reached = truncation.positions(upper)[2];
  truncation.positions(upper).fill(9); // A copy, which is not what is applied.
  truncation.apply(step);
  // What a transform moves: the next one begins at rest, and a step is taken once, in its own scene.
  const rigid = new Scene();
  const flying = rigid.addTriangles(index, new Float32Array(TRIANGLE));
  const raised = (z) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, z, 1];
  const heights = [];
  for (const z of [1, 2, 3]) {
    rigid.setEndTransform(flying, raised(z));
    const way = await (z === 2 ? detector.advance(rigid) : detector.truncate(rigid));
    way.apply(rigid);
    heights.push(rigid.positions(flying)[2], rigid.restPositions(flying)[2]);
  }
  const late = [await refusal(() => truncation.apply(step)), await refusal(() => truncation.apply(rigid)), await refusal(() => truncation.apply({}))];
  const still2 = rigid.positions(flying)[2];
  rigid.dispose();
  const solver = {
    nearest: [near2.distance, near2.bodyA, near2.bodyB, ...nearest3],
    safe: [safe.of(lower).constructor.name, safe.of(upper).constructor.name, safe.of(lower)[0] < 0.5 && safe.of(lower)[0] > 0.4995, safe.touching.length],
    held: [[...held.of(lower)], held.of(upper)[0] < 1 && held.of(upper)[0] > 0.999],
    lists: [lists.length, lists.first(upper), [...lists.vf.offsets], [...lists.vf.indices], [...lists.fv.indices], lists.ee.distances.every((x) => x > 0.999)],
    same: lists.ee === lists.reversed("ee"),
    ringed: ringed.length,
    truncation: [truncation.nCut, truncation.nTouching, truncation.rounds > 0, truncation.startIntersects, truncation.positions(lower)],
    stopped: [truncation.pairs.length > 0, truncation.pairs.rows.length / 4 === truncation.pairs.length, [...truncation.pairs].every(({ bodyA, bodyB }) => bodyA !== bodyB && [lower, upper].includes(bodyA))],
    rigid: [...heights, still2],
    late,
    reached: [reached > 0 && reached < 0.01, step.positions(upper)[2] === reached, await detector.any(step)],
    rings: await refusal(() => detector.near(scene, 1, { exclude: [{ rings: 17 }] })),
    unknown: await refusal(() => detector.safeDistances(step, 1, { fixed: [5] })),
    body: await refusal(() => safe.of(7)),
  };
  step.dispose();
  // The nearest few elements, and cells.
  const few = await detector.closest(scene, points, { of: low, most: 1, nNearest: 5 });
  const signed = await detector.signedDistance(scene, low, points);
  const corners = new Float64Array([0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, -4]);
  const cells = scene.addTetrahedra(new Uint8Array([0, 1, 2, 3, 0, 2, 1, 4]), corners);
  const held2 = await detector.locate(scene, cells, new Float32Array([1, 1, -1, 1, 1, 0, 3, 3, 3]));
  const nearest5 = {
    few: [few.length, few.nNearest, few.rows.length, few.of(0).map(({ element }) => element), few.of(2), few.of(4), few.at(-2), few.at(1).distance],
    signed: [...signed.subarray(0, 3), signed[3] > -0.289 && signed[3] < -0.288],
    cells: [held2.constructor.name, ...held2],
    wound: [...(await detector.windingNumbers(scene, low, points)).subarray(0, 4)],
    solid: await refusal(() => detector.windingNumbers(scene, cells, points)),
    faces: await refusal(() => detector.locate(scene, low, points)),
    ragged: await refusal(() => detector.locate(scene, cells, points.subarray(1))),
    number: await refusal(() => detector.locate(scene, cells, new Float32Array([0, NaN, 0]))),
    none: await refusal(() => detector.closest(scene, points, { nNearest: 0 })),
    half: await refusal(() => detector.closest(scene, points, { nNearest: 1.5 })),
  };
  scene.remove(cells);
  // What is left out of pairs, and candidates in runs.
  const pile = new Scene();
  const [base, top] = [0, 0.5].map((z) => pile.addTriangles(index, new Float32Array(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? z : x)))));
  const count = async (...exclude) => (await detector.near(pile, 1, { exclude })).length;
  const every = await count();
  pile.setGroups(base, new Uint8Array([1, 1, 1]));
  pile.setGroups(top, new Uint32Array([2, 2, 3]));
  const grouped = await count({ groups: [2, 1] });
  const [atRest, again] = [pile.restPairs(1), pile.restPairs(1)];
  again.dispose();
  again.dispose();
  const left = {
    groups: [grouped > 0 && grouped < every, (await count({ groups: [7, 7] })) === every],
    rest: [atRest.length === every, await count(atRest)],
    foreign: await refusal(() => detector.near(scene, 1, { exclude: [atRest] })),
    disposed: [await refusal(() => count(again)), await count(atRest)],
    one: await refusal(() => count({ groups: [1] })),
    both: await refusal(() => count({ groups: [1, 2], rings: 1 })),
    group: await refusal(() => count({ groups: [1, -1] })),
    misspelt: await refusal(() => count({ ring: 1 })),
    plain: await refusal(() => pile.setGroups(base, [1, 1, 1])),
    short: await refusal(() => pile.setGroups(top, new Uint8Array(2))),
    distance: await refusal(() => pile.restPairs(-1)),
  };
  // Of the two triangles, all pairs with vertex 0 of both, by one list, and by one that lists it twice.
  const [from, listed] = [new Uint8Array([0, 1, 1, 1]), new Uint32Array([0])];
  const sewn = pile.vertexPairs(base, from, listed, top);
  const unsewn = await detector.near(pile, 1, { exclude: [sewn] });
  const twice = pile.vertexPairs(top, new Uint16Array([0, 2, 2, 2]), new Uint32Array([0, 0]), base);
  left.sewn = [sewn.length, twice.length, unsewn.length > 0 && unsewn.length < every, (await count(twice)) === unsewn.length];
  left.own = (await count(pile.vertexPairs(base, from, listed))) === every;
  left.offsets = await refusal(() => count(pile.vertexPairs(base, new Uint8Array([0, 1, 1]), listed, top)));
  left.noVertex = await refusal(() => count(pile.vertexPairs(base, from, new Uint32Array([7]), top)));
  left.nobody = await refusal(() => pile.vertexPairs(base, from, listed, 99));
  left.numbers = await refusal(() => pile.vertexPairs(base, [0, 1, 1, 1], listed));
  sewn.dispose();
  left.forgotten = await refusal(() => count(sewn));
  const whole = await detector.candidates(pile, 1);
  const [runs, lengths] = [[], []];
  const sum = await detector.candidatesInRuns(pile, 1, (run) => { runs.push(...run.rows); lengths.push(run.length); }, { most: 4 });
  left.runs = [sum === whole.length, String(runs) === String([...whole.rows]), lengths.length > 1, Math.max(...lengths)];
  left.stopped = await detector.candidatesInRuns(pile, 1, () => false, { most: 4 });
  left.thrown = await refusal(() => detector.candidatesInRuns(pile, 1, () => { throw new Error("mine"); }));
  left.each = await refusal(() => detector.candidatesInRuns(pile, 1, { most: 4 }));
  left.most = await refusal(() => detector.candidatesInRuns(pile, 1, () => true, { most: 0 }));
  pile.setPinned(base, new Uint8Array([1, 1, 1]));
  left.pinned = [(await count()) === every];
  pile.setPinned(top, [true, true, true]);
  left.pinned.push(await count(), await refusal(() => pile.setPinned(top, [true])));
  // What has changed since an older answer: by pairs, beside what a set of them says.
  pile.setPinned(top, [false, false, false]);
  // From a list, which a small motion leaves as it is.
  const margin = { reuseMargin: 0.5 };
  const listing = Detector.open ? await Detector.open(margin) : new Detector(margin);
  const nearNow = async () => {
    const [found, listed] = [await detector.near(pile, 1), await listing.near(pile, 1)];
    left.listed = (left.listed ?? found.length > 0) && found.hash === listed.hash;
    return found;
  };
  const key = ({ kind, bodyA, elementA, bodyB, elementB }) => [kind, bodyA, elementA, bodyB, elementB].join();
  const keys = (list) => Array.from(list, Array.isArray(list.at(0)) ? String : key);
  const compared = (is, was) => {
    const [before, after] = [keys(was), keys(is)];
    const expected = {
      kept: before.flatMap((name, ix) => (after.includes(name) ? [ix, after.indexOf(name)] : [])),
      new: after.flatMap((name, ix) => (before.includes(name) ? [] : [ix])),
      gone: before.flatMap((name, ix) => (after.includes(name) ? [] : [ix])),
    };
    const found = is.changes(was);
    const sizes = ["kept", "new", "gone"].map((name) => found[name].length > 0);
    return [Object.keys(expected).every((name) => String([...found[name]]) === String(expected[name])), ...sizes];
  };
  const byHeight = (z, body = top) => pile.setPositions(body, new Float32Array(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? (ix > 5 ? z : 0.5) : x))));
  const [first, apart] = [await nearNow(), pile.positions(top)];
  byHeight(0.6);
  await nearNow();
  byHeight(9);
  const second = await nearNow();
  left.changes = [compared(second, first), compared(first, second), compared(first, await nearNow()), compared(second.of("vf"), first.of("vf"))];
  // A body that has the place of the removed one comes before an older body, and has a number of its own.
  pile.setPositions(top, apart);
  pile.remove(base);
  const third = pile.addTriangles(index, new Float32Array(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? 0.25 : x))));
  const fourth = pile.addTriangles(index, new Float32Array(TRIANGLE.map((x, ix) => (ix % 3 === 2 ? 0.75 : x))));
  const fifth = await nearNow();
  byHeight(9);
  left.changes.push(compared(await nearNow(), fifth), compared(fifth, first));
  pile.setPositions(top, new Float32Array([0.2, 0.2, -1, 0.2, 0.2, 1, 0.3, 0.2, 1]));
  const crossed = await detector.detect(pile);
  pile.setPositions(top, new Float32Array([0.2, 0.2, -1, 0.2, 0.2, 0.5, 0.3, 0.2, 0.5]));
  const less = await detector.detect(pile);
  left.changes.push(compared(less, crossed), await refusal(() => less.changes(fifth)));
  pile.setEndPositions(top, apart);
  const moving = await detector.impacts(pile);
  pile.setEndPositions(top, pile.positions(top));
  left.changes.push(compared(await detector.impacts(pile), moving));
  pile.remove(fourth);
  pile.setPositions(top, apart);
  const below = third;
  // The caller's numbers of edges: the same edges, the other way round.
  const rowsOf = (numbers) => { const list = []; for (let ix = 0; ix < numbers.length; ix += 4) list.push(numbers.slice(ix, ix + 4)); return list; };
  const edgesBefore = pile.edges(top), nEdges = edgesBefore.length / 2;
  const touching = async () => rowsOf([...(await detector.near(pile, 1, { kinds: ["ee"], between: [below, top] })).rows]);
  const named = await touching();
  pile.setEdges(top, edgesBefore.slice().reverse());
  const renamed = (await touching()).map(([a, ea, b, eb]) => (a === top ? [a, nEdges - 1 - ea, b, eb] : [a, ea, b, nEdges - 1 - eb]));
  left.edges = [
    String([...pile.edges(top)]) === String([...edgesBefore].reverse()), named.length > 0, String(renamed.map(String).sort()) === String(named.map(String).sort()),
    await refusal(() => pile.setEdges(top, new Uint16Array([0, 1, 1, 2, 0, 1]))),
    await refusal(() => pile.setEdges(top, [0, 1])),
  ];
  pile.setEdges(top, null);
  left.edges.push(String(pile.edges(top)) === String(edgesBefore), String(await touching()) === String(named));
  pile.dispose();
  let n = 0;
  let stopped = null;
  try {
    await detector.near(scene, 1, { progress: () => ((n += 1), false) });
  } catch ({ code }) {
    stopped = code;
  }
  const controller = new AbortController();
  const aborted = await refusal(() => detector.impacts(scene, { signal: controller.signal, progress: () => controller.abort() }));
  const thrown = await refusal(() => detector.impacts(scene, { progress: () => { throw new Error("mine"); } }));
  const { backend, totalMs } = contacts.stats;
  // Arrays and signals of another window. Contexts of Node have no signals.
  const { Float32Array: F32, Float64Array: F64, Int32Array: I32, Uint8Array: U8, Uint16Array: U16, Uint32Array: U32, AbortSignal: Signal } = await otherWindow();
  const signal = Signal?.abort() ?? { aborted: true };
  const foreign = new Scene();
  for (const index of [new U8([0, 1, 2]), new U16([0, 1, 2]), new U32([0, 1, 2])]) foreign.add({ faces: index, positions: new F32(TRIANGLE) });
  foreign.addPoints(new F64([0, 0, 0]));
  foreign.setTransform(1, new F32([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 9, 1]));
  const window = [
    index instanceof U8, (await detector.detect(foreign)).length, foreign.bodies.map((body) => foreign.positions(body).constructor.name),
    (await detector.closest(foreign, new F64([0, 0, 1]))).at(0).distance, weld({ positions: new F32(6), edges: new U16([0, 1]) }).mesh.positions.length,
    await refusal(() => foreign.addPoints(new I32(3))), await refusal(() => foreign.addTriangles(new I32([0, 1, 2]), new F32(TRIANGLE))),
    await refusal(() => detector.count(foreign, { signal })),
  ];
  // Disposed of twice.
  const { stats: last } = detector;
  await detector.dispose();
  const disposed = [await refusal(() => detector.dispose()), detector.stats === last, await refusal(() => detector.count(foreign))];
  return {
    window,
    disposed,
    near: [near.length, pair.kind, pair.bodyA, pair.elementA, pair.bodyB, pair.distance, pair.points, pair.features],
    columns: [near.distances.length, near.points.length / 6, near.kinds.length, near.of("ee").length, near.of("vf").at(-1).distance],
    noColumns: [thick.length, thick.distances, thick.points],
    kept,
    candidates: [candidates.length, [...candidates.of("ee").rows].length / 4, candidates.at(0)?.kind ?? null],
    nearest,
    onFlat,
    moved: [now, rest],
    turned,
    filtered,
    excluded,
    described,
    end,
    contacts: [contacts.length === pairs.length, contacts.hash === pairs.hash, contacts.at(0).shape, contacts.at(0).corners.length],
    curves: [curves.length, [...curves.closed], [...curves.directed], curves.starts.length, curves.points.length === contacts.points.length / 3],
    region: [region.bodies, region.contacts.length, region.depth, region.normal[2] > 0.9, region.length === curves.lengths[0]],
    penetration: [penetration.bodies, penetration.inside.map((inside) => [...inside]), penetration.volume > 0, penetration.regions.length],
    deep: [deep.depth > 0 && deep.depth <= 0.125, deep.volume === penetration.volume, deep.inside.map((inside) => [...inside])],
    none: [none.length, none.hash, none.points.length, none.curves().length, none.regions()],
    probes,
    solver,
    nearest5,
    left,
    stopped: [n > 0, stopped],
    aborted,
    thrown,
    stats: [backend, totalMs >= 0],
  };
}

export const OTHERS = {
  window: [
    false, 3, ["Float32Array", "Float32Array", "Float32Array", "Float64Array"], 1, 3,
    "invalid: positions: an Int32Array given, a Float32Array or a Float64Array is needed",
    "invalid: index: an Int32Array given, a Uint32Array, a Uint16Array or a Uint8Array is needed",
    "cancelled: cancelled",
  ],
  disposed: ["nothing was refused", true, "invalid: this detector has been disposed of"],
  near: [1, "vf", 1, 0, 0, 1, [[0.25, 0.25, 1], [0.25, 0.25, 0]], [0, 16]],
  columns: [1, 1, 1, 0, 1],
  noColumns: [1, null, null],
  kept: [true, false],
  candidates: [4, 3, "vf"],
  nearest: { distance: 1, bodyA: 1, elementA: 0, bodyB: 0, elementB: 0, points: [[0.25, 0.25, 1], [0.25, 0.25, 0]] },
  onFlat: [0, 0, 2, 1],
  moved: [0, 3],
  turned: [6, "invalid: transform: 1 numbers given, 16 numbers allowed, column by column, as elements of a Matrix4"],
  filtered: false,
  excluded: 0,
  described: ["edges", 1, 2, [0, 1], [0, 1, 0, 2, 1, 2]],
  end: [6, null, null],
  contacts: [true, true, "segment", 2],
  curves: [1, [1], [1], 2, true],
  region: [[0, 1], 3, null, true, true],
  penetration: [[0, 1], [[], [3]], true, 1],
  deep: [true, true, [[], [3]]],
  none: [0, "0000000000000000", 0, 0, []],
  probes: {
    places: [1, 0, -1, -1],
    closest: [4, { body: 0, element: 1, feature: 10, distance: 0, point: [0, 0, 0.5] }, null, [16, 10, 255, 16], 0, 4],
    hits: [
      2,
      [1, 0],
      [{ body: 0, element: 3, feature: 16, t: 3.375, tEnd: 3.375, barycentrics: [0.125, 0.25, 0.625] }],
      [],
      16,
    ],
    all: [[[0, true], [0, true], [1, true], [1, true]], [0, 4, 4], 4, [0, 0], []],
    ragged: "invalid: points: 11 numbers given, not a multiple of 3",
    list: "invalid: positions: an Array given, a Float32Array or a Float64Array is needed",
    rays: "invalid: directions: 1 directions given, as many as the 2 origins allowed",
    hit: 'invalid: hits: "last" given, "first", "any" or "all" allowed',
    most: "invalid: most: -1 given, a length of at least 0, or infinity allowed",
    open: "invalid: there is no body 7: 2 have been added, and 0 of them removed",
  },
  solver: {
    nearest: [
      1, 0, 1, 1, 1, "invalid: query: self-collision given, pairs of different bodies, and all of space allowed",
      'invalid: query: "which" and "of" given, one of them allowed',
    ],
    safe: ["Float32Array", "Float64Array", true, 0],
    held: [[0, 0, 0], true],
    lists: [15, { vertex: 3, edge: 3, face: 1 }, [0, 1, 2, 3, 4, 5, 6], [1, 1, 1, 0, 0, 0], [3, 4, 5, 0, 1, 2], true],
    same: true,
    ringed: 0,
    truncation: [3, 0, true, false, null],
    stopped: [true, true, true],
    rigid: [1, 0, 2, 0, 3, 0, 3],
    late: [
      "invalid: body 1: this was found for other positions than it has now, so nothing is known of it; ask again",
      "invalid: there is no body 1: 1 have been added, and 0 of them removed",
      "invalid: scene: a Scene is needed",
    ],
    reached: [true, true, false],
    rings: "invalid: rings: 17 given, 0 to 16 allowed",
    unknown: "invalid: there is no body 5: 2 have been added, and 0 of them removed",
    body: "invalid: body: 7 given, which was not in the scene",
  },
  nearest5: {
    few: [4, 5, 40, [0, 1, 2, 3], [], [], null, 0],
    signed: [0.125, 0, -2, true],
    cells: ["Int32Array", 1, 0, -1],
    wound: [1, -(2 ** 31), 0, 0],
    solid: "invalid: body 2 is made of tetrahedra, where triangles are needed",
    faces: "invalid: body 0 is made of triangles, where tetrahedra are needed",
    ragged: "invalid: points: 11 numbers given, not a multiple of 3",
    number: "invalid: points: row 0 is not finite (0, NaN, 0)",
    none: "invalid: nNearest: 0 given, 1 to 4294967295 allowed",
    half: "invalid: nNearest: 1.5 given, 1 to 4294967295 allowed",
  },
  left: {
    groups: [true, true],
    rest: [true, 0],
    foreign: "invalid: exclude: pairs given that are of another scene or disposed of, those of this scene allowed",
    disposed: ["invalid: exclude: pairs given that are of another scene or disposed of, those of this scene allowed", 0],
    one: "invalid: groups: 1 given, two groups are needed, without rings",
    both: "invalid: groups: 1,2 given, two groups are needed, without rings",
    group: "invalid: groups: -1 given, 0 to 4294967295 allowed",
    misspelt: 'invalid: exclude: "ring" given, rings or groups allowed',
    plain: "invalid: groups: an Array given, a Uint32Array, a Uint16Array or a Uint8Array is needed",
    short: "invalid: body 1: 2 groups given, but there are 3 vertices",
    distance: "invalid: distance: -1 given, a finite number that is not below 0 allowed",
    sewn: [1, 2, true, true],
    own: true,
    offsets: "invalid: exclude: lists for the vertices of body 0, of vertices of body 1: 3 offsets, but body 0 has 3 vertices: one more is needed",
    noVertex: "invalid: exclude: lists for the vertices of body 0, of vertices of body 1: vertex 7 at 0, but body 1 has 3 vertices",
    nobody: "invalid: there is no body 99: 2 have been added, and 0 of them removed",
    numbers: "invalid: offsets: an Array given, a Uint32Array, a Uint16Array or a Uint8Array is needed",
    forgotten: "invalid: exclude: pairs given that are of another scene or disposed of, those of this scene allowed",
    runs: [true, true, true, 4],
    listed: true,
    stopped: 4,
    thrown: "Error: mine",
    each: "invalid: each: a function is needed",
    most: "invalid: most: 0 given, 1 to 9007199254740991 allowed",
    pinned: [true, 0, "invalid: body 1: 1 pinned given, but there are 3 vertices"],
    // Whether they are what sets say, and whether any is kept, new, gone.
    changes: [
      [true, true, false, true], [true, true, true, false], [true, true, true, false], [true, true, false, true], [true, true, true, true], [true, false, true, true],
      [true, true, false, true], "invalid: old: Pairs are needed, as these are", [true, false, false, true],
    ],
    edges: [
      true, true, true, "invalid: body 1: row 2 of edges has vertices 0 and 1, as row 0 has",
      "invalid: edges: an Array given, a Uint32Array, a Uint16Array or a Uint8Array is needed", true, true,
    ],
  },
  stopped: [true, "cancelled"],
  aborted: "cancelled: cancelled",
  thrown: "Error: mine",
  stats: ["cpu", true],
};

if (globalThis.process?.argv?.[1]?.endsWith("answers.mjs")) {
  const { readFile, readdir } = await import("node:fs/promises");
  const scenes = JSON.parse(await readFile("scenes.json", "utf8"));
  const said = await refusals("impinge");
  const answers = await cpu("impinge", scenes);
  const taken = await steps("impinge");
  const more = await others("impinge");
  const onDevice = await import("impinge/webgpu");
  const { default: init, Detector, read, readBodies, readFrames, weld } = onDevice;
  const onCpu = await import("impinge");
  await init();
  const doors = {};
  for (const name of await readdir("doors")) {
    if (name.endsWith(".json")) continue;
    const bytes = await readFile(`doors/${name}`);
    doors[name] = found(onCpu, read(name, bytes));
    const bodies = readBodies(name, bytes);
    if (bodies.length > 1) doors[name].bodies = bodies.map((body) => body.name);
  }
  const text = "v 0 0 0\nv 1 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 4\nl 1 2\n";
  const mesh = read("triangle.obj", new TextEncoder().encode(text));
  // Two frames of one vertex.
  const mdd = new Uint8Array(40);
  const view = new DataView(mdd.buffer);
  for (const [at, n] of [[0, 2], [4, 1]]) view.setInt32(at, n);
  for (const [ix, x] of [1, 2, 3, 4, 5, 6].entries()) view.setFloat32(16 + 4 * ix, x);
  // As they were read, they are bodies of either build.
  const added = [];
  for (const { Scene, weld } of [onDevice, onCpu]) {
    const scene = new Scene();
    const body = scene.add(mesh);
    for (const part of readBodies("triangle.obj", new TextEncoder().encode(text))) scene.remesh(body, part);
    added.push(scene.nElements(body), scene.nVertices(scene.add(weld(mesh).mesh)));
  }
  const { Uint8Array: Bytes } = await otherWindow();
  const frames = readFrames("run.mdd", new Bytes(mdd)).map((frame) => [...frame]);
  const noGpu = await refusal(() => Detector.open());
  const broken = await refusal(() => read("a.txt", new Uint8Array()));
  const buffers = await Promise.all([read, readFrames].map((read) => refusal(() => read("a.pc2", new ArrayBuffer(8)))));
  const cut = await refusal(() => readFrames("cut.mdd", mdd.subarray(1)));
  const misspelt = [read, readBodies].map((read) => refusal(() => read("triangle.obj", new TextEncoder().encode(text), { wield: false })));
  const options = await Promise.all(misspelt);
  const { map: welded } = weld({ positions: new Float64Array([1, 2, 3, 1, 2, 3]) });
  const files = { welded: [...welded], faces: [...mesh.faces], positions: [...mesh.positions], map: [...mesh.map], notes: mesh.notes, added, frames };
  process.stdout.write(JSON.stringify({ said, answers, taken, more, read: { ...files, noGpu, broken, buffers, cut, options }, doors }));
}
