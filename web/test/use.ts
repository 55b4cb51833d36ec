// Uses all of the package's types; tsc checks it.

import init, { Detector, weld, type Advance, type Body, type Impact, type Statistics, type StepOptions } from "impinge";
import initGpu, { GpuDetector, readBodies, readFrames, readMesh, type FileMesh } from "impinge/webgpu";

await init();
using detector = new Detector({ method: "cells", sharedVertex: "resolve" });
const a: Body = detector.add(new Uint16Array([0, 1, 2]), new Float32Array(9));
const b: Body = detector.addTetrahedra(new Uint32Array([0, 1, 2, 3]), new Float64Array(12));
detector.setPositions(a, new Float32Array(9));
detector.setEndPositions(b, new Float64Array(12));
const pairs: Uint32Array = detector.between(a, b);
const own: Uint32Array = detector.within(a);
const all: Uint32Array = detector.everything();
const different: Uint32Array = detector.betweenAll();
const first: Impact | null = detector.earliest({ bodies: [a, b], start: "skip", toi: "f64", separation: 0.5 });
const times: number[] = [...detector.impacts({ which: "between" })].map(({ time }) => time);
const kind: "vf" | undefined | string = detector.impacts().at(0)?.kind;
const options: StepOptions = { start: "verify", clearance: 1e-4, clearanceShare: 0.2 };
const free: boolean = detector.isFree(options);
const advance: Advance = detector.advance(options);
advance.apply(detector);
const known: (boolean | null)[] = [detector.startIntersects, detector.impacts(options).startIntersects, advance.startIntersects];
const { mesh: whole, positions: frame } = weld({ positions: new Float32Array(9), faces: new Uint16Array([0, 1, 2]) });
const next: Float64Array = frame(new Float64Array(9));
const single: Float32Array = whole.positions;
const statistics: Statistics = detector.statistics;
const told: string = `${detector.hash} ${statistics.totalMs} ${statistics.stages["pairing"]}`;
const { primitives, vertices } = detector.size(b);
detector.remove(b);
// @ts-expect-error: positions are not plain arrays
detector.setPositions(a, [0, 0, 0]);
// @ts-expect-error: not a method
new Detector({ method: "octree" });
// @ts-expect-error: a question is about two bodies at most
detector.impacts({ bodies: [0, 1, 2] });

await initGpu(new URL("impinge_bg.wasm", "http://localhost/"));
const gpu = await GpuDetector.open();
const answer = await gpu.between(await gpu.add(new Uint8Array(3), new Float32Array(9)), 1);
const mesh = readMesh("a.ply", new Uint8Array(), { weld: true });
const bodies: FileMesh[] = readBodies("a.glb", new Uint8Array());
const frames: Float32Array[] = readFrames("a.pc2", new Uint8Array());
const map: Uint32Array = mesh.map;
console.log(free, known, next, single, whole.faces, advance.positions(a)?.length, bodies[0]?.name, frames, map, different, await gpu.betweenAll(), pairs, own, all, first, times, kind, told, primitives, vertices, answer.hash, answer.pairs, mesh.corners);
