// Uses all of the package's types; tsc checks it.

import init, { Detector, ImpingeError, KINDS, SHAPES, Scene, weld } from "impinge";
import type { Advance, Body, Changes, ClosestElement, Contacts, Impact, Nearest, NearPairs, Neighbours, PairKind, Pairs, Penetration, Query, RayHit, Region, RestPairs, Stats, Truncation } from "impinge";
import initGpu, { Detector as GpuDetector, Scene as GpuScene, read, readBodies, readFrames, type FileMesh } from "impinge/webgpu";

await init();
using scene = new Scene();
using detector = new Detector({ method: "cells", recluster: "never", memoryBudget: 2 ** 30, maxPairs: 1e6, reuseMargin: 0.01 });
const a: Body = scene.addTriangles(new Uint16Array([0, 1, 2]), new Float32Array(9));
const b: Body = scene.addTetrahedra(new Uint32Array([0, 1, 2, 3]), new Float64Array(12));
const strand: Body = scene.addEdges(new Uint8Array([0, 1]), new Float32Array(6));
const cloud: Body = scene.addPoints(new Float32Array(6));
scene.setPositions(a, new Float32Array(9));
scene.setEndPositions(b, new Float64Array(12));
scene.setEndPositions(b, null);
scene.setTransform(strand, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
scene.setEndTransform(strand, new Float32Array(16));
scene.setFilter(cloud, 2, 0xffn);
scene.setThickness(cloud, 0.5);
scene.setThickness(cloud, new Float32Array(3), "vertices");
scene.remesh(cloud, { positions: new Float32Array(3) });
const pairs: Pairs = detector.detect(scene, { between: [a, b] });
const rows: Uint32Array[] = [pairs.rows, pairs.between(a, b), pairs.selfOf(a), pairs.colliding(b)];
const numbers: number[] = [...pairs].map(([, i, , j]) => i + j);
const query: Query = { which: "between", start: "verify", clearance: 1e-4, clearanceShare: 0.2, exclude: [[a, b]] };
const first: Impact | null = detector.earliest(scene, { of: a, start: "skip", precision: "f64", separation: 0.5 });
const times: number[] = [...detector.impacts(scene, query).of("vf")].map(({ toi }) => toi);
const kind: PairKind | undefined = detector.candidates(scene, 0.5, { kinds: ["vf", "ee"] }).at(0)?.kind;
const free: boolean = detector.isFree(scene, { ...query, signal: AbortSignal.timeout(100), progress: (done, total) => done < total });
const advance: Advance = detector.advance(scene, query);
advance.apply(scene);
const known: (boolean | null)[] = [detector.impacts(scene, query).startIntersects, advance.startIntersects];
const near: NearPairs = detector.near(scene, 0.5, { closestPoints: true });
const lengths: (number | undefined)[] = [near.distances?.[0], near.at(-1)?.points?.[1][2]];
const nearest: Nearest | null = detector.distance(scene, a, b, { progress: () => undefined });
const points = new Float32Array(6);
const places: Int8Array = detector.contains(scene, a, points, { progress: () => true });
const closest: ClosestElement | null = detector.closest(scene, points, { of: a, most: 2 }).at(-1);
const few: ClosestElement[] = detector.closest(scene, points, { nNearest: 3 }).of(0);
const cells: Int32Array = detector.locate(scene, b, points);
const wound: Int32Array = detector.windingNumbers(scene, a, points);
const inside: Float64Array = detector.signedDistance(scene, a, points, { progress: () => true });
scene.setEdges(a, new Uint32Array([2, 1, 2, 0, 0, 1]));
scene.setEdges(a, null);
scene.setGroups(a, new Uint16Array(3));
scene.setPinned(a, [true, false, true]);
scene.setPinned(a, new Uint8Array(3));
const rest: RestPairs = scene.restPairs(0.5);
const handed: number = detector.candidatesInRuns(scene, 0.5, (run) => run.of("ee").length > 0, { exclude: [rest, { groups: [0, 1] }], most: 100 });
rest.dispose();
const hits: RayHit[] = detector.cast(scene, points, new Float64Array(6), { hits: "all", most: 1 }).of(0);
const bounds: Float32Array | Float64Array = detector.safeDistances(scene, 0.5, { fixed: [b], exclude: [[a, b], { rings: 2 }] }).of(a);
const truncation: Truncation = detector.truncate(scene, { clearance: 1e-3 });
truncation.apply(scene);
const lists: Neighbours = detector.neighbours(scene, 0.5);
const listed: Uint32Array[] = [lists.vf.offsets, lists.fv.indices, lists.ee.offsets, lists.of("ev").indices];
const nearestTwo: Nearest | null = detector.nearest(scene);
const contacts: Contacts = detector.contacts(scene, pairs);
const regions: Region[] = contacts.regions();
const penetration: Penetration = detector.penetration(scene, contacts, a, b);
const loops: Uint8Array = contacts.curves().closed;
const { mesh: whole, positions: frame } = weld({ positions: new Float32Array(9), faces: new Uint16Array([0, 1, 2]) });
const next: Float64Array = frame(new Float64Array(9));
const single: Float32Array = whole.positions;
const stats: Stats = detector.stats;
const told: string = `${pairs.hash} ${stats.totalMs} ${stats.nCandidates} ${stats.stages["pairing"]}`;
const sizes = [scene.nElements(b), scene.nVertices(b), scene.edges(b).length, scene.faces(b).length, scene.elements(b).length];
const bodies: Body[] = scene.bodies;
const held = [scene.positions(a), scene.endPositions(a)?.length, scene.restPositions(a), scene.kind(a)];
scene.remove(b);
try {
  detector.count(scene);
} catch (error) {
  if (error instanceof ImpingeError && error.code === "too_many_pairs") console.log(detector.any(scene));
}
// As three.js declares the arrays of a geometry.
declare const geometry: { index: { array: Uint16Array | Uint32Array | Float32Array }; position: { array: Float32Array | Int8Array } };
const drawn: Body = scene.addTriangles(geometry.index.array, geometry.position.array);
scene.add(weld({ faces: geometry.index.array, positions: geometry.position.array }).mesh);
detector.closest(scene, geometry.position.array, { of: drawn });
await init("module.wasm");
await init(new Uint8Array());
// @ts-expect-error: positions are not plain arrays
scene.setPositions(a, [0, 0, 0]);
// @ts-expect-error: numbers are no pairs at rest
detector.near(scene, 1, { exclude: [[1, 2, 3]] });
// @ts-expect-error: not a method
new Detector({ method: "octree" });
// @ts-expect-error: the device has no such method
void GpuDetector.open({ method: "naive" });
// @ts-expect-error: pairs are between two bodies
detector.impacts(scene, { between: [0, 1, 2] });
// @ts-expect-error: no such field
detector.detect(scene, { bodies: [0, 1] });
// @ts-expect-error: a code that there is not
if (new ImpingeError().code === "wrong") console.log(KINDS, SHAPES);

await initGpu(new URL("impinge_bg.wasm", "http://localhost/"));
const gpu = await GpuDetector.open();
const theirs = new GpuScene();
const mesh: FileMesh = read("a.ply", new Uint8Array(), { weld: true });
const c: Body = theirs.add(mesh);
const answer: Pairs = await gpu.detect(theirs, { selfOf: c });
const any: Promise<boolean> = gpu.any(theirs);
const parts: FileMesh[] = readBodies("a.glb", new Uint8Array());
const frames: Float32Array[] = readFrames("a.pc2", new Uint8Array());
const map: Uint32Array = mesh.map;
const notes: string[] = mesh.notes;
console.log(few, cells, inside, rest.length, handed, places, closest, hits, bounds, listed, nearestTwo);
console.log(rows, numbers, first, times, kind, free, known, lengths, nearest, regions, penetration, loops, next, single, told, sizes, bodies, held);
console.log(answer.hash, any, parts[0]?.name, frames, map, notes, (await gpu.impacts(theirs)).length, gpu.stats?.backend);
await gpu.dispose();
const changes: Changes = detector.detect(scene).changes(detector.detect(scene));
const kept: Uint32Array = detector.near(scene, 1).of("vf").changes(detector.near(scene, 1)).kept;
const ofKinds: Changes[] = [detector.near(scene, 1).changes(detector.near(scene, 1).of("vf")), detector.impacts(scene).changes(detector.impacts(scene).of("vf"))];
void [changes, kept, ofKinds];
