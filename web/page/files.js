// Dropped files as bodies: meshes as they are, and the frames of bodies that move.

import { counted } from "./text.js";

// Three files are frames of one body if their names differ in numbers alone; two only if the visitor says so.
const LEAST_NUMBERED = 3;

const isCache = ({ name }) => /\.(pc2|mdd)$/i.test(name);
// Files that may name their parts.
const mayHaveParts = ({ name }) => /\.(obj|gltf|glb)$/i.test(name);
const byName = new Intl.Collator("en", { numeric: true }).compare;

// A buffer of a glTF file among the others.
const isBeside = ({ name }, list) => /\.bin$/i.test(name) && list.some((file) => /\.gltf$/i.test(file.name));

// Reads files. Those that cannot be read are left out, and `refused` says why.
export async function read({ read: readMesh, readBodies, readFrames }, list) {
  const [meshes, caches, refused] = [[], [], []];
  for (const file of list) {
    try {
      if (isBeside(file, list)) throw new Error(`${file.name} is left out: files beside a glTF file are not read. Save that as .glb, which holds its buffers`);
      const bytes = new Uint8Array(await file.arrayBuffer());
      if (isCache(file)) {
        caches.push({ name: file.name, frames: readFrames(file.name, bytes) });
        continue;
      }
      // Vertices at one position become one, as for the program, and coordinates keep their precision.
      const mesh = indexed(readMesh(file.name, bytes, { weld: true }));
      if (mesh.index.length === 0) throw new Error(`${file.name} has no triangles and no tetrahedra`);
      const parts = mayHaveParts(file) ? readBodies(file.name, bytes, { weld: true }).map(indexed) : [];
      meshes.push({ ...mesh, name: file.name, parts });
    } catch (error) {
      const text = String(error.message ?? error);
      refused.push(text.includes(file.name) ? text : `${file.name}: ${text}`);
    }
  }
  return { meshes, caches, refused };
}

const indexed = ({ faces, tetrahedra, ...mesh }) => ({ ...mesh, index: tetrahedra ?? faces, corners: tetrahedra ? 4 : 3 });

const isSameMesh = (a, b) => a.map.length === b.map.length && a.index.length === b.index.length;

// Whether all meshes may be poses of one.
export function mayBePoses({ meshes }) {
  return meshes.length > 1 && meshes.every((mesh) => isSameMesh(mesh, meshes[0]));
}

// Whether meshes are taken for frames unless the visitor says otherwise.
export function looksNumbered({ meshes }) {
  const pattern = (name) => name.replace(/\d+/g, "#");
  const first = meshes[0] && pattern(meshes[0].name);
  return meshes.length >= LEAST_NUMBERED && mayBePoses({ meshes }) && meshes.every(({ name }) => pattern(name) === first);
}

// Whether a file has several nodes or groups.
export function hasParts({ meshes }) {
  return meshes.some(({ parts }) => parts.length > 1);
}

// The bodies of files. `how` is `"bodies"`: one per mesh; `"poses"`: one whose frames are the meshes; `"parts"`: one per node or
// group. A point cache moves the first body that has as many vertices and does not move yet.
export function bodiesOf({ meshes, caches }, how) {
  const refused = [];
  const bodies = [];
  if (how === "poses") {
    const poses = meshes.toSorted((a, b) => byName(a.name, b.name));
    const [first] = poses;
    const frames = poses.map((pose) => welded(first, vertices(pose), pose.name));
    bodies.push({ ...first, name: `${first.name} … ${poses.at(-1).name}`, frames });
  } else if (how === "parts") {
    bodies.push(...meshes.flatMap((mesh) => (mesh.parts.length > 1 ? mesh.parts : [mesh])));
  } else {
    bodies.push(...meshes);
  }
  for (const { name, frames } of caches) {
    const n = (frames[0]?.length ?? 0) / 3;
    const at = bodies.findIndex((body) => body.frames === undefined && body.map.length === n);
    if (at < 0) {
      refused.push(`${name} has frames of ${counted(n, "vertex", "vertices")}, but no mesh that does not move yet has as many`);
      continue;
    }
    const still = bodies[at];
    try {
      const own = frames.map((frame, ix) => welded(still, frame, `${name}: frame ${ix}`));
      bodies[at] = { ...still, name: `${still.name} with ${name}`, frames: own };
    } catch (error) {
      refused.push(error.message);
    }
  }
  return { bodies, refused };
}

// The positions of a file's vertices, before the welding.
function vertices({ positions, map }) {
  const all = new positions.constructor(3 * map.length);
  for (const [vertex, at] of map.entries()) all.set(positions.subarray(3 * at, 3 * at + 3), 3 * vertex);
  return all;
}

// The positions of a frame, welded like the mesh.
function welded({ map, positions }, frame, name) {
  const now = new frame.constructor(positions.length);
  const firsts = new Int32Array(positions.length / 3).fill(-1);
  for (const [vertex, at] of map.entries()) {
    if (firsts[at] < 0) {
      firsts[at] = vertex;
      now.set(frame.subarray(3 * vertex, 3 * vertex + 3), 3 * at);
    } else if ([0, 1, 2].some((axis) => now[3 * at + axis] !== frame[3 * vertex + axis])) {
      const two = `vertices ${firsts[at]} and ${vertex}`;
      throw new Error(`${name}: ${two} are apart, but at one position in the mesh, where they were welded`);
    }
  }
  return now;
}
