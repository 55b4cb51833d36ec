/// <reference lib="esnext.disposable" />

/** Any typed array: what `array` of an attribute of three.js is declared as. Those that are not taken are refused by name. */
export type TypedArray = ArrayBufferView & ArrayLike<number>;

/**
 * Vertex numbers, two per edge, three per triangle, four per tetrahedron: a `Uint32Array`, a `Uint16Array` or a `Uint8Array`. Typed arrays may
 * be those of another window.
 */
export type Index = TypedArray;

/** x, y, z per vertex, in the unit of the scene, read as the real numbers that they are. */
export type Positions = Float32Array | Float64Array;

/** Positions as they are given: a `Float32Array` or a `Float64Array`. Those of an interleaved attribute have other numbers between them. */
export type GivenPositions = Positions | TypedArray;

/** x, y, z. */
export type Vec3 = readonly [number, number, number];

/** The number of a body of a scene: 0 for the first one added, and so on. Numbers are not used again. */
export type Body = number;

/**
 * Which elements a pair has: vertex and face (`"vf"`), two edges (`"ee"`), edge and vertex (`"ev"`), two vertices (`"vv"`), edge and
 * face (`"ef"`), two faces (`"ff"`). The first letter is that of `elementA`.
 */
export type PairKind = "vf" | "ee" | "ev" | "vv" | "ef" | "ff";

/** The kinds that `kinds` of an answer refer to by number. */
export declare const KINDS: readonly PairKind[];

/**
 * The shapes that `shapes` of contacts refer to by number. `"solid"`: one of the two is a tetrahedron. `"apart"`: they do not meet, because
 * the scene has moved since the pairs were found.
 */
export declare const SHAPES: readonly ["solid", "apart", "point", "segment", "polygon"];

/** Why a call failed. After every error but `"internal"`, scenes and detectors stay usable. */
export declare class ImpingeError extends Error {
  readonly code: "invalid" | "out_of_memory" | "budget" | "too_many_pairs" | "cancelled" | "device" | "internal";
}

/** Vertices, and what they are the corners of: faces, tetrahedra, edges, or without any of these each vertex is a point. */
export interface Mesh {
  faces?: Index;
  tetrahedra?: Index;
  edges?: Index;
  positions: GivenPositions;
}

/** A mesh of which vertices at the same position have become one. */
export interface Welded<P extends GivenPositions = Positions> {
  mesh: { positions: P; faces?: Uint32Array; tetrahedra?: Uint32Array; edges?: Uint32Array };
  /** For each vertex before the welding, its number after it. */
  map: Uint32Array;
  /** The positions of the welded vertices, taken from those of all vertices, of any frame. */
  positions<Q extends GivenPositions>(positions: Q): Q;
}

/**
 * Welds vertices whose coordinates are equal, without a tolerance. A `BufferGeometry` repeats vertices along seams, and the faces
 * on both sides of a seam touch but are neighbours only once it is welded. Elements keep their number and order.
 *
 * The vertices of a seam may differ in their last digits, as those of a sphere of three.js do, where sin(2 pi) is not 0: then round
 * them before.
 *
 * ```js
 * const rounded = (positions) => positions.map((x) => Math.round(x * 1e6) / 1e6);
 * const { mesh, positions } = weld({ faces: geometry.index.array, positions: rounded(geometry.attributes.position.array) });
 * const body = scene.add(mesh);
 * scene.setPositions(body, positions(rounded(nextFrame)));
 * ```
 */
export function weld<P extends GivenPositions>(mesh: Mesh & { positions: P }): Welded<P>;

/** What a WebAssembly module can be loaded from: its address, in Node a path, too; its bytes; a `Response`; a `WebAssembly.Module`. */
export type Module = string | ArrayBufferView | ArrayBufferLike | object;

/**
 * Loads the WebAssembly module. Later calls wait for the first. Without an argument the module is loaded from the
 * folder of this file, in Node too.
 */
export default function init(module?: Module | Promise<Module>): Promise<void>;

/** What watches a question while it is answered. */
export interface Control {
  /**
   * Looked at before the question, and whenever `progress` is or would be called: once it is aborted, the question fails with the code
   * `"cancelled"`.
   */
  signal?: AbortSignal;
  /**
   * Called from time to time with units of work, done and all; `false` stops the question. Units differ by stage. While pairs are
   * searched this is mostly every 100 ms or less, but no interval is promised: some stages, such as the last ones of `impacts`, `near`,
   * `candidates` and `truncate`, run to their end without a call.
   */
  progress?: (done: number, total: number) => boolean | void;
}

/**
 * Which pairs are asked for, and how: one value for every question. A question that cannot honour one of the options of which pairs
 * refuses it by name; one that has no use for one of the others ignores it. Fields that do not exist are refused.
 */
export interface Query extends Control {
  /** All pairs (the default), those of different bodies, or self-collision. At most one of `which`, `between`, `selfOf` and `of`. */
  which?: "all" | "between" | "self";
  /** Pairs between two bodies, whatever their filters say. */
  between?: readonly [Body, Body];
  /** Self-collision of one body. */
  selfOf?: Body;
  /** All pairs of one body: with the others, whatever their filters say, and with itself. */
  of?: Body;
  /**
   * Kinds of pairs; `detect`, `count` and `any` have their own. Otherwise `"vf"` and `"ee"`; `"ev"` where neither of the two bodies has
   * faces; `"vv"` where both are bodies of points; in `near` and `neighbours` also `"ef"`. Kinds that are named here count for all bodies.
   * Steps have no `"ef"` and `"ff"`. Of tetrahedra, only the faces, edges and vertices of their border take part: what is inside is not
   * near anything. `distance` and `detect` take them as solid. Vertices of a mesh that no element has take no part.
   */
  kinds?: readonly PairKind[];
  /**
   * Pairs of one body that share a vertex: reported if they meet in more than what they share (`"resolve"`, the default), or not at
   * all (`"skip"`). `"resolve"` always reports two with the same vertices, such as a face that is there twice.
   * For triangles and tetrahedra: edges and points of one body that share a vertex are not reported under either rule.
   * Vertices, edges and faces of `near`, `candidates` and steps that share a vertex never count.
   */
  sharedVertex?: "resolve" | "skip";
  /**
   * Pairs that are left out: those of two bodies; with the same body twice, its self-collision; with `{ rings: n }` the pairs of one
   * body that are near in its surface: some vertex of one element is at most n edges, 0 to 16, away from some vertex of the other; with
   * `{ groups: [g, h] }` those of two groups of vertices, or of one with itself, see `setGroups`: each vertex of one element and each
   * vertex of the other must be in such groups, where several exclusions of groups are one rule, not each its own; or those of `scene.restPairs()` and
   * `scene.vertexPairs()`. Answers of `near` are not taken.
   * Nothing is proven of pairs that are left out: a step that is free, or that `truncate`, `advance` or `safeDistances` allow, may take them
   * through each other.
   */
  exclude?: readonly Exclusion[];
  /** Only pairs of the half-open box from a low to a high corner: that of the larger of the lower corners of both elements' boxes. */
  ownedBy?: readonly [Vec3, Vec3];
  /**
   * Pairs that touch at the start of a step: reported with the time 0 (`"report"`, the default) or not at all (`"skip"`). Surfaces that
   * already pass through each other need not touch at all; with `"verify"` the start is asked for intersections, too, and answers say
   * `startIntersects`. A step whose start intersects is then not free, and `advance` allows none of it.
   */
  start?: "report" | "skip" | "verify";
  /** A length, 0 by default: in a step, a pair this near counts as touching. The thickness of both elements adds to it. */
  separation?: number;
  /**
   * A length, 0 by default: what a step leaves between elements. A pair whose distance at the start is d keeps
   * `separation + Math.min(clearance, clearanceShare * (d - separation))`: the clearance if it starts five times as far away or farther,
   * else a fifth of what it has. It counts as in contact when its distance is at most that.
   */
  clearance?: number;
  /** That share: from 0 to less than 1, 0.2 by default. */
  clearanceShare?: number;
  /**
   * The precision to which the times of `impacts` and `earliest` are rounded down: `"f32"` by default. `advance` ignores it: the time of
   * its first contact is rounded down to f64, and with a clearance to f32.
   */
  precision?: "f32" | "f64";
  /** `near`: with the distance of each pair. */
  distances?: boolean;
  /** `near`: with distances and nearest points. */
  closestPoints?: boolean;
  /**
   * `safeDistances`: bodies that do not move, and leave the whole distance to what is near them. Steps (`truncate`, `advance`) ignore it:
   * what stands still there is a body without end positions.
   */
  fixed?: readonly Body[];
  /** `cast`: the first hit of each ray (`"first"`, the default), whether there is any, or all. */
  hits?: "first" | "any" | "all";
  /** `closest`: how many nearest elements of each point, 1 by default. */
  nNearest?: number;
  /**
   * `closest`: a length, nothing farther away is found. `cast`: the largest t, 1 for segments. Infinity by default. `candidatesInRuns`: how
   * many candidates a run has at most, 4,194,304 by default.
   */
  most?: number;
}

/** What a query leaves out. */
export type Exclusion = readonly [Body, Body] | { readonly rings: number } | { readonly groups: readonly [number, number] } | RestPairs;

/** Pairs of elements that were near when `scene.restPairs()` was asked, or whose vertices `scene.vertexPairs()` lists, to be left out of later questions about that scene. */
declare class RestPairs {
  private constructor();
  #number;
  /** How many there are; of `vertexPairs`, how many vertices are listed. */
  readonly length: number;
  /** Lets the scene forget them; refused while a question about it is answered. So does it once they are collected as garbage, whenever that is. */
  dispose(): void;
  [Symbol.dispose](): void;
}
export type { RestPairs };

/**
 * Bodies, and where their vertices are. Topology is given once, positions each frame. Arrays are copied.
 *
 * ```js
 * import init, { Detector, Scene } from "impinge";
 * await init();
 * const scene = new Scene(), detector = new Detector();
 * const a = scene.addTriangles(geometry.index.array, geometry.attributes.position.array);
 * ```
 */
export declare class Scene {
  constructor();
  /** Adds a body. A mesh that was read can be given as it is. */
  add(mesh: Mesh): Body;
  addTriangles(faces: Index, positions: GivenPositions): Body;
  /**
   * Whether elements intersect is asked of tetrahedra themselves; distances, steps, points and rays are about their surface, the faces that are
   * not between two of them. It does not bound a body where a tetrahedron is turned inside out, so nothing stops at such a face.
   */
  addTetrahedra(tetrahedra: Index, positions: GivenPositions): Body;
  /** Edges such as strands of hair. */
  addEdges(edges: Index, positions: GivenPositions): Body;
  addPoints(positions: GivenPositions): Body;
  /**
   * Removes a body. The next one that is added takes its place in the order of answers, of which hashes are made, and among those at the
   * same distance or time, though its number is new. Where these types say that something is sorted by bodies, or that the lowest body
   * counts, that is the order of these places: the order of numbers until a body is added after a removal.
   */
  remove(body: Body): void;
  /**
   * Gives a body new elements and positions. Its filter stays, and its thickness if it is one number. The end of its step, its transform, the
   * thickness, groups and pins of its parts and your numbers of edges are forgotten.
   */
  remesh(body: Body, mesh: Mesh): void;
  /** Moves the vertices of a body: as many positions as it has vertices. It stands still until it gets end positions. */
  setPositions(body: Body, positions: GivenPositions): void;
  /** Sets the positions at the end of a step, to which each vertex moves on a straight line from time 0 to time 1; `null`: it stands still. */
  setEndPositions(body: Body, positions: GivenPositions | null): void;
  /** Moves a body from the positions that were given last: 16 numbers, column by column, as `elements` of a `Matrix4`; affine. */
  setTransform(body: Body, matrix: ArrayLike<number>): void;
  /**
   * Sets the end of a step by a matrix, from the positions that were given last. Each vertex goes straight to its rounded end position, not along an arc: a point at
   * distance r from the axis of a turn by w radians is at most r * w * w / 8 away from where it would be.
   */
  setEndTransform(body: Body, matrix: ArrayLike<number>): void;
  /**
   * Different bodies meet if the category of each shares a bit with the mask of the other, where a query names no bodies; 64 bits. Category 1 and
   * all bits by default. Self-collision does not depend on it.
   */
  setFilter(body: Body, category?: number | bigint, mask?: number | bigint): void;
  /**
   * A length that each element of this body adds to the distance of `near`, to the `separation` that elements keep in a step, and to the gap that boxes of `candidates` may
   * have; it is taken from the distances of `neighbours` and `safeDistances`. One number, or one per vertex, edge or face. With one per vertex, edges and faces are as thick
   * as the thickest of their vertices; otherwise other elements are as thick as the thickest of these that they have or are part of.
   */
  setThickness(body: Body, thickness: number | ArrayLike<number>, part?: "vertices" | "edges" | "faces"): void;
  /**
   * Numbers the edges of a body as its caller does: edge i of answers, of `edges` and of `setThickness` is row i, two vertices. Every edge of the surface must be there
   * once, in any order. `null`: the library's own numbers again. Set them before the first question: afterwards `RestPairs` of edges from before are refused.
   * Hashes of answers are of these numbers, too.
   */
  setEdges(body: Body, edges: Index | null): void;
  /** Puts each vertex of a body into a group, for `exclude: [{ groups: [g, h] }]`. A body whose groups were never set is in none. */
  setGroups(body: Body, groups: Index): void;
  /**
   * Which vertices of a body never move, one of 0, 1, false, true for each. Pairs of elements all of whose vertices are pinned are left out of every question, but for
   * `distance` and `nearest`, which look at all elements. `remesh` forgets it.
   */
  setPinned(body: Body, pinned: ArrayLike<number | boolean>): void;
  /**
   * The pairs of elements that are within a distance of each other now, mostly at rest, to be left out of later questions by `exclude`. They
   * are of the kinds that `near` has if none are named: `"vf"`, `"ee"`, edges with faces that they meet (`"ef"`), and between bodies without
   * faces `"ev"` and `"vv"` as said at `kinds`. Pairs of other kinds, which a query must name, are left out by bodies, rings or groups alone.
   * `detect`, `count` and `any` leave out two of the elements that they are about, such as faces, if some corners, edges or faces of theirs
   * are such a pair. Positions and thickness alone count: neither pinned vertices nor filters nor groups. Nothing is proven of pairs that are
   * left out: they may pass through each other.
   * The scene keeps them until either is disposed of, or the pairs are collected as garbage. Questions about another scene refuse them.
   */
  restPairs(distance: number): RestPairs;
  /**
   * Pairs of elements of which some vertices are listed together, to be left out of later questions by `exclude`: what is sewn or glued
   * together, or handled in another way. The list of vertex v of `body` is `vertices` from `offsets[v]` to `offsets[v + 1]`, vertices of
   * `other`, or of the same body if it is left out. Both are arrays of whole numbers, such as `Uint32Array`; lists need not be sorted.
   * Whether they fit the bodies is checked when something is asked. They are kept as those of `restPairs`, and nothing is proven of them, either.
   */
  vertexPairs(body: Body, offsets: Index, vertices: Index, other?: Body): RestPairs;
  kind(body: Body): "points" | "edges" | "triangles" | "tetrahedra";
  nElements(body: Body): number;
  nVertices(body: Body): number;
  /** Copies of what the body has. */
  positions(body: Body): Positions;
  /** `null` for a body that stands still. */
  endPositions(body: Body): Positions | null;
  /** The positions that were given last, before any transform. */
  restPositions(body: Body): Positions;
  /** The vertices of the elements that the body was given as. */
  elements(body: Body): Uint32Array;
  /** The vertices of its edges: two per edge, in the order of their numbers. */
  edges(body: Body): Uint32Array;
  /** The vertices of its faces: three per face, in the order of their numbers. */
  faces(body: Body): Uint32Array;
  /** The numbers of all bodies. */
  readonly bodies: Body[];
  /** Frees the memory. Refused while a question about this scene is answered; those of `impinge/webgpu` are about a copy. */
  dispose(): void;
  [Symbol.dispose](): void;
}

export interface Settings {
  /** How candidates are found. All methods give the same pairs. `"auto"` by default: `"cells"` for large bodies that are new, else `"clusters"`. */
  method?: "auto" | "clusters" | "cells" | "naive";
  /** Whether bodies are clustered again after they have flowed far: `"auto"` by default. */
  recluster?: "auto" | "never";
  /**
   * Bytes that the detector may hold for a question, the answer included: a whole number up to 2^53 - 1, or `Infinity`. It keeps memory for the next question of the same sort (pairs and
   * steps, distances, points and rays, contacts), and the budget holds for each of these alone.
   */
  memoryBudget?: number;
  /** The most pairs that an answer may have, a whole number up to 2^53 - 1, or `Infinity`: with more, the question fails with the code `"too_many_pairs"`. */
  maxPairs?: number;
  /**
   * A finite distance, for solvers that ask again and again while little moves. If it is above 0, questions about near pairs list those within their
   * distance and this margin, and look at no others until some vertex has moved farther than half of it, or anything but positions has
   * changed. The answers are the same.
   */
  reuseMargin?: number;
}

/** Counts and times of an answer. The answer never depends on them. */
export interface Stats {
  /** `"cpu"` or the name of the GPU. */
  backend: string;
  method: string;
  /** Milliseconds for the whole answer. */
  totalMs: number;
  nThreads: number;
  nSubdivided: number;
  nEntries: number;
  nClusters: number;
  nCulled: number;
  nWorkItems: number;
  /** Pairs whose boxes overlap. */
  nCandidates: number;
  /** Candidates that exact arithmetic decided. */
  nUnsure: number;
  nClustered: number;
  nReclustered: number;
  nBatches: number;
  nPieces: number;
  nReruns: number;
  /** Bytes that the detector holds for questions of this sort, as said at `memoryBudget`; not what it keeps for others. */
  bytesHeld: number;
  /** Milliseconds per stage. */
  stages: Record<string, number>;
}

/** Entries with a row each, sorted. They are copied out of the module: they stay as they are, and nothing has to be freed. */
export interface List<Entry> extends Iterable<Entry> {
  readonly length: number;
  /** `[bodyA, elementA, bodyB, elementB]` per entry. */
  readonly rows: Uint32Array;
  /** One entry; counted from the end if `ix` is negative. */
  at(ix: number): Entry | undefined;
}

export interface Answer {
  /** 16 hexadecimal digits: the same on every method, backend and machine. */
  readonly hash: string;
  readonly stats: Stats;
}

/** The pairs of an answer beside those of an older one, as indices that ascend. */
export interface Changes {
  /** `[old, new, old, new, …]`: pairs that both have. */
  readonly kept: Uint32Array;
  /** Of the newer answer: pairs that the older one does not have. */
  readonly new: Uint32Array;
  /** Of the older answer: pairs that the newer one does not have. */
  readonly gone: Uint32Array;
}

/** Pairs that intersect, sorted by bodies and elements; after a removal see `Scene.remove`. */
export interface Pairs extends Answer, List<[Body, number, Body, number]> {
  /** `[i0, j0, i1, j1, …]`: element i of `a` and element j of `b`. */
  between(a: Body, b: Body): Uint32Array;
  /** `[i0, j0, i1, j1, …]`: elements of one body, i < j. */
  selfOf(body: Body): Uint32Array;
  /** The elements of a body that are in any pair: sorted, each once. */
  colliding(body: Body): Uint32Array;
  /**
   * Which pairs an older answer also has, which are new, and which are gone. Pairs are the same if their bodies and elements are. Refused
   * of answers about another scene, and where both have pairs with elements of the same sort (vertices, edges or faces) of a body that was re-meshed
   * between them, or with edges of it that were set.
   */
  changes(old: Pairs): Changes;
}

/**
 * Two elements. Vertices are numbered as positions are; faces as they were given, those of tetrahedra by tetrahedron, then by the
 * opposite corner; edges as they were given, those of faces as unique pairs of vertices `(low, high)` in the order of `(high, low)`.
 */
export interface Candidate {
  kind: PairKind;
  bodyA: Body;
  elementA: number;
  bodyB: Body;
  elementB: number;
}

/** Entries sorted by kind, bodies and elements; after a removal see `Scene.remove`. */
export interface OfKinds<Entry> extends List<Entry> {
  /** One index into `KINDS` per entry. */
  readonly kinds: Uint8Array;
}

export interface CandidateList extends OfKinds<Candidate> {
  /** Those of one kind, a part of this list. */
  of(kind: PairKind): CandidateList;
}

/** Some of the candidates, of which others are in other runs. */
export interface CandidateRun extends CandidateList {
  /** 16 hexadecimal digits. */
  readonly hash: string;
}

/** Pairs of elements whose boxes overlap. */
export interface Candidates extends Answer, CandidateList {}

/** Two elements that touch during a step. */
export interface Impact extends Candidate {
  /** The first time in [0, 1] at which they touch, rounded down. */
  toi: number;
  /** Whether they touch at the start. */
  atStart: boolean;
}

export interface ImpactList extends OfKinds<Impact> {
  /** One time per impact. */
  readonly toi: Float64Array;
  /** 1 for impacts at the start, else 0. */
  readonly atStart: Uint8Array;
  /** Those of one kind, a part of this list. */
  of(kind: PairKind): ImpactList;
  /** As that of `Pairs`; also of lists of one kind. */
  changes(old: ImpactList): Changes;
}

/** All impacts of a step. */
export interface Impacts extends Answer, ImpactList {
  /** Whether elements intersect at the start of the step; `null` unless `start: "verify"` asked. */
  readonly startIntersects: boolean | null;
}

/** How far a step can be taken. */
export interface Advance {
  /** The part of the step that can be taken: 1 for all of it, 0 for none. */
  readonly fraction: number;
  /**
   * The first contact of the whole step, if any, its time rounded down to f64; with a clearance, the first time at which a pair is as near
   * as it may come, rounding included, as an f32: the pair that limits the step, also where nothing touches and `impacts` is empty.
   * `precision` has no part in it: the time may be later than that of `earliest`.
   */
  readonly first: Impact | null;
  /** As in `Impacts`. If it is true, the fraction is 0. */
  readonly startIntersects: boolean | null;
  /** How many fractions were tried. */
  readonly nTried: number;
  readonly stats: Stats;
  /**
   * The positions of a body at that fraction, rounded to the precision in which it has them; `null` for a body that does not move. The
   * straight path to them is free, if the start was free of intersections, and except for pairs that touch at the start.
   */
  positions(body: Body): Positions | null;
  /**
   * Takes the step: moves the bodies of the scene to these positions. Bodies whose end `setEndTransform` set keep their rest positions; of
   * others these are the rest positions then, too. Refuses a scene in which any body has moved since, or is new, and leaves it as it is.
   */
  apply(scene: Scene): void;
}

/** Two elements that are near each other. */
export interface NearPair extends Candidate {
  /** The nearest feature of each: 0 to 3 for a vertex of the element, 8 to 10 for an edge, 16 for the face. */
  features: [number, number];
  /** Whether nearest points may not be the only ones. */
  parallel: boolean;
  /** If `distances` or `closestPoints` asked. */
  distance?: number;
  /** If `closestPoints` asked: a point of each. */
  points?: [[number, number, number], [number, number, number]];
}

export interface NearList extends OfKinds<NearPair> {
  /** Two per pair. */
  readonly features: Uint8Array;
  /** 1 or 0 per pair. */
  readonly parallel: Uint8Array;
  /** Each is the largest float that is not above the true distance. */
  readonly distances: Float64Array | null;
  /** Six numbers per pair. */
  readonly points: Float64Array | null;
  /** Those of one kind, a part of this list. */
  of(kind: PairKind): NearList;
  /** As that of `Pairs`; also of lists of one kind. */
  changes(old: NearList): Changes;
}

/** All pairs of elements within a distance. */
export interface NearPairs extends Answer, NearList {}

/** The nearest elements of two bodies. */
export interface Nearest {
  /** A length, rounded down: never above the true one, and 0 if and only if they touch, or are nearer than the smallest number. */
  distance: number;
  bodyA: Body;
  elementA: number;
  bodyB: Body;
  elementB: number;
  /** The point of each that is nearest to the other; where they touch, one that they share, twice. */
  points: [[number, number, number], [number, number, number]];
}

/** The element that is nearest to a point. */
export interface ClosestElement {
  body: Body;
  /**
   * The number of a face, also of a body of tetrahedra (see `Scene.faces`); of bodies without faces that of an edge or a point. Decided
   * exactly; of several at the same distance the lowest by body (after a removal see `Scene.remove`) and number.
   */
  element: number;
  /** The feature that has the nearest point: 0 to 3 for a vertex of the element, 8 to 10 for an edge, 16 for the face. */
  feature: number;
  /** A length, rounded down: never above the true one, and 0 if they touch. */
  distance: number;
  /** Rounded: off by a few last bits of the largest coordinate of the element. */
  point: [number, number, number];
}

/** What is nearest to each point: an entry per point, `null` where nothing is near enough; with `nNearest` the nearest few. */
export interface Closest extends Answer, Iterable<ClosestElement | null> {
  /** How many points there are. */
  readonly length: number;
  /** How many entries each point has in the columns below: what the query said. */
  readonly nNearest: number;
  /** `[body, element]` per entry, 2^32 - 1 for none. Those of a point follow each other, nearest first. */
  readonly rows: Uint32Array;
  /** 255 for none. */
  readonly features: Uint8Array;
  /** Infinity for none. */
  readonly distances: Float64Array;
  /** x, y, z per entry, NaN for none. */
  readonly points: Float64Array;
  /** What is nearest to a point; counted from the end if `ix` is negative. */
  at(ix: number): ClosestElement | null;
  /** What is nearest to a point, nearest first, those at the same distance by body and number: as many as were asked for, or fewer. */
  of(point: number): ClosestElement[];
}

/** Where a ray meets an element. */
export interface RayHit {
  body: Body;
  /** As in `ClosestElement`; of several at the same `t` the lowest. */
  element: number;
  /** As in `ClosestElement`: the feature that has the point of entry. */
  feature: number;
  /** Of the entry, in units of the direction, rounded down. */
  t: number;
  /** Where the ray leaves the element: more than `t` where it lies in its plane. */
  tEnd: number;
  /** Of the point of entry, rounded. */
  barycentrics: [number, number, number];
}

/** What rays hit, one ray after the other. */
export interface Hits extends Answer {
  /** The number of rays. */
  readonly length: number;
  /** 1 per ray that hits anything, else 0. */
  readonly hit: Uint8Array;
  /** Where the hits of each ray start in the columns below, and one past the last. */
  readonly offsets: Uint32Array;
  /** `[body, element]` per hit. */
  readonly rows: Uint32Array;
  readonly features: Uint8Array;
  readonly t: Float64Array;
  readonly tEnd: Float64Array;
  /** Three per hit. */
  readonly barycentrics: Float64Array;
  /** What a ray hits, by t: the first, or all; nothing with `hits: "any"`. */
  of(ray: number): RayHit[];
}

/** How far each vertex may move, on any path, so that nothing touches. */
export interface SafeDistances {
  /** A length per vertex, in the precision of the body's positions: below what is allowed by at most 2^-10 of it, and never above. */
  of(body: Body): Float32Array | Float64Array;
  /**
   * The pairs at distance 0 (also those nearer than the smallest number), or at most as far apart as they are thick, whose vertices may not
   * move at all; also those of two fixed bodies.
   */
  readonly touching: NearPairs;
  readonly stats: Stats;
}

/** How far each vertex can go in a step. */
export interface Truncation {
  /** How many vertices were stopped before the end of their way. */
  readonly nCut: number;
  /** How many pairs touch at the start, or are at most as far apart as they are to keep: their vertices stay. Pairs of which no vertex moves are not counted. */
  readonly nTouching: number;
  /** How often pairs were looked at again. */
  readonly rounds: number;
  /** The pairs that stopped vertices, those that touch at the start included. */
  readonly pairs: Candidates;
  /** As in `Impacts`. */
  readonly startIntersects: boolean | null;
  readonly stats: Stats;
  /** The positions of a body afterwards; `null` for one that does not move. */
  positions(body: Body): Positions | null;
  /**
   * Takes the step: moves the bodies of the scene to these positions. Bodies whose end `setEndTransform` set keep their rest positions; of
   * others these are the rest positions then, too. Refuses a scene in which any body has moved since, or is new, and leaves it as it is.
   */
  apply(scene: Scene): void;
}

/** Lists: the neighbours of element i are those from `offsets[i]` to `offsets[i + 1]` of `indices`, ascending. */
export interface Csr {
  readonly offsets: Uint32Array;
  readonly indices: Uint32Array;
  /**
   * How far away each is, minus the thickness of both: below that by at most 2^-20 of it (or by 2^-1045), where `near` has the nearest float
   * below. 0 where they touch.
   */
  readonly distances: Float64Array;
}

/** Which elements are near each element. The vertices of all bodies are numbered one after another, and so are edges and faces. */
export interface Neighbours {
  /** How many pairs are near; each is in two lists. */
  readonly length: number;
  readonly stats: Stats;
  /** The number of the first vertex, edge and face of a body in the lists. */
  first(body: Body): { vertex: number; edge: number; face: number };
  /** The lists of the elements that a kind names first: of `"vf"` the faces near each vertex. */
  of(kind: PairKind): Csr;
  /** Of those that it names second. */
  reversed(kind: PairKind): Csr;
  /** The faces near each vertex, the vertices near each face, the edges near each edge. */
  readonly vf: Csr;
  readonly fv: Csr;
  readonly ee: Csr;
}

/** How two triangles meet. */
export interface Contact {
  bodyA: Body;
  elementA: number;
  bodyB: Body;
  elementB: number;
  shape: "solid" | "apart" | "point" | "segment" | "polygon";
  /** Numbers of points: one, a segment's two, or a polygon's. */
  corners: Uint32Array;
}

/** Segments of contacts as loops and open curves, by numbers of points. */
export interface Curves {
  readonly length: number;
  /** Where each curve starts in `points`, and one past the last. */
  readonly starts: Uint32Array;
  readonly points: Uint32Array;
  /** 1 for loops, else 0. */
  readonly closed: Uint8Array;
  /** 1 if all segments point the same way along the curve. */
  readonly directed: Uint8Array;
  readonly lengths: Float64Array;
}

/** Connected contacts of two bodies. */
export interface Region {
  bodies: [Body, Body];
  /** Numbers of contacts. */
  contacts: Uint32Array;
  position: [number, number, number];
  bounds: [[number, number, number], [number, number, number]];
  /** Of its curves. */
  length: number;
  /** Of its patches, where faces lie in one plane. */
  patchArea: number;
  /** What its curves span, as a vector. */
  area: [number, number, number];
  /** The direction in which to push the first body; `null` if the curves span no area. */
  normal: [number, number, number] | null;
  /** Of `penetration`: the extent of the region along the normal. Bodies that are pushed that far may still overlap. */
  depth: number | null;
  /** Of `penetration`: what both bodies have in common; `null` where they meet other than by edges that cross faces, as in one plane. `Infinity` if it is larger than all floats. Of a body that crosses itself, volume, area, normal, depth and regions mean nothing. */
  volume: number | null;
  /** Of `penetration`: vertices of the first body inside the second, and of the second inside the first. */
  inside: [Uint32Array, Uint32Array];
}

/**
 * Where the triangles of pairs meet: contact i is that of row i. The hash is that of the pairs. Points are one if they have one name, by
 * features: where a face is there twice, or faces of one body overlap in a plane, points and curves double, and what they would connect can
 * be several regions.
 */
export interface Contacts extends Answer, List<Contact> {
  /** One index into `SHAPES` per contact. */
  readonly shapes: Uint8Array;
  /** 1 for segments with a direction. */
  readonly directed: Uint8Array;
  /** Where the corners of each contact start, and one past the last. */
  readonly starts: Uint32Array;
  /** Numbers of points. */
  readonly corners: Uint32Array;
  /** x, y, z per point, rounded to nearest: to an f32 where both bodies hold f32, else to an f64. */
  readonly points: Float64Array;
  curves(): Curves;
  regions(): Region[];
}

/** How deep two closed bodies are in each other. */
export interface Penetration {
  readonly bodies: [Body, Body];
  /** Vertices of the first of `bodies` strictly inside the second, and of the second inside the first: sorted. */
  readonly inside: [Uint32Array, Uint32Array];
  readonly regions: Region[];
  /** Of all regions together, if it is known: `Infinity` if larger than all floats, `null` if infinite regions cancel. Means nothing if a body crosses itself. */
  readonly volume: number | null;
  readonly stats: Stats;
}

/**
 * Answers questions about scenes, exactly: touching counts, and there is no tolerance. It owns memory that it uses again. Errors are
 * `ImpingeError`s that name the body, the index and both numbers.
 */
export declare class Detector {
  constructor(settings?: Settings);
  /** Of the last question that was answered, also after `dispose`; before the first, and after a first one that failed, all is 0. */
  readonly stats: Stats;
  /** All pairs of elements that intersect. */
  detect(scene: Scene, query?: Query): Pairs;
  /** How many pairs `detect` would find. */
  count(scene: Scene, query?: Query): number;
  /** Whether `detect` would find any. */
  any(scene: Scene, query?: Query): boolean;
  /** Which elements touch during a step, and when first. */
  impacts(scene: Scene, query?: Query): Impacts;
  /** The earliest impact of a step, of several the first of `impacts`; `null` if nothing touches. Faster than `impacts`. */
  earliest(scene: Scene, query?: Query): Impact | null;
  /** Whether nothing touches during a step: free, if the start was. */
  isFree(scene: Scene, query?: Query): boolean;
  /** How far a step can be taken. */
  advance(scene: Scene, query?: Query): Advance;
  /**
   * Pairs of elements whose boxes overlap during a step, inflated by a length, and by how thick elements are, on all sides. Vertices of no
   * element take no part.
   */
  candidates(scene: Scene, inflation: number, query?: Query): Candidates;
  /**
   * All `candidates` in sorted runs, so that memory need not hold all of them: `each` gets one run after the other, and stops the search with
   * `false`. How many candidates it got. Each run is searched for alone, so short runs cost time. While it runs, the scene must not be
   * changed and the detector not asked.
   */
  candidatesInRuns(scene: Scene, inflation: number, each: (run: CandidateRun) => boolean | void, query?: Query): number;
  /**
   * Pairs of elements at most a length apart, thickness besides; decided exactly. An edge and a face (`"ef"`) are a pair only if they meet,
   * whatever the length: if they are near without meeting, pairs of their parts (`"vf"`, `"ee"`) say so. Vertices of no element, such as those
   * of no face of a body of triangles, take no part.
   */
  near(scene: Scene, distance: number, query?: Query): NearPairs;
  /**
   * Where points lie: 1 inside a body, 0 on its surface, -1 outside, decided exactly. Triangles must be a closed surface, so weld the
   * seams of a geometry first; the error names an edge of one that is not. The surface of tetrahedra is made of `Scene.faces`; where they
   * overlap, a point strictly inside one of them is inside, also on a face of another.
   */
  contains(scene: Scene, body: Body, points: GivenPositions, control?: Control): Int8Array;
  /**
   * How far points are from the surface of a body: above 0 inside, below 0 outside; the sign is exact. Bodies as for `contains`. Where
   * tetrahedra overlap, 0 also on a face that is strictly inside another one, where `contains` says 1.
   */
  signedDistance(scene: Scene, body: Body, points: GivenPositions, control?: Control): Float64Array;
  /**
   * Which tetrahedron of a body contains each point: the lowest of several that share the face, edge or vertex on which it is; -1 outside.
   * Decided exactly.
   */
  locate(scene: Scene, body: Body, points: GivenPositions, control?: Control): Int32Array;
  /**
   * How often a closed surface winds around each point: 0 outside, 1 inside where faces are counterclockwise seen from outside, sums of
   * these where the surface overlaps itself; -(2 ** 31) on the surface. Decided exactly. Bodies of triangles, as for `contains`.
   */
  windingNumbers(scene: Scene, body: Body, points: GivenPositions, control?: Control): Int32Array;
  /**
   * The element nearest to each point, or with `nNearest` the nearest few: of all bodies, or of one with `of`. Tetrahedra count with the faces
   * of their border, so a point inside has a distance.
   */
  closest(scene: Scene, points: GivenPositions, query?: Query): Closest;
  /**
   * What rays hit: the points origin + t direction, for t from 0 to `most`. Grazing an edge or a vertex is a hit. Tetrahedra count with the
   * faces of their border. A direction of zero is the origin alone.
   */
  cast(scene: Scene, origins: GivenPositions, directions: GivenPositions, query?: Query): Hits;
  /**
   * How far each vertex may move, at most `most`, so that nothing touches. The cost grows with `most`, since all pairs within twice `most` are
   * looked at: take no more than a vertex moves in a step.
   */
  safeDistances(scene: Scene, most: number, query?: Query): SafeDistances;
  /**
   * How far each vertex can go in a step: each stops for itself, where `advance` stops all of them at one fraction. A body whose end
   * `setEndTransform` made stops as a whole: all of its vertices go the least share of their ways that one of them may go.
   */
  truncate(scene: Scene, query?: Query): Truncation;
  /** The pairs of `near` as lists per element: `"ef"` and vertices of no element are as said there. */
  neighbours(scene: Scene, distance: number, query?: Query): Neighbours;
  /** The two bodies that are nearest to each other, and their nearest pair: of different bodies (`which: "between"`) unless the query names others, and self-collision, such as `of` has, is refused; `null` if there are no two. Of several at one distance, rounded down, the first, see `Scene.remove`: not always the nearest of them. */
  nearest(scene: Scene, query?: Query): Nearest | null;
  /** The smallest distance of two bodies; `null` if one of them has no elements. Tetrahedra are solid. Of several pairs at one distance, rounded down, the lowest: not always the nearest of them. */
  distance(scene: Scene, a: Body, b: Body, control?: Control): Nearest | null;
  /** Where the triangles of pairs meet. The scene must be that of the pairs, others are refused, and must not have changed since they were found. */
  contacts(scene: Scene, pairs: Pairs, control?: Control): Contacts;
  /**
   * How deep two closed bodies are in each other, given contacts among which are all of theirs. Refuses bodies that have moved since the
   * pairs of these were found, or whose groups or pinned vertices were set since, and contacts of a query that left out pairs of the two: in
   * a cell, by groups, or pinned in both.
   */
  penetration(scene: Scene, contacts: Contacts, a: Body, b: Body, control?: Control): Penetration;
  /** Frees the memory. Refused while it answers a question. Called again, it does nothing. */
  dispose(): void;
  [Symbol.dispose](): void;
}
