// Answers about points, rays and bounds of vertices. They were copied out of the module, so there is nothing to free.

import { Candidates, NearPairs, Step, hex, sections } from "./answers.js";
import { KINDS } from "./query.js";
import { body, refuse, word } from "./shared.js";

const NO_FEATURE = 255;

// Where points lie: a number per point.
export const places = ([, bytes]) => new Int8Array(bytes.buffer, bytes.byteOffset, bytes.length);

// The tetrahedron that contains each point, or -1; or how often a surface winds around it.
export const integers = ([, , , words]) => new Int32Array(words.buffer, words.byteOffset, words.length);

// How far inside each point is.
export const signed = ([, , numbers]) => numbers;

// What is nearest to each point: as many entries as the query says.
export class Closest {
  constructor([rows, features, numbers, , , hash], stats, nNearest) {
    const n = features.length;
    const columns = { distances: numbers.subarray(0, n), points: numbers.subarray(n) };
    Object.assign(this, { nNearest, rows, features, ...columns, hash: hex(hash), stats });
  }

  get length() {
    return this.features.length / this.nNearest;
  }

  at(ix) {
    const point = ix < 0 ? ix + this.length : ix;
    return Number.isInteger(ix) && point >= 0 ? this.#entry(point * this.nNearest) : null;
  }

  of(point) {
    if (!Number.isInteger(point) || point < 0) return [];
    const from = point * this.nNearest;
    return Array.from({ length: this.nNearest }, (_, ix) => this.#entry(from + ix)).filter((of) => of !== null);
  }

  #entry(of) {
    if (!(of in this.features) || this.features[of] === NO_FEATURE) return null;
    return {
      body: this.rows[2 * of],
      element: this.rows[2 * of + 1],
      feature: this.features[of],
      distance: this.distances[of],
      point: Array.from(this.points.subarray(3 * of, 3 * of + 3)),
    };
  }

  *[Symbol.iterator]() {
    for (let ix = 0; ix < this.length; ix += 1) yield this.at(ix);
  }
}

// What rays hit, one ray after the other.
export class Hits {
  constructor([rows, bytes, numbers, words, , hash], stats) {
    const n = rows.length / 2;
    const nRays = bytes.length - n;
    const [offsets] = sections(words);
    Object.assign(this, {
      rows,
      hit: bytes.subarray(0, nRays),
      features: bytes.subarray(nRays),
      t: numbers.subarray(0, n),
      tEnd: numbers.subarray(n, 2 * n),
      barycentrics: numbers.subarray(2 * n),
      offsets,
      hash: hex(hash),
      stats,
    });
  }

  get length() {
    return this.hit.length;
  }

  of(ray) {
    const [from, to] = [this.offsets[ray] ?? 0, this.offsets[ray + 1] ?? 0];
    return Array.from({ length: Math.max(0, to - from) }, (_, ix) => this.#hit(from + ix));
  }

  #hit(ix) {
    return {
      body: this.rows[2 * ix],
      element: this.rows[2 * ix + 1],
      feature: this.features[ix],
      t: this.t[ix],
      tEnd: this.tEnd[ix],
      barycentrics: Array.from(this.barycentrics.subarray(3 * ix, 3 * ix + 3)),
    };
  }
}

// How far each vertex may move.
export class SafeDistances {
  #bounds = new Map();

  constructor([rows, bytes, numbers, words, positions, hash], stats, has) {
    const bodies = [];
    for (let at = 0; at < words.length; at += 3) bodies.push(words.subarray(at, at + 3));
    let at = numbers.length - bodies.reduce((n, [, own]) => n + own, 0);
    this.touching = new NearPairs([rows, bytes, numbers.subarray(0, at), words, positions, hash], stats, has);
    this.stats = stats;
    for (const [which, n, isDouble] of bodies) {
      const own = numbers.subarray(at, at + n);
      this.#bounds.set(which, isDouble === 1 ? own : Float32Array.from(own));
      at += n;
    }
  }

  of(which) {
    return this.#bounds.get(body(which)) ?? refuse(`body: ${which} given, which was not in the scene`);
  }
}

// Where the vertices are after each has gone as far as it may.
export class Truncation extends Step {
  constructor(lists, stats) {
    super(lists);
    const [rows, bytes, [nCut, nTouching, rounds], , , hash] = lists;
    const n = rows.length / 4;
    const pairs = new Candidates([rows, bytes.subarray(0, n), , , , hash], stats);
    Object.assign(this, { nCut, nTouching, rounds, pairs, startIntersects: [false, true, null][bytes[n]], stats });
  }
}

// Kinds whose elements are of one sort: each pair is in the lists of both.
const EVEN = ["ee", "vv", "ff"];

// Which elements are near each element, as lists.
export class Neighbours {
  #firsts = new Map();
  #lists = new Map();

  constructor([, , numbers, words], stats) {
    const [bodies, ...lists] = sections(words);
    this.length = numbers[0];
    this.stats = stats;
    for (let at = 0; at < bodies.length; at += 4) {
      const [of, vertex, edge, face] = bodies.subarray(at, at + 4);
      this.#firsts.set(of, { vertex, edge, face });
    }
    let at = 1;
    const next = () => {
      const [offsets, indices] = lists.splice(0, 2);
      const own = numbers.subarray(at, at + indices.length);
      at += indices.length;
      return { offsets, indices, distances: own };
    };
    for (const kind of KINDS) {
      const own = next();
      this.#lists.set(kind, [own, EVEN.includes(kind) ? own : next()]);
    }
  }

  first(which) {
    return this.#firsts.get(body(which)) ?? refuse(`body: ${which} given, which was not in the scene`);
  }

  of(kind) {
    return this.#lists.get(KINDS[word("kind", kind, KINDS)])[0];
  }

  reversed(kind) {
    return this.#lists.get(KINDS[word("kind", kind, KINDS)])[1];
  }

  get vf() {
    return this.of("vf");
  }

  get fv() {
    return this.reversed("vf");
  }

  get ee() {
    return this.of("ee");
  }
}
