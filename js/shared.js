// Loading the module, errors, and arrays in the form that the module takes.

// Why a call failed: `code` tells errors apart.
export class ImpingeError extends Error {
  constructor(code, message, options) {
    super(message, options);
    this.name = "ImpingeError";
    this.code = code;
  }
}

// Lets `using` dispose of what has a method for it.
export function disposable(type) {
  if (Symbol.dispose) type.prototype[Symbol.dispose] = type.prototype.dispose;
}

// The name under which scenes take steps that answers have found.
export const TAKE_STEP = Symbol("take a step");
// And that under which they know when bodies were moved.
export const MOVES = Symbol("moves");

export function refuse(message) {
  throw new ImpingeError("invalid", message);
}

// Enters the module. It throws strings: a code, a line break, a text.
export function call(entry) {
  try {
    return entry();
  } catch (error) {
    throw named(error);
  }
}

export function named(error) {
  if (typeof error === "string") {
    const [code] = error.split("\n", 1);
    return new ImpingeError(code, camelized(error.slice(code.length + 1)));
  }
  // Words of the module's own JavaScript.
  if (/^(recursive use of an object|attempted to take ownership)/.test(error?.message)) {
    const message = "a scene or a detector is used while it answers a question, or after the module has stopped";
    return new ImpingeError("invalid", message, { cause: error });
  }
  if (!(error instanceof WebAssembly.RuntimeError)) return error;
  const message = `the module has stopped (${error.message}): it has no more memory, or this is a bug`;
  return new ImpingeError("internal", message, { cause: error });
}

// The module's errors begin with names of options as other languages write them.
const OPTION = /^(clearance_share|closest_points|max_pairs|memory_budget|n_nearest|owned_by|reuse_margin|shared_vertex)(?=: )/;
const camelized = (text) =>
  text
    .replace(OPTION, (name) => name.replace(/_(.)/g, (_, letter) => letter.toUpperCase()))
    .replace(/^(\w+): (-?)inf given/, "$1: $2Infinity given")
    .replace("those that are named by `of` or `across`", "one by `of`")
    .replace(/^(body \d+), in the library's words: body \d+: /, "$1: ");

// Returns two functions: one loads the module, once; the other throws as long as it has not been loaded.
export function loader(load, beside, begin) {
  let loading;
  let isReady = false;
  const init = async (module) => {
    loading ??= source(module, beside).then((module_or_path) => load({ module_or_path })).then(begin);
    try {
      await loading;
      isReady = true;
    } catch (error) {
      loading = undefined;
      throw error;
    }
  };
  const mustBeReady = () => {
    if (!isReady) refuse("impinge is not loaded yet: await init() first");
  };
  return [init, mustBeReady];
}

// The module's bytes, or where they are. Node's fetch does not read files.
async function source(given, beside) {
  const wanted = (await given) ?? beside();
  // A window may have Node's process, too; its addresses are those of its page.
  if (globalThis.process?.versions?.node === undefined || globalThis.document !== undefined) return wanted;
  const isUrl = wanted instanceof URL || (typeof wanted === "string" && /^[a-z][a-z+.-]+:/i.test(wanted));
  const url = isUrl ? new URL(wanted) : null;
  if (url === null ? typeof wanted !== "string" : url.protocol !== "file:") return wanted;
  // Bundlers for browsers look for what a string names here.
  const name = "node:fs/promises";
  const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ name);
  return readFile(url ?? wanted);
}

// What was given, as it is written in a program.
export function shown(given) {
  if (typeof given === "string") return `"${given}"`;
  if (typeof given === "object" && given !== null && !Array.isArray(given)) return kindOf(given);
  return typeof given === "bigint" ? `${given}n` : String(given);
}

// What was given, in a word or two.
export function kindOf(given) {
  if (/^(function|string|symbol)$/.test(typeof given)) return `a ${typeof given}`;
  if (given === null || typeof given !== "object") return String(given);
  return given.constructor?.name ? `${/^[AEIO]/.test(given.constructor.name) ? "an" : "a"} ${given.constructor.name}` : "an object";
}

// Options, an object; none are given by undefined or null.
export function options(name, given) {
  if (given === undefined || given === null || (typeof given === "object" && !Array.isArray(given))) return given ?? {};
  return refuse(`${name}: ${kindOf(given)} given, an object is needed`);
}

// "Float32Array" of an array of that type, of another window's as well; undefined of what is no typed array.
const { get: tag } = Object.getOwnPropertyDescriptor(Object.getPrototypeOf(Uint8Array.prototype), Symbol.toStringTag);
export const typeOf = (given) => tag.call(given);

// The list that was given.
export function list(name, given) {
  if (isList(given)) return Array.from(attached(name, given));
  return refuse(`${name}: ${kindOf(given)} given, an array is needed`);
}

export function isList(given) {
  return given !== null && typeof given === "object" && (Symbol.iterator in given || given.length >= 0);
}

// The numbers of a list.
export function numbers(name, given) {
  if (/^Float(32|64)Array$/.test(typeOf(given))) return Float64Array.from(attached(name, given));
  return Float64Array.from(list(name, given), (x) => number(name, x));
}

// An array whose memory was not given away, to a worker for example.
function attached(name, given) {
  if (!ArrayBuffer.isView(given) || given.length > 0) return given;
  try {
    void new Uint8Array(given.buffer);
    return given;
  } catch {
    return refuse(`${name}: ${kindOf(given)} given whose memory was given away`);
  }
}

// Vertex numbers with 32 bits. three.js uses 16 bits if they suffice.
export function wide(index, name = "index") {
  const type = typeOf(index);
  if (type === "Uint32Array") return attached(name, index);
  if (type === "Uint16Array" || type === "Uint8Array") return Uint32Array.from(attached(name, index));
  return refuse(`${name}: ${kindOf(index)} given, a Uint32Array, a Uint16Array or a Uint8Array is needed`);
}

export function isSingle(positions) {
  const type = typeOf(positions);
  if (type === "Float32Array" || type === "Float64Array") return attached("positions", positions) && type === "Float32Array";
  return refuse(`positions: ${kindOf(positions)} given, a Float32Array or a Float64Array is needed`);
}

// The number of a body. The module would cut it to 32 bits without an error.
export function body(given) {
  if (Number.isInteger(given) && given >= 0 && given < 2 ** 32) return given;
  return refuse(`body: ${shown(given)} given, a number that a scene returned is needed`);
}

export function number(name, given) {
  if (typeof given === "number") return given;
  return refuse(`${name}: ${shown(given)} given, a number is needed`);
}

const listed = (words) => (words.length === 1 ? words[0] : `${words.slice(0, -1).join(", ")} or ${words.at(-1)}`);

// The place of a word in a list of those that are allowed.
export function word(name, given, allowed) {
  const at = allowed.indexOf(given);
  if (at >= 0) return at;
  return refuse(`${name}: "${String(given)}" given, ${listed(allowed.map((word) => `"${word}"`))} allowed`);
}

// Refuses options that do not exist. Without them, the answer would be another than the one that was asked for.
export function mustBeNone(what, others, allowed) {
  const [unknown] = Object.keys(others);
  if (unknown !== undefined) refuse(`${what}: "${unknown}" given, ${listed(allowed)} allowed`);
}

// The arrays of a mesh. One that was read has a name, a map and notes.
export function meshOf(given) {
  if (given === null || typeof given !== "object" || Symbol.iterator in given) {
    refuse(`mesh: ${kindOf(given)} given, an object with positions is needed, as in { positions, faces }`);
  }
  const { positions, faces, tetrahedra, edges, name: _name, map: _map, notes: _notes, ...others } = given;
  mustBeNone("mesh", others, ["positions", "faces", "tetrahedra", "edges"]);
  // Without elements, vertices are points: whoever names elements has forgotten them.
  const named = ["faces", "tetrahedra", "edges"].filter((name) => name in given);
  if (named.length > 0 && named.every((name) => given[name] === undefined)) {
    refuse(`${named[0]}: undefined given; a geometry without an index has the faces 0, 1, 2, 3, …, and points have no ${named[0]}`);
  }
  return { positions, faces, tetrahedra, edges };
}

// Makes `weld` of the two functions of a module.
export function welder(mustBeReady, { weld_f32, weld_f64 }) {
  return (given) => {
    mustBeReady();
    const { positions, faces, tetrahedra, edges } = meshOf(given);
    const map = call(() => (isSingle(positions) ? weld_f32(positions) : weld_f64(positions)));
    // The first vertex of each welded one.
    const firsts = [];
    for (const [vertex, welded] of map.entries()) if (welded === firsts.length) firsts.push(vertex);
    const weldedPositions = (given) => {
      isSingle(given);
      if (given.length !== 3 * map.length) {
        refuse(`positions: ${given.length} numbers given for a weld of ${map.length} vertices`);
      }
      const kept = new given.constructor(3 * firsts.length);
      for (const [to, from] of firsts.entries()) kept.set(given.subarray(3 * from, 3 * from + 3), 3 * to);
      return kept;
    };
    const mesh = { positions: weldedPositions(positions) };
    for (const [name, index] of Object.entries({ faces, tetrahedra, edges })) {
      // Numbers that no vertex has stay so: the scene refuses them.
      if (index !== undefined) mesh[name] = wide(index).map((vertex) => map[vertex] ?? vertex);
    }
    return { mesh, map, positions: weldedPositions };
  };
}
