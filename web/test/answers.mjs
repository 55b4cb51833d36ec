// Answers the scenes with the installed package. package.mjs runs this file in Node and imports it in a page.

function arrays({ index, positions }) {
  return [Uint32Array.from(index), Float32Array.from(positions)];
}

// `betweenAll` gives the rows of `everything` whose bodies differ.
function mustBeDifferent(all, between) {
  const rows = [];
  for (let at = 0; at < all.length; at += 4) if (all[at] !== all[at + 2]) rows.push(...all.subarray(at, at + 4));
  if (String(rows) !== String([...between])) throw new Error(`${between.length / 4} pairs of different bodies, not ${rows.length / 4}`);
}

export async function cpu(module, scenes) {
  const { default: init, Detector } = await import(module);
  await init();
  const answers = [];
  for (const { name, sharedVertex, bodies } of scenes) {
    // "resolve" is what a detector does unless it is told.
    const rule = sharedVertex === "resolve" ? {} : { sharedVertex };
    for (const method of ["auto", "clusters", "cells"]) {
      const detector = new Detector({ ...rule, method });
      for (const [ix, body] of bodies.entries()) {
        if (body.corners === 4) detector.addTetrahedra(...arrays(body));
        else detector.add(...arrays(body));
        detector.setEndPositions(ix, Float32Array.from(body.end));
      }
      const all = detector.everything();
      const pairs = all.length / 4;
      const { hash } = detector;
      mustBeDifferent(all, detector.betweenAll());
      const impacts = detector.impacts();
      const impactsHash = detector.hash;
      const { kind, time } = [...impacts].find(({ atStart }) => !atStart);
      answers.push({ name, pairs, hash, impacts: impacts.length, impactsHash, first: { kind, time } });
      detector.dispose();
    }
  }
  return answers;
}

export async function webgpu(module, scenes, method) {
  const { default: init, GpuDetector } = await import(module);
  await init();
  const answers = [];
  for (const { name, sharedVertex, bodies } of scenes) {
    const detector = await GpuDetector.open({ sharedVertex, method });
    // Nothing is awaited before the answer: calls keep their order.
    for (const body of bodies) {
      if (body.corners === 4) void detector.addTetrahedra(...arrays(body));
      else void detector.add(...arrays(body));
    }
    const { pairs, hash, statistics } = await detector.everything();
    if (statistics.backend === "cpu" || statistics.method !== method) {
      throw new Error(`answered by ${statistics.backend} with ${statistics.method}`);
    }
    mustBeDifferent(pairs, (await detector.betweenAll()).pairs);
    await detector.dispose();
    answers.push({ name, pairs: pairs.length / 4, hash });
  }
  return answers;
}

// Where a mesh from a file meets itself.
function found(Detector, { index, positions, corners }) {
  const detector = new Detector();
  const body = corners === 4 ? detector.addTetrahedra(index, positions) : detector.add(index, positions);
  const pairs = detector.within(body).length / 2;
  const { hash } = detector;
  detector.dispose();
  return { pairs, hash };
}

// The text of the error that a call throws, or of its rejection.
async function refusal(call) {
  try {
    await call();
  } catch (error) {
    return `${error.constructor.name}: ${error.message}`;
  }
  return "nothing was refused";
}

// Calls that must be refused, and what they say.
export async function refusals(module) {
  const { default: init, Detector } = await import(module);
  const said = {};
  said.early = await refusal(() => new Detector());
  await init();
  const detector = new Detector();
  const index = new Uint16Array([0, 1, 2]);
  const triangle = new Float64Array([0, 0, 0, 1, 0, 0, 0, 1, 0]);
  const a = detector.add(index, triangle);
  said.number = await refusal(() => detector.setPositions(a, new Float32Array([0, 0, NaN, 1, 0, 0, 0, 1, 0])));
  said.index = await refusal(() => detector.add(new Uint32Array([0, 1, 7]), triangle));
  said.ragged = await refusal(() => detector.add(index, triangle.subarray(1)));
  said.plain = await refusal(() => detector.add([0, 1, 2], triangle));
  said.list = await refusal(() => detector.add(index, [...triangle]));
  said.unknown = await refusal(() => detector.within(4));
  said.wrong = await refusal(() => detector.between(a, "b"));
  said.self = await refusal(() => detector.between(a, a));
  said.method = await refusal(() => new Detector({ method: "octree" }));
  said.option = await refusal(() => new Detector({ metod: "cells" }));
  said.clearance = await refusal(() => detector.impacts({ clearance: -1 }));
  said.start = await refusal(() => detector.isFree({ start: "never" }));
  said.earliest = await refusal(() => detector.earliest({ bodies: [a], seperation: 5 }));
  said.which = await refusal(() => detector.impacts({ which: "self" }));
  said.separation = await refusal(() => detector.impacts({ separation: NaN }));
  // The refused calls left it as it was.
  const b = detector.add(new Uint8Array([0, 1, 2]), Float32Array.from(triangle));
  said.pairs = [...detector.between(a, b)];
  detector.setPositions(b, triangle.map((x) => x + 4));
  said.apart = [...detector.between(a, b)];
  detector.dispose();
  said.disposed = await refusal(() => detector.within(a));
  return said;
}

export const REFUSALS = {
  early: "Error: impinge is not loaded yet: await init() first",
  number: "Error: body 0: vertex 0 has a non-finite position (0, 0, NaN)",
  index: "Error: body 1: primitive 0 names vertex 7, but there are 3 vertices",
  ragged: "Error: positions: 8 numbers given, not a multiple of 3",
  plain: "TypeError: index: a Uint32Array, a Uint16Array or a Uint8Array is needed",
  list: "TypeError: positions: a Float32Array or a Float64Array is needed",
  unknown: "Error: there is no body 4: 1 have been added, and 0 of them removed",
  wrong: "RangeError: body: b given, a number that add() returned is needed",
  self: "Error: a query between body 0 and itself: ask for collisions within it instead",
  method: 'Error: method: "octree" given, "auto", "clusters", "cells" or "naive" allowed',
  option: 'TypeError: options: "metod" given, "method" or "sharedVertex" allowed',
  clearance: "Error: clearance: -1 given, a finite number that is not below 0 allowed",
  start: 'Error: start: "never" given, "report", "skip" or "verify" allowed',
  earliest:
    'TypeError: options: "seperation" given, "bodies", "which", "start", "toi", "separation", "clearance" or "clearanceShare" allowed',
  which: 'RangeError: which: "self" given, "all" or "between" allowed',
  separation: "Error: separation: NaN given, a finite number that is not below 0 allowed",
  pairs: [0, 0],
  apart: [],
  disposed: "Error: this detector has been disposed of",
};

// A triangle whose edge is inside another, and a third that falls on both; and a welded seam.
export async function steps(module) {
  const { default: init, Detector, weld } = await import(module);
  await init();
  const detector = new Detector();
  const index = new Uint8Array([0, 1, 2]);
  const flat = detector.add(index, new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]));
  const across = detector.add(index, new Float32Array([0.25, 0.25, -1, 0.25, 0.25, 1, 2, 2, 0]));
  const start = "verify";
  const unasked = [detector.impacts().startIntersects, detector.startIntersects, detector.isFree()];
  const asked = [detector.impacts({ start }).startIntersects, detector.startIntersects, detector.isFree({ start })];
  const { fraction: stuck, startIntersects, first: none } = detector.advance({ start });
  detector.earliest({ bodies: [flat], start });
  const clean = detector.startIntersects;
  detector.remove(across);
  const falling = detector.add(index, new Float64Array([0.25, 0.25, 1, 0.5, 0.25, 2, 0.25, 0.5, 2]));
  detector.setEndPositions(falling, new Float64Array([0.25, 0.25, -1, 0.5, 0.25, 0, 0.25, 0.5, 0]));
  const { time } = detector.earliest({ toi: "f64", clearance: 0.5, clearanceShare: 0.75 });
  const advance = detector.advance({ start, toi: "f64", clearance: 10, clearanceShare: 0.25 });
  const { first, nTried, fraction } = advance;
  const height = advance.positions(falling)[2];
  advance.apply(detector);
  const still = detector.isFree();
  detector.dispose();
  // Two triangles that share an edge, with its vertices repeated; the second in another frame.
  const seam = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1, -0, 1, 1, 0]);
  const { mesh, map, positions } = weld({ positions: seam, faces: new Uint16Array([0, 1, 2, 3, 5, 4]), edges: new Uint8Array([1, 9]) });
  const moved = positions(Float64Array.from(seam, (x) => x + 1));
  return {
    unasked,
    asked,
    stuck: [stuck, startIntersects, none],
    clean,
    time,
    // With a clearance the time has a margin for rounding.
    first: [first.kind, first.bodyA, first.bodyB, first.time > 0.37 && first.time <= 0.375],
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
  unasked: [null, null, true],
  asked: [true, true, false],
  stuck: [0, true, null],
  clean: false,
  time: 0.25,
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
  short: "RangeError: positions: 15 numbers given for a weld of 6 vertices",
  ragged: "Error: positions: 17 numbers given, not a multiple of 3",
  misspelt: 'TypeError: options: "index" given, "positions", "faces", "tetrahedra" or "edges" allowed',
};

if (globalThis.process?.argv?.[1]?.endsWith("answers.mjs")) {
  const { readFile, readdir } = await import("node:fs/promises");
  const scenes = JSON.parse(await readFile("scenes.json", "utf8"));
  const said = await refusals("impinge");
  const answers = await cpu("impinge", scenes);
  const taken = await steps("impinge");
  const { default: init, GpuDetector, readBodies, readFrames, readMesh, weld } = await import("impinge/webgpu");
  const { Detector } = await import("impinge");
  await init();
  const doors = {};
  for (const name of await readdir("doors")) {
    if (name.endsWith(".json")) continue;
    const bytes = await readFile(`doors/${name}`);
    doors[name] = found(Detector, readMesh(name, bytes));
    const bodies = readBodies(name, bytes);
    if (bodies.length > 1) doors[name].bodies = bodies.map((body) => body.name);
  }
  const text = "v 0 0 0\nv 1 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 4\n";
  const mesh = readMesh("triangle.obj", new TextEncoder().encode(text));
  // Two frames of one vertex.
  const mdd = new Uint8Array(40);
  const view = new DataView(mdd.buffer);
  for (const [at, n] of [[0, 2], [4, 1]]) view.setInt32(at, n);
  for (const [ix, x] of [1, 2, 3, 4, 5, 6].entries()) view.setFloat32(16 + 4 * ix, x);
  const frames = readFrames("run.mdd", mdd).map((frame) => [...frame]);
  const noGpu = await refusal(() => GpuDetector.open());
  const broken = await refusal(() => readMesh("a.txt", new Uint8Array()));
  const cut = await refusal(() => readFrames("cut.mdd", mdd.subarray(1)));
  const misspelt = [readMesh, readBodies].map((read) => refusal(() => read("triangle.obj", new TextEncoder().encode(text), { wield: false })));
  const options = await Promise.all(misspelt);
  const { corners } = mesh;
  const { map: welded } = weld({ positions: new Float64Array([1, 2, 3, 1, 2, 3]) });
  const read = { welded: [...welded], index: [...mesh.index], positions: [...mesh.positions], corners, map: [...mesh.map], frames, noGpu, broken, cut, options };
  process.stdout.write(JSON.stringify({ said, answers, taken, read, doors }));
}
