// Answers: the lists of the module, with names and shapes. They were copied out of it, so there is nothing to free.

import { KINDS } from "./query.js";
import { TAKE_STEP, body, refuse, word } from "./shared.js";

export { KINDS };

export const SHAPES = ["solid", "apart", "point", "segment", "polygon"];

// In the order of the module.
const COUNTS = [
  ...["nThreads", "nSubdivided", "nEntries", "nClusters", "nCulled", "nWorkItems", "nCandidates", "nUnsure", "nClustered", "nReclustered"],
  ...["nBatches", "nPieces", "nReruns", "bytesHeld"],
];

export function statsOf([[backend, method, ...names], [totalMs, ...numbers]]) {
  const stats = { backend, method, totalMs };
  for (const [ix, name] of COUNTS.entries()) stats[name] = numbers[ix];
  stats.stages = Object.fromEntries(names.map((name, ix) => [name, numbers[COUNTS.length + ix]]));
  return stats;
}

export const hex = (hash) => hash.toString(16).padStart(16, "0");

function element(rows, ix) {
  const at = 4 * ix;
  return { bodyA: rows[at], elementA: rows[at + 1], bodyB: rows[at + 2], elementB: rows[at + 3] };
}

// What has a row per entry.
class List {
  constructor(rows) {
    this.rows = rows;
  }

  get length() {
    return this.rows.length / 4;
  }

  at(ix) {
    const from = ix < 0 ? ix + this.length : ix;
    return Number.isInteger(ix) && from >= 0 && from < this.length ? this.entry(from) : undefined;
  }

  *[Symbol.iterator]() {
    for (let ix = 0; ix < this.length; ix += 1) yield this.entry(ix);
  }
}

// The entries of a list, by kind, bodies and elements. They come so already, unless a body has the place of a removed one in the module.
function ordered(list) {
  const { rows, kinds } = list;
  const each = Array.from({ length: list.length }, (_, ix) => [ix, kinds?.[ix] ?? 0, ...rows.subarray(4 * ix, 4 * ix + 4)]);
  return each.sort(inOrder);
}

function inOrder(a, b) {
  for (let column = 1; column < a.length; column += 1) if (a[column] !== b[column]) return a[column] - b[column];
  return 0;
}

// What a scene knew of the numbers of its elements when a list was found.
const numbering = new WeakMap();

function remember(list, moves) {
  if (moves !== undefined) numbering.set(list, moves);
  return list;
}

// Whether the elements of a kind, first those that it names first, are edges.
const EDGES = KINDS.map((kind) => Array.from(kind, (letter) => letter === "e"));

// The bodies that a list names whose elements of the kind have other numbers in one of two answers.
function renumbered({ rows, kinds, length }, [then, now]) {
  const bodies = new Set();
  for (let ix = 0; ix < length; ix += 1) {
    for (const side of [0, 1]) {
      const of = rows[4 * ix + 2 * side];
      const part = kinds !== undefined && EDGES[kinds[ix]][side] ? "edges" : "elements";
      const [before, after] = [then, now].map(({ numbered }) => numbered.get(of)?.[part] ?? 0);
      if (before !== after) bodies.add(`${of} ${part}`);
    }
  }
  return bodies;
}

// Refuses two answers of which the numbers do not name the same elements.
function mustCompare(list, old) {
  const both = [old, list].map((of) => numbering.get(of));
  const [then, now] = both;
  if (then === undefined || now === undefined) return;
  if (then.of !== now.of) refuse("old: an answer about another scene given, those about the same scene allowed");
  if (then.numbered === now.numbered) return;
  const named = renumbered(list, both);
  const part = [...renumbered(old, both)].find((part) => named.has(part));
  if (part === undefined) return;
  refuse(`body ${part.split(" ")[0]}: the pairs were found before it was re-meshed or its edges were set, and name other elements`);
}

// What both lists have, and what only the newer or the older one has.
function changesOf(list, old, type) {
  if (!(old instanceof type)) refuse(`old: ${list.constructor.name} are needed, as these are`);
  mustCompare(list, old);
  const [before, after] = [ordered(old), ordered(list)];
  const [kept, added, gone] = [[], [], []];
  for (let was = 0, is = 0; was < before.length || is < after.length; ) {
    const order = was === before.length ? 1 : is === after.length ? -1 : inOrder(before[was], after[is]);
    if (order === 0) kept.push([before[was][0], after[is][0]]);
    else if (order < 0) gone.push(before[was][0]);
    else added.push(after[is][0]);
    was += order <= 0;
    is += order >= 0;
  }
  const flat = (numbers) => Uint32Array.from(numbers.sort((a, b) => a - b));
  return { kept: Uint32Array.from(kept.sort(([a], [b]) => a - b).flat()), new: flat(added), gone: flat(gone) };
}

// What a scene knows of when pairs were found, and the words and numbers of their query.
export let movesOf;
export let queryOf;

export class Pairs extends List {
  #moves;
  #query;
  // Where the rows of each first body are.
  #runs;

  static {
    movesOf = (pairs) => pairs.#moves;
    queryOf = (pairs) => pairs.#query;
  }

  constructor([rows, , , , , hash], stats, moves, { words, numbers }) {
    super(rows);
    remember(this, moves);
    this.#moves = moves;
    this.#query = { words, numbers };
    this.hash = hex(hash);
    this.stats = stats;
  }

  entry(ix) {
    return Array.from(this.rows.subarray(4 * ix, 4 * ix + 4));
  }

  changes(old) {
    return changesOf(this, old, Pairs);
  }

  between(a, b) {
    if (body(a) === body(b)) return new Uint32Array(0);
    // One of the two is always first.
    const found = this.#meeting(a, b, 1, 3);
    return found.length > 0 ? found : this.#meeting(b, a, 3, 1);
  }

  selfOf(which) {
    return this.#meeting(body(which), which, 1, 3);
  }

  colliding(which) {
    const found = new Set();
    body(which);
    for (let at = 0; at < this.rows.length; at += 2) if (this.rows[at] === which) found.add(this.rows[at + 1]);
    return Uint32Array.from(found).sort();
  }

  // Two columns of the rows with these bodies.
  #meeting(first, second, one, other) {
    const { rows } = this;
    const [from, to] = this.#run(first);
    const found = new Uint32Array((to - from) / 2);
    let n = 0;
    for (let at = from; at < to; at += 4) {
      if (rows[at + 2] !== second) continue;
      found[n] = rows[at + one];
      found[n + 1] = rows[at + other];
      n += 2;
    }
    return found.slice(0, n);
  }

  #run(first) {
    if (this.#runs === undefined) {
      this.#runs = new Map();
      const { rows } = this;
      for (let from = 0, at = 0; at < rows.length; from = at) {
        while (at < rows.length && rows[at] === rows[from]) at += 4;
        this.#runs.set(rows[from], [from, at]);
      }
    }
    return this.#runs.get(first) ?? [0, 0];
  }
}

// Lists with a kind per row, in the order of kinds.
class OfKinds extends List {
  constructor(rows, kinds, columns) {
    super(rows);
    this.kinds = kinds;
    Object.assign(this, columns);
  }

  // Where the rows of a kind are.
  range(kind) {
    const number = word("kind", kind, KINDS);
    const first = this.kinds.indexOf(number);
    return first < 0 ? [0, 0] : [first, this.kinds.lastIndexOf(number) + 1];
  }

  pair(ix) {
    return { kind: KINDS[this.kinds[ix]], ...element(this.rows, ix) };
  }
}

class CandidateList extends OfKinds {
  of(kind) {
    const [from, to] = this.range(kind);
    return new CandidateList(this.rows.subarray(4 * from, 4 * to), this.kinds.subarray(from, to));
  }

  entry(ix) {
    return this.pair(ix);
  }
}

export class Candidates extends CandidateList {
  constructor([rows, kinds, , , , hash], stats) {
    super(rows, kinds, { hash: hex(hash), stats });
  }
}

class ImpactList extends OfKinds {
  of(kind) {
    const [from, to] = this.range(kind);
    const [toi, atStart] = [this.toi, this.atStart].map((column) => column.subarray(from, to));
    const part = new ImpactList(this.rows.subarray(4 * from, 4 * to), this.kinds.subarray(from, to), { toi, atStart });
    return remember(part, numbering.get(this));
  }

  changes(old) {
    return changesOf(this, old, ImpactList);
  }

  entry(ix) {
    return { ...this.pair(ix), toi: this.toi[ix], atStart: this.atStart[ix] === 1 };
  }
}

// Impacts, and whether the start intersects.
function impacts([rows, bytes, numbers], more) {
  const n = rows.length / 4;
  const startIntersects = [false, true, null][bytes[2 * n]];
  const columns = { toi: numbers.subarray(0, n), atStart: bytes.subarray(n, 2 * n), startIntersects, ...more };
  return [rows, bytes.subarray(0, n), columns];
}

export class Impacts extends ImpactList {
  constructor(lists, stats, moves) {
    super(...impacts(lists, { hash: hex(lists[5]), stats }));
    remember(this, moves);
  }
}

export const earliest = (lists) => new ImpactList(...impacts(lists)).at(0) ?? null;

class NearList extends OfKinds {
  of(kind) {
    const [from, to] = this.range(kind);
    const part = new NearList(this.rows.subarray(4 * from, 4 * to), this.kinds.subarray(from, to), {
      features: this.features.subarray(2 * from, 2 * to),
      parallel: this.parallel.subarray(from, to),
      distances: this.distances?.subarray(from, to) ?? null,
      points: this.points?.subarray(6 * from, 6 * to) ?? null,
    });
    return remember(part, numbering.get(this));
  }

  changes(old) {
    return changesOf(this, old, NearList);
  }

  entry(ix) {
    const { features, parallel, distances, points } = this;
    const pair = { ...this.pair(ix), features: Array.from(features.subarray(2 * ix, 2 * ix + 2)), parallel: parallel[ix] === 1 };
    if (distances !== null) pair.distance = distances[ix];
    if (points !== null) pair.points = twoPoints(points, 6 * ix);
    return pair;
  }
}

const twoPoints = (numbers, at) => [at, at + 3].map((from) => Array.from(numbers.subarray(from, from + 3)));

export class NearPairs extends NearList {
  // Without pairs, columns that were asked for are there and empty.
  constructor([rows, bytes, numbers, , , hash], stats, { hasDistances, hasPoints }, moves) {
    const n = rows.length / 4;
    super(rows, bytes.subarray(0, n), {
      features: bytes.subarray(n, 3 * n),
      parallel: bytes.subarray(3 * n),
      distances: hasDistances ? numbers.subarray(0, n) : null,
      points: hasPoints ? numbers.subarray(n) : null,
      hash: hex(hash),
      stats,
    });
    remember(this, moves);
  }
}

export function nearest([rows, , numbers]) {
  if (rows.length === 0) return null;
  return { distance: numbers[0], ...element(rows, 0), points: twoPoints(numbers, 1) };
}

// Where a step leads.
export class Step {
  #start;
  #positions;

  constructor([, , , words, positions]) {
    const [bodies, start] = sections(words);
    this.#start = start;
    this.#positions = new Map(Array.from(bodies, (of, ix) => [of, positions[ix]]));
  }

  // A copy: what is applied is what was found.
  positions(which) {
    return this.#positions.get(body(which))?.slice() ?? null;
  }

  apply(scene) {
    if (typeof scene?.[TAKE_STEP] !== "function") refuse("scene: a Scene is needed");
    scene[TAKE_STEP](this.#start, this.#positions);
  }
}

export class Advance extends Step {
  constructor(lists, stats) {
    super(lists);
    const [, , numbers] = lists;
    const [, , { startIntersects }] = impacts(lists);
    const [fraction, nTried] = numbers.subarray(-2);
    Object.assign(this, { fraction, nTried, first: earliest(lists), startIntersects, stats });
  }
}

// The sections of a list, each after its length.
export function* sections(words) {
  for (let at = 0; at < words.length; ) {
    const end = at + 1 + words[at];
    yield words.subarray(at + 1, end);
    at = end;
  }
}

const REGION = 21;
const known = (number) => (Number.isNaN(number) ? null : number);

function regionsOf(numbers, parts) {
  return Array.from({ length: numbers.length / REGION }, (_, ix) => {
    const of = Array.from(numbers.subarray(REGION * ix, REGION * (ix + 1)));
    const [contacts, ...inside] = parts.slice(3 * ix, 3 * ix + 3);
    return {
      bodies: of.slice(19),
      contacts,
      position: of.slice(0, 3),
      bounds: [of.slice(3, 6), of.slice(6, 9)],
      length: of[9],
      patchArea: of[10],
      area: of.slice(11, 14),
      normal: Number.isNaN(of[14]) ? null : of.slice(14, 17),
      depth: known(of[17]),
      volume: known(of[18]),
      inside,
    };
  });
}

// By which the module knows contacts, and the pairs of which they are.
export let numberOf;
export let pairsOf;

export class Contacts extends List {
  #number;
  #pairs;
  #curves;
  #regions;

  static {
    numberOf = (contacts) => contacts.#number;
    pairsOf = (contacts) => contacts.#pairs;
  }

  constructor([, bytes, numbers, words], stats, { pairs, number }) {
    super(pairs.rows);
    const [starts, corners, curveStarts, curvePoints, ...parts] = sections(words);
    const [n, nCurves, nNumbers] = [this.length, Math.max(0, curveStarts.length - 1), 3 * numbers[0] + 1];
    this.hash = pairs.hash;
    this.stats = stats;
    this.#number = number;
    this.#pairs = pairs;
    this.shapes = bytes.subarray(0, n);
    this.directed = bytes.subarray(n, 2 * n);
    Object.assign(this, { starts, corners, points: numbers.subarray(1, nNumbers) });
    this.#curves = {
      length: nCurves,
      starts: curveStarts,
      points: curvePoints,
      closed: bytes.subarray(2 * n, 2 * n + nCurves),
      directed: bytes.subarray(2 * n + nCurves),
      lengths: numbers.subarray(nNumbers, nNumbers + nCurves),
    };
    this.#regions = regionsOf(numbers.subarray(nNumbers + nCurves), parts);
  }

  entry(ix) {
    const corners = this.corners.subarray(this.starts[ix], this.starts[ix + 1]);
    return { ...element(this.rows, ix), shape: SHAPES[this.shapes[ix]], corners };
  }

  curves() {
    return this.#curves;
  }

  regions() {
    return this.#regions;
  }
}

export class Penetration {
  constructor([bodies, , numbers, words], stats) {
    const [first, second, ...parts] = sections(words);
    const regions = regionsOf(numbers.subarray(1), parts);
    Object.assign(this, { bodies: Array.from(bodies), inside: [first, second], regions, volume: known(numbers[0]), stats });
  }
}
