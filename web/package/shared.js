// Shared by both builds: loading the module, and arrays in the form that the module takes.

// Returns two functions: one loads the module, once; the other throws as long as it has not been loaded.
export function loader(load, beside) {
  let loading;
  let isReady = false;
  const init = async (module) => {
    loading ??= source(module, beside).then((module_or_path) => load({ module_or_path }));
    try {
      await loading;
      isReady = true;
    } catch (error) {
      loading = undefined;
      throw error;
    }
  };
  const mustBeReady = () => {
    if (!isReady) throw new Error("impinge is not loaded yet: await init() first");
  };
  return [init, mustBeReady];
}

// The module's bytes, or where they are. Node's fetch does not read files.
async function source(given, beside) {
  const wanted = given ?? beside;
  const isFile = wanted instanceof URL && wanted.protocol === "file:";
  if (!isFile || globalThis.process?.versions?.node === undefined) return wanted;
  const { readFile } = await import("node:fs/promises");
  return readFile(wanted);
}

// Vertex numbers with 32 bits. three.js uses 16 bits if they suffice.
function wide(index) {
  if (index instanceof Uint32Array) return index;
  if (index instanceof Uint16Array || index instanceof Uint8Array) return Uint32Array.from(index);
  throw new TypeError("index: a Uint32Array, a Uint16Array or a Uint8Array is needed");
}

function isSingle(positions) {
  if (positions instanceof Float32Array) return true;
  if (positions instanceof Float64Array) return false;
  throw new TypeError("positions: a Float32Array or a Float64Array is needed");
}

// The number of a body. The module would cut it to 32 bits without an error.
function body(given) {
  if (Number.isInteger(given) && given >= 0 && given < 2 ** 32) return given;
  throw new RangeError(`body: ${String(given)} given, a number that add() returned is needed`);
}

export function bodies(...given) {
  return Uint32Array.from(given, body);
}

// Refuses options that do not exist. Without them, the answer would be another than the one that was asked for.
export function mustBeNone(others, allowed) {
  const [unknown] = Object.keys(others);
  if (unknown !== undefined) throw new TypeError(`options: "${unknown}" given, ${allowed} allowed`);
}

export function chosen({ method = "auto", sharedVertex = "resolve", ...others } = {}) {
  mustBeNone(others, '"method" or "sharedVertex"');
  return [String(method), String(sharedVertex)];
}

const STEP_OPTIONS = '"bodies", "which", "start", "toi", "separation", "clearance" or "clearanceShare"';

// The arguments of a question about a step.
function step({
  bodies: given = [],
  which = "all",
  start = "report",
  toi = "f32",
  separation = 0,
  clearance = 0,
  clearanceShare = 0.2,
  ...others
} = {}) {
  mustBeNone(others, STEP_OPTIONS);
  if (which !== "all" && which !== "between") {
    throw new RangeError(`which: "${which}" given, "all" or "between" allowed`);
  }
  const distances = [separation, clearance, clearanceShare].map(Number);
  return [bodies(...given), which === "all", String(start), String(toi), ...distances];
}

function impact(impacts, ix) {
  const { kinds, rows, times, atStart, names } = impacts;
  const [bodyA, elementA, bodyB, elementB] = rows.subarray(4 * ix);
  const [time, isAtStart] = [times[ix], atStart[ix] === 1];
  return { kind: names[kinds[ix]], bodyA, elementA, bodyB, elementB, time, atStart: isAtStart };
}

class Impacts {
  constructor(names, [kinds, rows, times, atStart], startIntersects = null) {
    Object.assign(this, { names, kinds, rows, times, atStart, startIntersects });
  }

  get length() {
    return this.kinds.length;
  }

  at(ix) {
    if (Number.isInteger(ix) && ix >= 0 && ix < this.length) return impact(this, ix);
    return undefined;
  }

  *[Symbol.iterator]() {
    for (let ix = 0; ix < this.length; ix += 1) yield impact(this, ix);
  }
}

class Advance {
  #positions;

  constructor(names, [fraction, nTried, first, moving, positions], startIntersects) {
    Object.assign(this, { fraction, nTried, startIntersects, first: new Impacts(names, first).at(0) ?? null });
    this.#positions = new Map([...moving].map((body, ix) => [body, positions[ix]]));
  }

  positions(which) {
    return this.#positions.get(body(which)) ?? null;
  }

  apply(detector) {
    for (const [body, positions] of this.#positions) detector.setPositions(body, positions);
  }
}

// Makes `weld` of the two functions of a module.
export function welder(weld_f32, weld_f64) {
  return ({ positions, faces, tetrahedra, edges, ...others }) => {
    mustBeNone(others, '"positions", "faces", "tetrahedra" or "edges"');
    const map = isSingle(positions) ? weld_f32(positions) : weld_f64(positions);
    // The first vertex of each welded one.
    const firsts = [];
    for (const [vertex, welded] of map.entries()) if (welded === firsts.length) firsts.push(vertex);
    const weldedPositions = (given) => {
      isSingle(given);
      if (given.length !== 3 * map.length) {
        throw new RangeError(`positions: ${given.length} numbers given for a weld of ${map.length} vertices`);
      }
      const kept = new given.constructor(3 * firsts.length);
      for (const [to, from] of firsts.entries()) kept.set(given.subarray(3 * from, 3 * from + 3), 3 * to);
      return kept;
    };
    const mesh = { positions: weldedPositions(positions) };
    for (const [name, index] of Object.entries({ faces, tetrahedra, edges })) {
      // Numbers that no vertex has stay so: the detector refuses them.
      if (index !== undefined) mesh[name] = wide(index).map((vertex) => map[vertex] ?? vertex);
    }
    return { mesh, map, positions: weldedPositions };
  };
}

// The bodies of a detector of either build, and its last answer.
export class Bodies {
  #engine;
  #module;

  // `module`: `kind_names` and `StepQuestion`, if steps are asked about.
  constructor(engine, module) {
    this.#engine = engine;
    this.#module = module;
  }

  get engine() {
    if (this.#engine === null) throw new Error("this detector has been disposed of");
    return this.#engine;
  }

  add(index, positions) {
    return this.#add(index, positions, 3);
  }

  addTetrahedra(index, positions) {
    return this.#add(index, positions, 4);
  }

  #add(index, positions, corners) {
    const { engine } = this;
    if (isSingle(positions)) return engine.add_f32(wide(index), positions, corners);
    return engine.add_f64(wide(index), positions, corners);
  }

  setPositions(which, positions) {
    const { engine } = this;
    if (isSingle(positions)) engine.set_positions_f32(body(which), positions);
    else engine.set_positions_f64(body(which), positions);
  }

  setEndPositions(which, positions) {
    const { engine } = this;
    if (isSingle(positions)) engine.set_end_positions_f32(body(which), positions);
    else engine.set_end_positions_f64(body(which), positions);
  }

  remove(which) {
    this.engine.remove(body(which));
  }

  size(which) {
    const [primitives, vertices] = this.engine.size(body(which));
    return { primitives, vertices };
  }

  impacts(options) {
    const found = this.engine.impacts(this.#question(options));
    return new Impacts(this.#module.kind_names(), found, this.startIntersects);
  }

  earliest(options) {
    const found = this.engine.earliest(this.#question(options));
    return new Impacts(this.#module.kind_names(), found).at(0) ?? null;
  }

  isFree(options) {
    return this.engine.is_free(this.#question(options));
  }

  advance(options) {
    const found = this.engine.advance(this.#question(options));
    return new Advance(this.#module.kind_names(), found, this.startIntersects);
  }

  #question(options) {
    return new this.#module.StepQuestion(...step(options));
  }

  get startIntersects() {
    return this.engine.start_intersects() ?? null;
  }

  get hash() {
    return this.engine.hash();
  }

  get statistics() {
    return this.engine.statistics();
  }

  dispose() {
    this.#engine?.free();
    this.#engine = null;
  }
}
