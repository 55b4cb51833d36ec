import type { Advance, Body, CandidateRun, Candidates, Closest, Contacts, Control, GivenPositions, Hits, Impact, Impacts, Mesh, Module, NearPairs, Nearest, Neighbours, Pairs, Penetration, Positions, Query, SafeDistances, Scene, Settings, Stats, Truncation } from "./index.js";

/** Loads the WebAssembly module, which is another one than that of `impinge`. Later calls wait for the first. */
export default function init(module?: Module | Promise<Module>): Promise<void>;

export { ImpingeError, KINDS, SHAPES, Scene, weld } from "./index.js";
export type * from "./index.js";

/** As those of `impinge`. The device has no `"naive"` method. */
export interface DeviceSettings extends Settings {
  method?: "auto" | "clusters" | "cells";
}

/**
 * A detector on the browser's WebGPU device. Nothing blocks: every question returns a promise, is about the scene as it is when it is
 * asked, and is answered in the order in which questions were asked. The device finds the pairs that intersect; all other
 * questions are answered on the CPU. Answers and hashes are those of `impinge`.
 */
export declare class Detector {
  private constructor();
  /** Opens the device. Rejected with the code `"device"` if the browser offers none. */
  static open(settings?: DeviceSettings): Promise<Detector>;
  /** Of the last question that was answered, also after `dispose`; `null` before the first. */
  readonly stats: Stats | null;
  detect(scene: Scene, query?: Query): Promise<Pairs>;
  count(scene: Scene, query?: Query): Promise<number>;
  any(scene: Scene, query?: Query): Promise<boolean>;
  impacts(scene: Scene, query?: Query): Promise<Impacts>;
  earliest(scene: Scene, query?: Query): Promise<Impact | null>;
  isFree(scene: Scene, query?: Query): Promise<boolean>;
  advance(scene: Scene, query?: Query): Promise<Advance>;
  candidates(scene: Scene, inflation: number, query?: Query): Promise<Candidates>;
  /** `each` is called while the device's queue waits: what it asks of this detector is answered after the last run. */
  candidatesInRuns(scene: Scene, inflation: number, each: (run: CandidateRun) => boolean | void, query?: Query): Promise<number>;
  near(scene: Scene, distance: number, query?: Query): Promise<NearPairs>;
  contains(scene: Scene, body: Body, points: GivenPositions, control?: Control): Promise<Int8Array>;
  signedDistance(scene: Scene, body: Body, points: GivenPositions, control?: Control): Promise<Float64Array>;
  locate(scene: Scene, body: Body, points: GivenPositions, control?: Control): Promise<Int32Array>;
  windingNumbers(scene: Scene, body: Body, points: GivenPositions, control?: Control): Promise<Int32Array>;
  closest(scene: Scene, points: GivenPositions, query?: Query): Promise<Closest>;
  cast(scene: Scene, origins: GivenPositions, directions: GivenPositions, query?: Query): Promise<Hits>;
  safeDistances(scene: Scene, most: number, query?: Query): Promise<SafeDistances>;
  truncate(scene: Scene, query?: Query): Promise<Truncation>;
  neighbours(scene: Scene, distance: number, query?: Query): Promise<Neighbours>;
  nearest(scene: Scene, query?: Query): Promise<Nearest | null>;
  distance(scene: Scene, a: Body, b: Body, control?: Control): Promise<Nearest | null>;
  contacts(scene: Scene, pairs: Pairs, control?: Control): Promise<Contacts>;
  penetration(scene: Scene, contacts: Contacts, a: Body, b: Body, control?: Control): Promise<Penetration>;
  /** Frees the memory once all earlier questions are answered. Called again, it does nothing. */
  dispose(): Promise<void>;
  [Symbol.dispose](): void;
}

/** A mesh from a file. `name` is that of the file, or of a node or a group in it. */
export interface FileMesh extends Mesh {
  name: string;
  faces?: Uint32Array;
  tetrahedra?: Uint32Array;
  edges?: never;
  positions: Positions;
  /** For each vertex of the file, its number in the mesh: they differ if vertices were welded. */
  map: Uint32Array;
  /** What of the file was left out or changed: lines skipped, polygons split into triangles. */
  notes: string[];
}

/**
 * Reads a mesh file. The extension of its name is that of its format: obj, ply, stl, off, coff, noff, gltf, glb, 3mf, msh, vtk, vtu
 * or mesh. Files beside it are not read: a glTF file must hold its buffers, as a glb file does.
 * Vertices at the same position become one, unless `weld` is false. Needs no GPU.
 */
export function read(name: string, bytes: Uint8Array, options?: { weld?: boolean }): FileMesh;

/**
 * Reads the bodies of a mesh file, each as a mesh of its own: the nodes of a glTF file that have a mesh, the objects of an OBJ
 * file, or its groups if it has no objects; faces before the first of them are one named `default`. Any other file is one body. The only
 * body has the name that the file gives it, or else that of the file.
 */
export function readBodies(name: string, bytes: Uint8Array, options?: { weld?: boolean }): FileMesh[];

/** Reads the frames of a point cache (`.pc2`, `.mdd`): the positions of all vertices, per frame. Needs no GPU. */
export function readFrames(name: string, bytes: Uint8Array): Float32Array[];
