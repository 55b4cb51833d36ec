/// <reference lib="esnext.disposable" />

/** Vertex numbers, three per triangle or four per tetrahedron. */
export type Index = Uint32Array | Uint16Array | Uint8Array;

/** x, y, z per vertex, read as the real numbers that they are. */
export type Positions = Float32Array | Float64Array;

/** The number of a body: 0 for the first one added, and so on. Numbers are not used again. */
export type Body = number;

export interface Options {
  /** How candidates are found. All methods give the same pairs. `"auto"` by default: `"cells"` for large bodies that are new, else `"clusters"`. */
  method?: "auto" | "clusters" | "cells" | "naive";
  /**
   * Self-collision of pairs that share a vertex: reported if they meet in more than the parts that they share
   * (`"resolve"`, the default), or not at all (`"skip"`).
   */
  sharedVertex?: "skip" | "resolve";
}

/** Counts and times of the last answer. The answer never depends on them. */
export interface Statistics {
  /** `"cpu"` or the name of the GPU. */
  backend: string;
  method: string;
  /** Pairs whose boxes overlap. */
  candidates: number;
  /** Candidates that exact arithmetic decided. */
  unsure: number;
  clusters: number;
  /** Bytes that the detector holds. */
  bytesHeld: number;
  /** Milliseconds for the whole answer. */
  totalMs: number;
  /** Milliseconds per stage. */
  stages: Record<string, number>;
}

export interface StepOptions {
  /** Which bodies: none for all bodies and their self-collision (the default), one for its self-collision, two for pairs between them. */
  bodies?: readonly [] | readonly [Body] | readonly [Body, Body];
  /** Without `bodies`: all pairs (`"all"`, the default), or those of different bodies alone (`"between"`). */
  which?: "all" | "between";
  /**
   * Pairs that touch at the start: reported with the time 0 (`"report"`, the default) or not at all (`"skip"`). Surfaces that already
   * pass through each other need not touch at all; with `"verify"` the start is asked for intersections, too, and answers say
   * `startIntersects`. A step whose start intersects is then not free, and `advance` allows none of it.
   */
  start?: "report" | "skip" | "verify";
  /** The precision to which times are rounded down: `"f32"` by default. */
  toi?: "f32" | "f64";
  /** The distance that elements must keep, in the unit of the scene: 0 by default. */
  separation?: number;
  /**
   * What a step leaves between elements, in the unit of the scene: 0 by default. A pair counts as in contact when its distance is at
   * most this, but a pair that is near at the start keeps only a share of its distance there (`clearanceShare`, 0.2 by default).
   */
  clearance?: number;
  /** From 0 to less than 1. */
  clearanceShare?: number;
}

/**
 * Two elements that touch during a step. The kind says which elements: vertex and face (`"vf"`), two edges (`"ee"`). Vertices are
 * numbered as positions are, faces as they were given, edges as unique pairs of vertices `(low, high)` in the order of
 * `(high, low)`.
 */
export interface Impact {
  kind: "vf" | "ee" | "ev" | "vv" | "ef" | "ff";
  bodyA: Body;
  elementA: number;
  bodyB: Body;
  elementB: number;
  /** The first time in [0, 1] at which they touch, rounded down. */
  time: number;
  /** Whether they touch at the start. */
  atStart: boolean;
}

/** All impacts of a step, sorted by kind, bodies and elements. */
export interface Impacts extends Iterable<Impact> {
  readonly length: number;
  at(ix: number): Impact | undefined;
  /** `[bodyA, elementA, bodyB, elementB]` per impact. */
  readonly rows: Uint32Array;
  /** One time per impact. */
  readonly times: Float64Array;
  /** One index into `names` per impact. */
  readonly kinds: Uint8Array;
  readonly names: readonly Impact["kind"][];
  /** 1 for impacts at the start, else 0. */
  readonly atStart: Uint8Array;
  /** Whether elements intersect at the start of the step; `null` unless `start: "verify"` asked. */
  readonly startIntersects: boolean | null;
}

/** How far a step can be taken. */
export interface Advance {
  /** The part of the step that can be taken: 1 for all of it, 0 for none. */
  readonly fraction: number;
  /** The first contact of the whole step, if any; with a clearance, the first time at which a pair is as near as it may come. */
  readonly first: Impact | null;
  /** As in `Impacts`. If it is true, the fraction is 0. */
  readonly startIntersects: boolean | null;
  /** How many fractions were tried. */
  readonly nTried: number;
  /**
   * The positions of a body at that fraction, rounded to the precision in which it has them; `null` for a body that does not move. The
   * straight path to them is free, if the start was free of intersections, and except for pairs that touch at the start.
   */
  positions(body: Body): Positions | null;
  /** Moves the bodies of a detector to these positions. */
  apply(detector: { setPositions(body: Body, positions: Positions): void }): void;
}

/** Vertices, and what they are the corners of. */
export interface Mesh {
  positions: Positions;
  faces?: Index;
  tetrahedra?: Index;
  edges?: Index;
}

/** A mesh of which vertices at the same position have become one. */
export interface Welded<P extends Positions = Positions> {
  mesh: { positions: P; faces?: Uint32Array; tetrahedra?: Uint32Array; edges?: Uint32Array };
  /** For each vertex before the welding, its number after it. */
  map: Uint32Array;
  /** The positions of the welded vertices, taken from those of all vertices, of any frame. */
  positions<Q extends Positions>(positions: Q): Q;
}

/**
 * Welds vertices whose coordinates are equal, without a tolerance. A `BufferGeometry` repeats vertices along seams, and the faces
 * on both sides of a seam touch but are neighbours only once it is welded. Primitives keep their number and order.
 *
 * ```js
 * const { mesh, positions } = weld({ faces: geometry.index.array, positions: geometry.attributes.position.array });
 * const body = detector.add(mesh.faces, mesh.positions);
 * detector.setPositions(body, positions(nextFrame));
 * ```
 */
export function weld<P extends Positions>(mesh: Mesh & { positions: P }): Welded<P>;

/** Everything that a WebAssembly module can be loaded from. */
export type Module = WebAssembly.Module | BufferSource | Response | URL | string;

/**
 * Loads the WebAssembly module. Later calls wait for the first. Without an argument the module is loaded from the
 * folder of this file, in Node too.
 */
export default function init(module?: Module | Promise<Module>): Promise<void>;

/**
 * Finds the primitives that intersect, exactly: touching counts, and there is no tolerance. Errors are `Error`s that
 * name the body, the index and both numbers.
 *
 * ```js
 * import init, { Detector } from "impinge";
 * await init();
 * const detector = new Detector();
 * const a = detector.add(geometry.index.array, geometry.attributes.position.array);
 * ```
 */
export declare class Detector {
  constructor(options?: Options);
  /** Adds a body of triangles and returns its number. */
  add(index: Index, positions: Positions): Body;
  /** Adds a body of tetrahedra and returns its number. */
  addTetrahedra(index: Index, positions: Positions): Body;
  /** Moves the vertices of a body: as many positions as it has vertices. It stands still until it gets end positions. */
  setPositions(body: Body, positions: Positions): void;
  /** Sets the positions at the end of a step. Each vertex moves there on a straight line, from time 0 to time 1. */
  setEndPositions(body: Body, positions: Positions): void;
  /** Removes a body. */
  remove(body: Body): void;
  /** The numbers of primitives and of vertices of a body. */
  size(body: Body): { primitives: number; vertices: number };
  /** Pairs between two bodies: `[i0, j0, i1, j1, …]`, primitive i of `a` and j of `b`, sorted. */
  between(a: Body, b: Body): Uint32Array;
  /** All pairs of different bodies: `[bodyA, i, bodyB, j, …]`, sorted. */
  betweenAll(): Uint32Array;
  /** Self-collision of a body: `[i0, j0, i1, j1, …]`, sorted. */
  within(body: Body): Uint32Array;
  /** All pairs, self-collision included: `[bodyA, i, bodyB, j, …]`, sorted. */
  everything(): Uint32Array;
  /** Which elements touch during a step, and when first. */
  impacts(options?: StepOptions): Impacts;
  /** The earliest impact of a step, or `null` if nothing touches. Faster than `impacts`. */
  earliest(options?: StepOptions): Impact | null;
  /** Whether nothing touches during a step. */
  isFree(options?: StepOptions): boolean;
  /** How far a step can be taken. */
  advance(options?: StepOptions): Advance;
  /** Whether elements intersect at the start of the step that was asked about last; `null` unless `start: "verify"` asked. */
  readonly startIntersects: boolean | null;
  /** The hash of the last set of pairs or impacts, 16 hexadecimal digits: the same on every method, backend and machine. */
  readonly hash: string;
  /** Statistics of the last answer. */
  readonly statistics: Statistics;
  /** Frees the memory. */
  dispose(): void;
  [Symbol.dispose](): void;
}
