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
  said.clearance = await refusal(() => detector.impacts({ clearance: 0.1 }));
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
  clearance: 'TypeError: options: "clearance" given, "bodies", "which", "start", "toi" or "separation" allowed',
  earliest: 'TypeError: options: "seperation" given, "bodies", "which", "start", "toi" or "separation" allowed',
  which: 'RangeError: which: "self" given, "all" or "between" allowed',
  separation: "Error: separation: NaN given, a finite number that is not below 0 allowed",
  pairs: [0, 0],
  apart: [],
  disposed: "Error: this detector has been disposed of",
};

if (globalThis.process?.argv?.[1]?.endsWith("answers.mjs")) {
  const { readFile, readdir } = await import("node:fs/promises");
  const scenes = JSON.parse(await readFile("scenes.json", "utf8"));
  const said = await refusals("impinge");
  const answers = await cpu("impinge", scenes);
  const { default: init, GpuDetector, readBodies, readFrames, readMesh } = await import("impinge/webgpu");
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
  const read = { index: [...mesh.index], positions: [...mesh.positions], corners, map: [...mesh.map], frames, noGpu, broken, cut, options };
  process.stdout.write(JSON.stringify({ said, answers, read, doors }));
}
