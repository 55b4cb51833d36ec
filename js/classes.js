// The classes that both builds have, made of the functions of either module.

import { Advance, Candidates, Contacts, Impacts, NearPairs, Pairs, Penetration, earliest, movesOf, nearest, numberOf, pairsOf, queryOf, statsOf } from "./answers.js";
import { Closest, Hits, Neighbours, SafeDistances, Truncation, integers, places, signed } from "./probe.js";
import { KeptPairs, packed, plain, whole, withPoints } from "./query.js";
import {
  MOVES, TAKE_STEP, body, call, disposable, isList, isSingle, kindOf, list, meshOf, mustBeNone, number, numbers, options,
  refuse, shown, wide, word,
} from "./shared.js";

const PARTS = ["vertices", "edges", "faces"];
const BODY_KINDS = ["points", "edges", "triangles", "tetrahedra"];

// How the arrays of a body are used.
const [ADD, REMESH, POSITIONS, END_POSITIONS] = [0, 1, 2, 3];
const NONE = new Uint32Array(0);

const first = ([, , [found]]) => found;
const yes = (lists) => first(lists) === 1;

let lastContacts = 0;

function instance(given, type, needed) {
  if (!(given instanceof type)) refuse(`${needed} is needed`);
  return given;
}

// How each question is asked: its arguments but the scene, which is `this`, as `{ question, words, numbers, watch, shape }`.
export const QUESTIONS = {
  detect(query) {
    const [moves, asked] = [this[MOVES].now(), packed(query)];
    return { question: 0, ...asked, moves, shape: (lists, stats) => new Pairs(lists, stats, moves, asked) };
  },
  count: (query) => ({ question: 1, ...packed(query), shape: first }),
  any: (query) => ({ question: 2, ...packed(query), shape: yes }),
  impacts(query) {
    const moves = this[MOVES].now();
    return { question: 3, ...packed(query), shape: (lists, stats) => new Impacts(lists, stats, moves) };
  },
  earliest: (query) => ({ question: 4, ...packed(query), shape: earliest }),
  isFree: (query) => ({ question: 5, ...packed(query), shape: yes }),
  advance: (query) => ({ question: 6, ...packed(query), shape: (lists, stats) => new Advance(lists, stats) }),
  candidates: (inflation, query) => ({
    ...{ question: 7, ...packed(query, number("inflation", inflation)) },
    shape: (lists, stats) => new Candidates(lists, stats),
  }),
  near(distance, query) {
    const hasPoints = Boolean(query?.closestPoints);
    const has = { hasPoints, hasDistances: hasPoints || Boolean(query?.distances) };
    const moves = this[MOVES].now();
    const shape = (lists, stats) => new NearPairs(lists, stats, has, moves);
    return { question: 8, ...packed(query, number("distance", distance)), shape };
  },
  distance: (a, b, control) => ({ question: 9, ...plain(Uint32Array.of(body(a), body(b)), control), shape: nearest }),
  contacts(pairs, control) {
    this[MOVES].mustHave("pairs", movesOf(instance(pairs, Pairs, "pairs: what detect() returned")));
    lastContacts = (lastContacts + 1) >>> 0;
    const number = lastContacts;
    const shape = (lists, stats) => new Contacts(lists, stats, { pairs, number });
    return { question: 10, ...aboutPairs(pairs, [number], control), shape };
  },
  penetration(contacts, a, b, control) {
    const pairs = pairsOf(instance(contacts, Contacts, "contacts: what contacts() returned"));
    const asked = aboutPairs(pairs, [numberOf(contacts), body(a), body(b)], control);
    this[MOVES].mustBe(movesOf(pairs), [a, b]);
    return { question: 11, ...asked, shape: (lists, stats) => new Penetration(lists, stats) };
  },
  candidatesInRuns(inflation, each, query) {
    if (typeof each !== "function") refuse("each: a function is needed");
    const most = whole("most", query?.most ?? 1 << 22, 1, Number.MAX_SAFE_INTEGER);
    const hand = (lists) => each(new Candidates(lists));
    const enter = (detector, scene, id, { words, numbers }) => detector.candidates_in_runs(scene, id, words, numbers, most, hand);
    return { enter, ...packed(query, number("inflation", inflation)), shape: (n) => n };
  },
  contains: (which, points, control) => ({ question: 12, ...aboutPoints(which, points, control), shape: places }),
  closest: (points, query) => ({
    ...{ question: 13, ...withPoints(packed(query, query?.most ?? Infinity), [rowsOf("points", points)]) },
    shape: (lists, stats) => new Closest(lists, stats, query?.nNearest ?? 1),
  }),
  cast(origins, directions, query) {
    const rays = [rowsOf("origins", origins), rowsOf("directions", directions)];
    if (origins.length !== directions.length) {
      refuse(`directions: ${directions.length / 3} directions given, as many as the ${origins.length / 3} origins allowed`);
    }
    const shape = (lists, stats) => new Hits(lists, stats);
    return { question: 14, ...withPoints(packed(query, query?.most ?? Infinity), rays), shape };
  },
  safeDistances(most, query) {
    const hasPoints = Boolean(query?.closestPoints);
    const has = { hasPoints, hasDistances: hasPoints || Boolean(query?.distances) };
    return { question: 15, ...packed(query, number("most", most)), shape: (lists, stats) => new SafeDistances(lists, stats, has) };
  },
  truncate: (query) => ({ question: 16, ...packed(query), shape: (lists, stats) => new Truncation(lists, stats) }),
  neighbours: (distance, query) => ({
    ...{ question: 17, ...packed(query, number("distance", distance)) },
    shape: (lists, stats) => new Neighbours(lists, stats),
  }),
  locate: (which, points, control) => ({ question: 19, ...aboutPoints(which, points, control), shape: integers }),
  signedDistance: (which, points, control) => ({ question: 20, ...aboutPoints(which, points, control), shape: signed }),
  windingNumbers: (which, points, control) => ({ question: 21, ...aboutPoints(which, points, control), shape: integers }),
  nearest: (query) => ({ question: 18, ...packed(query, 0, "between"), shape: nearest }),
};

// A question about a body and points.
const aboutPoints = (which, points, control) => withPoints(plain(Uint32Array.of(body(which)), control), [rowsOf("points", points)]);

// x, y, z of points.
function rowsOf(name, given) {
  isSingle(given);
  if (given.length % 3 === 0) return given;
  return refuse(`${name}: ${given.length} numbers given, not a multiple of 3`);
}

// The settings of a detector, as the module takes them.
export function settings(given) {
  const { method = "auto", recluster = "auto", memoryBudget, maxPairs, reuseMargin = 0, ...others } = options("settings", given);
  mustBeNone("settings", others, ["method", "recluster", "memoryBudget", "maxPairs", "reuseMargin"]);
  const words = [
    word("method", method, ["auto", "clusters", "cells", "naive"]),
    word("recluster", recluster, ["auto", "never"]),
  ];
  if (!(number("reuseMargin", reuseMargin) >= 0 && reuseMargin < Infinity)) {
    refuse(`reuseMargin: ${reuseMargin} given, a finite number that is not below 0 allowed`);
  }
  return [...words, limit("memoryBudget", memoryBudget), limit("maxPairs", maxPairs), reuseMargin];
}

// A limit, or -1 for none.
function limit(name, given) {
  if (given === undefined) return -1;
  if (given === Infinity) return given;
  return whole(name, given, 0, Number.MAX_SAFE_INTEGER, " or Infinity");
}

// A matrix, column by column.
function columns(matrix) {
  const given = isList(matrix) ? numbers("transform", matrix) : null;
  if (given?.length === 16) return given;
  const what = given === null ? kindOf(matrix) : `${given.length} numbers`;
  return refuse(`transform: ${what} given, 16 numbers allowed, column by column, as elements of a Matrix4`);
}

// 64 bits, of a number or a bigint. -1 has all of them.
function bitsOf(name, given) {
  const bits = typeof given === "bigint" ? given : Number.isInteger(given) ? BigInt(given) : null;
  if (bits !== null && bits >= -(2n ** 63n) && bits < 2n ** 64n) return BigInt.asUintN(64, bits);
  return refuse(`${name}: ${shown(given)} given, a whole number of 64 bits is needed`);
}

// The query that found pairs, with its length, then numbers, then the rows of the pairs.
function aboutPairs(pairs, given, control) {
  const { words: query, numbers } = queryOf(pairs);
  const words = new Uint32Array(1 + query.length + given.length + pairs.rows.length);
  words.set([query.length, ...query, ...given]);
  words.set(pairs.rows, words.length - pairs.rows.length);
  return { ...plain(words, control), numbers };
}

// The kind of a mesh's elements by the number of their corners, its index and its positions.
function arrays(mesh) {
  const { positions, faces, tetrahedra, edges } = meshOf(mesh);
  const given = [[1, edges], [2, faces], [3, tetrahedra]].filter(([, index]) => index !== undefined);
  if (given.length > 1) refuse("mesh: elements of several kinds given, one of faces, tetrahedra and edges allowed");
  const [[kind, index] = [0, NONE]] = given;
  return [kind, wide(index), positions];
}

// When the bodies of a scene were moved last: contacts are about positions that bodies may no longer have. And when their elements, and
// their edges alone, were given other numbers.
class Moves {
  #n = 0;
  #last = new Map();
  // When its groups, or which vertices are pinned, were set.
  #marked = new Map();
  // Answers keep it: another one is made for each change.
  #numbered = new Map();

  add(which) {
    this.#n += 1;
    this.#last.set(which, this.#n);
  }

  mark(which) {
    this.#n += 1;
    this.#marked.set(which, this.#n);
  }

  renumber(which, edgesAlone) {
    this.#n += 1;
    const elements = edgesAlone ? (this.#numbered.get(which)?.elements ?? 0) : this.#n;
    this.#numbered = new Map(this.#numbered).set(which, { elements, edges: this.#n });
  }

  forget(which) {
    this.#last.delete(which);
    this.#marked.delete(which);
    if (!this.#numbered.has(which)) return;
    this.#numbered = new Map(this.#numbered);
    this.#numbered.delete(which);
  }

  now() {
    return { of: this, n: this.#n, numbered: this.#numbered };
  }

  // What was found in another scene says nothing about this one.
  mustHave(what, { of }) {
    if (of !== this) refuse(`${what}: ${what} of another scene given, those of this scene allowed`);
  }

  mustBe(then, bodies) {
    this.mustHave("contacts", then);
    const { n } = then;
    const moved = bodies.find((which) => this.#last.get(which) > n);
    if (moved !== undefined) refuse(`body ${moved}: this was found for other positions than it has now, so nothing is known of it; ask again`);
    const marked = bodies.find((which) => this.#marked.get(which) > n);
    if (marked !== undefined) refuse(`body ${marked}: its groups or pinned vertices were set after the pairs were found; ask again`);
  }
}

// What the module is answering a question with: freed meanwhile, it would be lost before the module could refuse.
const busy = new Set();

export function free(handle) {
  if (busy.has(handle)) refuse("dispose: a scene or a detector is used while it answers a question");
  call(() => handle?.free());
}

export function makeScene({ SceneHandle }, mustBeReady) {
  let handleOf;
  class Scene {
    #handle;
    #moves = new Moves();

    static {
      handleOf = (scene) => instance(scene, Scene, "scene: a Scene of the same module").#held;
    }

    constructor() {
      mustBeReady();
      this.#handle = new SceneHandle();
    }

    get #held() {
      return this.#handle ?? refuse("this scene has been disposed of");
    }

    get [MOVES]() {
      return this.#moves;
    }

    #put(use, which, kind, index, positions) {
      const handle = this.#held;
      const put = isSingle(positions) ? "put_f32" : "put_f64";
      const number = call(() => handle[put](use, which, kind, index, positions));
      if (use !== END_POSITIONS) this.#moves.add(number);
      return number;
    }

    add(mesh) {
      return this.#put(ADD, 0, ...arrays(mesh));
    }

    addTriangles(faces, positions) {
      return this.#put(ADD, 0, 2, wide(faces), positions);
    }

    addTetrahedra(tetrahedra, positions) {
      return this.#put(ADD, 0, 3, wide(tetrahedra), positions);
    }

    addEdges(edges, positions) {
      return this.#put(ADD, 0, 1, wide(edges), positions);
    }

    addPoints(positions) {
      return this.#put(ADD, 0, 0, NONE, positions);
    }

    remove(which) {
      call(() => this.#held.remove(body(which)));
      this.#moves.forget(which);
    }

    remesh(which, mesh) {
      this.#put(REMESH, body(which), ...arrays(mesh));
      this.#moves.renumber(which, false);
    }

    setPositions(which, positions) {
      this.#put(POSITIONS, body(which), 0, NONE, positions);
    }

    setEndPositions(which, positions) {
      if (positions === null) call(() => this.#held.clear_end_positions(body(which)));
      else this.#put(END_POSITIONS, body(which), 0, NONE, positions);
    }

    [TAKE_STEP](start, positions) {
      call(() => this.#held.take_step(start, Uint32Array.from(positions.keys()), [...positions.values()]));
      for (const which of positions.keys()) this.#moves.add(which);
    }

    setTransform(which, matrix) {
      call(() => this.#held.set_transform(body(which), columns(matrix)));
      this.#moves.add(which);
    }

    setEndTransform(which, matrix) {
      call(() => this.#held.set_end_transform(body(which), columns(matrix)));
    }

    setFilter(which, category = 1, mask = 0xffff_ffff_ffff_ffffn) {
      const bits = Object.entries({ category, mask }).map((entry) => bitsOf(...entry));
      call(() => this.#held.set_filter(body(which), ...bits));
    }

    setThickness(which, thickness, part = "vertices") {
      const of = word("part", part, PARTS);
      if (typeof thickness !== "object" || thickness === null) {
        call(() => this.#held.set_thickness(body(which), number("thickness", thickness)));
      } else {
        call(() => this.#held.set_element_thickness(body(which), of, numbers("thickness", thickness)));
      }
    }

    setEdges(which, edges) {
      const before = this.edges(which);
      call(() => this.#held.set_edges(body(which), edges === null ? new Uint32Array() : wide(edges, "edges")));
      if (this.edges(which).some((vertex, ix) => vertex !== before[ix])) this.#moves.renumber(which, true);
    }

    setGroups(which, groups) {
      call(() => this.#held.set_groups(body(which), wide(groups, "groups")));
      this.#moves.mark(which);
    }

    setPinned(which, pinned) {
      const flags = list("pinned", pinned).map((of) => ([true, false, 1, 0].includes(of) ? Number(of) : refuse(`pinned: ${shown(of)} given, true or false is needed`)));
      call(() => this.#held.set_pinned(body(which), Uint8Array.from(flags)));
      this.#moves.mark(which);
    }

    restPairs(distance) {
      const next = KeptPairs.next();
      const n = call(() => this.#held.rest_pairs(next, number("distance", distance)));
      return new KeptPairs(next, n, () => call(() => this.#handle?.forget_pairs(next)));
    }

    vertexPairs(which, offsets, vertices, other = which) {
      const next = KeptPairs.next();
      const lists = [wide(offsets, "offsets"), wide(vertices, "vertices")];
      call(() => this.#held.vertex_pairs(next, body(which), body(other), ...lists));
      return new KeptPairs(next, lists[1].length, () => call(() => this.#handle?.forget_pairs(next)));
    }

    #size(which) {
      return call(() => this.#held.size(body(which)));
    }

    kind(which) {
      return BODY_KINDS[this.#size(which)[0] - 1];
    }

    nElements(which) {
      return this.#size(which)[1];
    }

    nVertices(which) {
      return this.#size(which)[2];
    }

    #index(which, part) {
      return call(() => this.#held.index(body(which), part));
    }

    elements(which) {
      return this.#index(which, 0);
    }

    edges(which) {
      return this.#index(which, 1);
    }

    faces(which) {
      return this.#index(which, 2);
    }

    #positions(which, when) {
      return call(() => this.#held.positions(body(which), when)) ?? null;
    }

    positions(which) {
      return this.#positions(which, 0);
    }

    endPositions(which) {
      return this.#positions(which, 1);
    }

    restPositions(which) {
      return this.#positions(which, 2);
    }

    get bodies() {
      return call(() => Array.from(this.#held.bodies()));
    }

    dispose() {
      free(this.#handle);
      this.#handle = null;
    }
  }
  disposable(Scene);
  return { Scene, handleOf };
}

// Asks the module at once: the answer and its stats. `detector` and `scene` are the module's.
export function ask(detector, scene, { question, enter, words, numbers, watch, shape }) {
  const asked = enter ?? ((on, of, id) => on.ask(question, of, id, words, numbers));
  // A callback may ask another detector about the same scene.
  const taken = [detector, scene].filter((handle) => !busy.has(handle));
  for (const handle of taken) busy.add(handle);
  try {
    const lists = watch.during((id) => call(() => asked(detector, scene, id, { words, numbers })));
    const stats = statsOf(detector.stats(false));
    return { answer: shape(lists, stats), stats };
  } finally {
    for (const handle of taken) busy.delete(handle);
  }
}

// Gives a class a method per question. `answer(detector, question, scene, asked)` has the answer.
export function answering(type, answer) {
  for (const question of Object.keys(QUESTIONS)) {
    const value = { [question](scene, ...rest) { return answer(this, question, scene, () => QUESTIONS[question].apply(scene, rest)); } }[question];
    Object.defineProperty(type.prototype, question, { value, writable: true, configurable: true });
  }
}
