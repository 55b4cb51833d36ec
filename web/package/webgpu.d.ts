import type { Body, Index, Module, Options, Positions, Statistics } from "./index.js";

/** Loads the WebAssembly module. Later calls wait for the first. */
export default function init(module?: Module | Promise<Module>): Promise<void>;

export { weld } from "./index.js";

/** An answer of the GPU: the same pairs and the same hash as on the CPU. */
export interface Answer {
  pairs: Uint32Array;
  hash: string;
  statistics: Statistics;
}

/**
 * A detector on the browser's WebGPU device. Nothing blocks: every call returns a promise. Calls are answered in the
 * order in which they were made, and arrays are copied at once.
 */
export declare class GpuDetector {
  private constructor();
  /** Opens the device. Rejected if the browser offers none. */
  static open(options?: Options): Promise<GpuDetector>;
  /** Adds a body of triangles and returns its number. */
  add(index: Index, positions: Positions): Promise<Body>;
  /** Adds a body of tetrahedra and returns its number. */
  addTetrahedra(index: Index, positions: Positions): Promise<Body>;
  /** Moves the vertices of a body. */
  setPositions(body: Body, positions: Positions): Promise<void>;
  /** Removes a body. */
  remove(body: Body): Promise<void>;
  /** The numbers of primitives and of vertices of a body. */
  size(body: Body): Promise<{ primitives: number; vertices: number }>;
  /** Pairs between two bodies: `[i0, j0, i1, j1, …]`. */
  between(a: Body, b: Body): Promise<Answer>;
  /** All pairs of different bodies: `[bodyA, i, bodyB, j, …]`. */
  betweenAll(): Promise<Answer>;
  /** Self-collision of a body: `[i0, j0, i1, j1, …]`. */
  within(body: Body): Promise<Answer>;
  /** All pairs, self-collision included: `[bodyA, i, bodyB, j, …]`. */
  everything(): Promise<Answer>;
  /** Frees the memory once all earlier calls are answered. */
  dispose(): Promise<void>;
}

/** A mesh from a file. `name` is that of the file, or of a node or a group in it. */
export interface FileMesh {
  name: string;
  index: Uint32Array;
  positions: Float32Array | Float64Array;
  corners: 3 | 4;
  /** For each vertex of the file, its number in the mesh: they differ if vertices were welded. */
  map: Uint32Array;
}

/**
 * Reads a mesh file. The extension of its name is that of its format: obj, ply, stl, off, gltf, glb, msh, vtk, vtu or mesh.
 * Vertices at the same position become one, unless `weld` is false. Needs no GPU.
 */
export function readMesh(name: string, bytes: Uint8Array, options?: { weld?: boolean }): FileMesh;

/**
 * Reads the bodies of a mesh file, each as a mesh of its own: the nodes of a glTF file that have a mesh, the objects of an OBJ
 * file, or its groups if it has no objects. Any other file is one body.
 */
export function readBodies(name: string, bytes: Uint8Array, options?: { weld?: boolean }): FileMesh[];

/** Reads the frames of a point cache (`.pc2`, `.mdd`): the positions of all vertices, per frame. Needs no GPU. */
export function readFrames(name: string, bytes: Uint8Array): Float32Array[];
