// Questions as the lists of numbers that the module takes, and what watches them.

import { ImpingeError, body, disposable, kindOf, list, mustBeNone, number, options, refuse, shown, word } from "./shared.js";

export const KINDS = ["vf", "ee", "ev", "vv", "ef", "ff"];

const FIELDS = [
  ...["which", "between", "selfOf", "of", "kinds", "sharedVertex", "exclude", "ownedBy", "start", "separation", "clearance"],
  ...["clearanceShare", "precision", "distances", "closestPoints", "fixed", "hits", "nNearest", "most", "signal", "progress"],
];

// The words and numbers of a query, and what watches the question. `length` is the question's own: a distance, an inflation. `unsaid` is which
// pairs are meant where the query names none.
export function packed(query, length = 0, unsaid = "all") {
  const {
    which,
    between,
    selfOf,
    of,
    kinds,
    sharedVertex = "resolve",
    exclude = [],
    ownedBy,
    start = "report",
    separation = 0,
    clearance = 0,
    clearanceShare = 0.2,
    precision = "f32",
    distances = false,
    closestPoints = false,
    fixed = [],
    hits = "first",
    nNearest = 1,
    most = Infinity,
    signal,
    progress,
    ...others
  } = options("query", query);
  mustBeNone("query", others, FIELDS);
  const rules = [
    word("sharedVertex", sharedVertex, ["resolve", "skip"]),
    word("start", start, ["report", "skip", "verify"]),
    word("precision", precision, ["f32", "f64"]),
  ];
  const flags = (distances ? 1 : 0) | (closestPoints ? 2 : 0) | (ownedBy === undefined ? 0 : 4) | (word("hits", hits, ["first", "any", "all"]) << 3);
  const still = list("fixed", fixed);
  const n = whole("nNearest", nNearest, 1, 2 ** 32 - 1);
  const words = [...bodies({ which, between, selfOf, of }, unsaid), ...rules, bits(kinds), flags | (still.length << 5), n, ...still.map(body)];
  for (const of of list("exclude", exclude)) words.push(...excluded(of));
  number("most", most);
  const lengths = Object.entries({ separation, clearance, clearanceShare }).map((entry) => number(...entry));
  return {
    words: Uint32Array.from(words),
    numbers: Float64Array.from([...lengths, ...cell(ownedBy), length]),
    watch: new Watch(signal, progress),
  };
}

// Calls what makes the module forget pairs that nobody holds any more.
const lost = new FinalizationRegistry((forget) => forget());

// Pairs that were near when a scene was asked, or whose vertices are listed: the module knows them by a number.
export class KeptPairs {
  static #last = 0;
  static next = () => (KeptPairs.#last += 1);
  static numberOf = (given) => given.#number;
  #number;
  #forget;

  constructor(number, length, forget) {
    this.#number = number;
    this.#forget = forget;
    this.length = length;
    lost.register(this, forget, this);
  }

  dispose() {
    this.#forget();
    lost.unregister(this);
  }
}
disposable(KeptPairs);

// Three words for what is left out: rings around each element, two groups of vertices, pairs that the scene keeps or two bodies.
function excluded(given) {
  if (given instanceof KeptPairs) return [3, KeptPairs.numberOf(given), 0];
  if (given === null || typeof given !== "object") refuse(`exclude: ${kindOf(given)} given, as in [[a, b]] an array of two bodies or an object is needed`);
  if ("stats" in given) refuse(`exclude: ${kindOf(given)} given, an answer; scene.restPairs() finds pairs that are left out`);
  if (Symbol.iterator in given) return [0, ...two("exclude", given)];
  const { rings, groups, ...others } = given;
  mustBeNone("exclude", others, ["rings", "groups"]);
  if (rings === undefined && groups === undefined) refuse("exclude: an empty object given, rings or groups are needed");
  if (groups === undefined) return [1, whole("rings", rings, 0, 16), 0];
  if (rings !== undefined || groups?.length !== 2) refuse(`groups: ${shown(groups)} given, two groups are needed, without rings`);
  return [2, ...Array.from(groups, (group) => whole("groups", group, 0, 2 ** 32 - 1))];
}

// A whole number in a range; `more` names what else the caller allows.
export function whole(name, given, least, most, more = "") {
  if (Number.isInteger(given) && given >= least && given <= most) return given;
  return refuse(`${name}: ${shown(given)} given, ${least} to ${most}${more} allowed`);
}

// The numbers of a question, followed by those of points.
export function withPoints({ numbers, ...asked }, points) {
  const all = new Float64Array(numbers.length + points.reduce((n, { length }) => n + length, 0));
  all.set(numbers);
  let at = numbers.length;
  for (const of of points) {
    all.set(of, at);
    at += of.length;
  }
  return { ...asked, numbers: all };
}

// A question without a query: words alone.
export function plain(words, control) {
  const { signal, progress, ...others } = options("control", control);
  mustBeNone("control", others, ["signal", "progress"]);
  return { words, numbers: new Float64Array(10), watch: new Watch(signal, progress) };
}

function bodies(given, unsaid) {
  const names = Object.keys(given).filter((name) => given[name] !== undefined);
  if (names.length > 1) refuse(`query: "${names[0]}" and "${names[1]}" given, one of them allowed`);
  const { which = unsaid, between, selfOf, of } = given;
  if (between !== undefined) return [3, ...apart(two("between", between))];
  if (selfOf !== undefined) return [4, body(selfOf), 0];
  if (of !== undefined) return [5, body(of), 0];
  return [word("which", which, ["all", "between", "self"]), 0, 0];
}

function apart([a, b]) {
  if (a === b) refuse(`between: body ${a} given twice, selfOf: ${a} asks for its self-collision`);
  return [a, b];
}

function two(name, given) {
  if (given?.length !== 2) refuse(`${name}: ${shown(given)} given, two bodies are needed`);
  return Array.from(given, body);
}

// Kinds as bits. That they were said is a bit of its own.
function bits(kinds) {
  if (kinds === undefined) return 0;
  return list("kinds", kinds).map((kind) => 1 << word("kinds", kind, KINDS)).reduce((all, bit) => all | bit, 64);
}

function cell(given) {
  if (given === undefined) return [0, 0, 0, 0, 0, 0];
  const corners = list("ownedBy", given).map((corner) => list("ownedBy", corner).map((x) => number("ownedBy", x)));
  if (corners.length === 2 && corners.every(({ length }) => length === 3)) return corners.flat();
  return refuse("ownedBy: two corners of three numbers each are needed");
}

const watches = new Map();
let lastWatch = 0;

// The module calls this from time to time: whether a question is to end.
export const watch = (id, done, total) => watches.get(id)?.look(done, total) ?? false;

const INTERVAL_MS = 10;

// Looks at the signal of a question and tells its progress.
class Watch {
  #signal;
  #progress;
  #looked = -Infinity;
  #isStopped = false;
  #failure = null;

  constructor(signal, progress) {
    if (signal !== undefined && typeof signal?.aborted !== "boolean") refuse("signal: an AbortSignal is needed");
    if (progress !== undefined && typeof progress !== "function") refuse("progress: a function is needed");
    this.#signal = signal;
    this.#progress = progress;
  }

  look(done, total) {
    const now = performance.now();
    if (this.#isStopped || (done < total && now - this.#looked < INTERVAL_MS)) return this.#isStopped;
    this.#looked = now;
    try {
      this.#isStopped = this.#progress?.(done, total) === false || this.#signal?.aborted === true;
    } catch (error) {
      this.#failure = { error };
      this.#isStopped = true;
    }
    return this.#isStopped;
  }

  // Calls `stopped` if the signal is aborted before the question's turn. Returns what says that its turn has come.
  whileItWaits(stopped) {
    const stop = () => {
      this.#isStopped = true;
      stopped();
    };
    if (this.#signal?.aborted) stop();
    this.#signal?.addEventListener?.("abort", stop);
    return () => this.#signal?.removeEventListener?.("abort", stop);
  }

  // Watches a question, which gets a number for the module; 0 if nobody looks.
  during(ask) {
    const id = this.#begin();
    try {
      return ask(id);
    } finally {
      this.#end(id);
    }
  }

  async duringAsync(ask) {
    const id = this.#begin();
    try {
      return await ask(id);
    } finally {
      this.#end(id);
    }
  }

  #begin() {
    if (this.#isStopped || this.#signal?.aborted) this.#stop();
    if (this.#signal === undefined && this.#progress === undefined) return 0;
    lastWatch = (lastWatch % 0xffff_ffff) + 1;
    watches.set(lastWatch, this);
    return lastWatch;
  }

  #end(id) {
    watches.delete(id);
    if (this.#failure !== null) throw this.#failure.error;
    if (this.#isStopped) this.#stop();
  }

  #stop() {
    throw new ImpingeError("cancelled", "cancelled", { cause: this.#signal?.reason });
  }
}
