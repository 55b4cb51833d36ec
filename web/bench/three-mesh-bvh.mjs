// impinge beside three-mesh-bvh, in Node, on the same frames: node three-mesh-bvh.mjs PACKAGE [--record FOLDER | --check]
//
// Two deforming balls. Before each frame all vertices are rewritten, off the clock, into the arrays of the three.js
// geometries. The clock then runs until the pairs are in an array: impinge copies the positions and answers,
// three-mesh-bvh refits both trees and answers. Both take turns, ten frames each. three-mesh-bvh runs with the settings
// that were fastest on the same frames; all of them are tried first. The pairs of one pose are compared as sets.
//
// To count as a pair, triangles must intersect exactly; three-mesh-bvh decides this in double precision without error
// bounds. Every frame is the first pose or its mirror image (x to -x, which rounds nothing), so the number of pairs is known.
//
// Then 10,000 points and as many rays in each frame, of one ball: the nearest face of each, and the first hit. Both write numbers
// into arrays: distances, and parameters of hits. All of these are compared, to single precision. `--check` only shows, with small
// balls, that all of this runs.

import assert from "node:assert/strict";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { cpus } from "node:os";
import { join, resolve } from "node:path";
import * as THREE from "three";
import { AVERAGE, CENTER, MeshBVH, SAH } from "three-mesh-bvh";
import { ball } from "../page/shapes.js";

const [folder, option, record] = process.argv.slice(2);
const { default: init, Detector, Scene } = await import(resolve(folder, "index.js"));
await init();

const TURN = 10;
const SETTINGS = Object.entries({ CENTER, AVERAGE, SAH }).flatMap(([name, strategy]) =>
  [1, 4, 10].flatMap((targetLeafSize) =>
    [false, true].map((boxes) => ({ name, strategy, targetLeafSize, boxes })),
  ),
);

function median(times) {
  const sorted = times.toSorted((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)];
}

// A ball with bumps, moved by `offset`, in its pose and in the mirror image.
function body(n, offset) {
  const { index, positions } = ball(n, 0.5);
  const poses = [positions, new Float32Array(positions.length)];
  for (let ix = 0; ix < positions.length; ix += 3) {
    const [x, y, z] = positions.subarray(ix, ix + 3);
    const bump = 1 + 0.05 * Math.sin(20 * x) * Math.sin(20 * y) * Math.sin(20 * z);
    positions.set([x * bump + offset[0], y * bump + offset[1], z * bump + offset[2]], ix);
    poses[1].set([-positions[ix], positions[ix + 1], positions[ix + 2]], ix);
  }
  const geometry = () => {
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(positions), 3));
    made.setIndex(new THREE.BufferAttribute(Uint32Array.from(index), 1));
    return made;
  };
  return { poses, geometry };
}

// Writes a pose into the geometries of a contestant.
function pose(contestant, bodies, ix) {
  for (const [which, geometry] of contestant.geometries.entries()) {
    geometry.attributes.position.array.set(bodies[which].poses[ix]);
  }
}

function impinge(bodies) {
  const geometries = bodies.map(({ geometry }) => geometry());
  const [scene, detector] = [new Scene(), new Detector()];
  const start = performance.now();
  const ids = geometries.map(({ index, attributes }) => scene.addTriangles(index.array, attributes.position.array));
  return {
    name: "impinge",
    geometries,
    built: performance.now() - start,
    frame() {
      for (const id of ids) scene.setPositions(id, geometries[id].attributes.position.array);
      return detector.detect(scene, { between: ids }).between(...ids);
    },
  };
}

function threeMeshBvh(bodies, { name, strategy, targetLeafSize, boxes }) {
  const geometries = bodies.map(({ geometry }) => geometry());
  const start = performance.now();
  const [a, b] = geometries.map((geometry) => new MeshBVH(geometry, { strategy, targetLeafSize }));
  const identity = new THREE.Matrix4();
  const apart = (s, t) =>
    ["x", "y", "z"].some(
      (k) =>
        Math.max(s.a[k], s.b[k], s.c[k]) < Math.min(t.a[k], t.b[k], t.c[k]) ||
        Math.max(t.a[k], t.b[k], t.c[k]) < Math.min(s.a[k], s.b[k], s.c[k]),
    );
  return {
    name: `three-mesh-bvh, ${name}, leaves of ${targetLeafSize}${boxes ? ", boxes of triangles compared first" : ""}`,
    geometries,
    built: performance.now() - start,
    frame() {
      a.refit();
      b.refit();
      const found = [];
      a.bvhcast(b, identity, {
        intersectsTriangles(s, t, i, j) {
          if ((!boxes || !apart(s, t)) && s.intersectsTriangle(t, undefined, true)) found.push(i, j);
          return false;
        },
      });
      return found;
    },
  };
}

// Pairs by the vertices of their triangles: three-mesh-bvh reorders the triangles of a geometry.
function named({ geometries }, pairs) {
  const triangle = (which, ix) => {
    const of = geometries[which].index.array.subarray(3 * ix, 3 * ix + 3);
    return [...of].sort((p, q) => p - q).join("-");
  };
  const names = new Set();
  for (let at = 0; at < pairs.length; at += 2) {
    names.add(`${triangle(0, pairs[at])} ${triangle(1, pairs[at + 1])}`);
  }
  return names;
}

// Median milliseconds of each contestant, in turns.
function race(contestants, bodies, rounds) {
  const times = contestants.map(() => []);
  for (let round = 0; round < rounds; round += 1) {
    for (const [which, contestant] of contestants.entries()) {
      for (let frame = 0; frame < TURN; frame += 1) {
        pose(contestant, bodies, frame % 2);
        const start = performance.now();
        const pairs = contestant.frame();
        times[which].push(performance.now() - start);
        assert.equal(pairs.length / 2, contestant.expected, contestant.name);
      }
    }
  }
  return times.map(median);
}

const isCheck = option === "--check";
const results = [];
for (const n of isCheck ? [200] : [1_000, 15_000, 70_000]) {
  const bodies = [body(n, [0, 0, 0]), body(n, [0.5, 0.25, 0.125])];
  const ours = impinge(bodies);
  pose(ours, bodies, 0);
  const firstFrame = performance.now();
  const exact = named(ours, ours.frame());
  ours.built += performance.now() - firstFrame;
  ours.expected = exact.size;
  let best = null;
  for (const setting of SETTINGS) {
    const peer = threeMeshBvh(bodies, setting);
    pose(peer, bodies, 0);
    const found = peer.frame();
    peer.expected = found.length / 2;
    const names = named(peer, found);
    const [missing, extra] = [exact.difference?.(names), names.difference?.(exact)];
    peer.missing = missing?.size ?? [...exact].filter((pair) => !names.has(pair)).length;
    peer.extra = extra?.size ?? [...names].filter((pair) => !exact.has(pair)).length;
    const [ms] = race([peer], bodies, 1);
    if (best === null || ms < best.ms) best = { peer, ms };
  }
  const { peer } = best;
  const [mine, theirs] = race([ours, peer], bodies, isCheck ? 1 : 10);
  results.push({
    triangles: n,
    pairs: exact.size,
    impinge: { ms: mine, once: ours.built },
    peer: { name: peer.name, ms: theirs, once: peer.built, missing: peer.missing, extra: peer.extra },
    ratio: theirs / mine,
  });
  console.log(results.at(-1));
}

// Random points around a ball, and rays from them in any direction.
function probes(n, seed) {
  let state = seed;
  const random = () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32 - 0.5;
  };
  const rows = (scale) => Float32Array.from({ length: 3 * n }, () => scale * random());
  return { points: rows(1.2), directions: rows(1) };
}

// Each contestant answers about points, or about rays, after its refit.
function probed(ours, peer, { points, directions }) {
  const [point, ray, target] = [new THREE.Vector3(), new THREE.Ray(), { point: new THREE.Vector3() }];
  const n = points.length / 3;
  const [scene, detector, id] = ours.tools;
  const found = new Float64Array(n);
  return {
    "nearest face": [
      () => detector.closest(scene, points, { of: id }).distances,
      () => {
        for (let ix = 0; ix < n; ix += 1) found[ix] = peer.tree.closestPointToPoint(point.fromArray(points, 3 * ix), target).distance;
        return found;
      },
    ],
    "first hit": [
      () => {
        const { hit, offsets, t } = detector.cast(scene, points, directions, { of: id });
        return Float64Array.from(hit, (is, ix) => (is ? t[offsets[ix]] : Infinity));
      },
      () => {
        for (let ix = 0; ix < n; ix += 1) {
          const length = ray.direction.fromArray(directions, 3 * ix).length();
          ray.direction.divideScalar(length);
          ray.origin.fromArray(points, 3 * ix);
          found[ix] = (peer.tree.raycastFirst(ray, THREE.DoubleSide)?.distance ?? Infinity) / length;
        }
        return found;
      },
    ],
  };
}

const probeResults = [];
for (const n of isCheck ? [200] : [15_000, 70_000]) {
  const bodies = [body(n, [0, 0, 0])];
  const contestants = [0, 1].map(() => ({ geometries: bodies.map(({ geometry }) => geometry()) }));
  const [ours, peer] = contestants;
  const scene = new Scene();
  const [{ index, attributes }] = ours.geometries;
  ours.tools = [scene, new Detector(), scene.addTriangles(index.array, attributes.position.array)];
  ours.refit = () => scene.setPositions(ours.tools[2], attributes.position.array);
  peer.tree = new MeshBVH(peer.geometries[0], { strategy: SAH });
  peer.refit = () => peer.tree.refit();
  for (const [question, asks] of Object.entries(probed(ours, peer, probes(isCheck ? 100 : 10_000, 7)))) {
    const times = [[], []];
    let differ = 0;
    for (let frame = 0; frame < (isCheck ? 2 : 40); frame += 1) {
      const answers = contestants.map((contestant, which) => {
        pose(contestant, bodies, frame % 2);
        const start = performance.now();
        contestant.refit();
        const answer = asks[which]();
        times[which].push(performance.now() - start);
        return answer;
      });
      differ = answers[0].filter((x, ix) => x !== answers[1][ix] && !(Math.abs(x - answers[1][ix]) < 1e-5)).length;
    }
    const [mine, theirs] = times.map(median);
    probeResults.push({ triangles: n, question, impinge: mine, peer: theirs, ratio: theirs / mine, differ });
    console.log(probeResults.at(-1));
  }
}

const own = new URL("../node_modules/three-mesh-bvh/package.json", import.meta.url);
const { version } = JSON.parse(await readFile(own, "utf8"));
const ms = (value) => value.toFixed(value < 10 ? 2 : 0);
const table = `# impinge and three-mesh-bvh in Node

${cpus()[0].model.trim()}, ${cpus().length} cores; Node ${process.version}; three-mesh-bvh ${version}. Made by
\`scripts/web bench\`; \`web/bench/three-mesh-bvh.mjs\` says what is timed. Both run on one thread. Two deforming balls, median
milliseconds per frame over 100 frames each.

| triangles | pairs | impinge (wasm) | three-mesh-bvh | times impinge | its pairs | once: impinge, three-mesh-bvh | its best setting |
|---|---:|---:|---:|---:|---|---|---|
${results
  .map(({ triangles, pairs, impinge: ours, peer, ratio }) => {
    const wrong = peer.missing + peer.extra === 0 ? "the same" : `+${peer.extra} −${peer.missing}`;
    const setting = peer.name.replace("three-mesh-bvh, ", "");
    return `| 2 x ${triangles.toLocaleString("en")} | ${pairs.toLocaleString("en")} | ${ms(ours.ms)} | ${ms(peer.ms)} | ${ratio.toFixed(1)} | ${wrong} | ${ms(ours.once)}, ${ms(peer.once)} | ${setting} |`;
  })
  .join("\n")}

10,000 points, or rays, of one ball in each frame, with the refit; medians of 40 frames. three-mesh-bvh with its strategy SAH.

| triangles | question | impinge (wasm) | three-mesh-bvh | times impinge | answers that differ by 1e-5 |
|---|---|---:|---:|---:|---:|
${probeResults
  .map(({ triangles, question, impinge: mine, peer, ratio, differ }) => {
    return `| ${triangles.toLocaleString("en")} | ${question} | ${ms(mine)} | ${ms(peer)} | ${ratio.toFixed(1)} | ${differ} |`;
  })
  .join("\n")}
`;
console.log(table);
if (option === "--record") {
  await mkdir(record, { recursive: true });
  await writeFile(join(record, "three-mesh-bvh.md"), table);
  await writeFile(join(record, "three-mesh-bvh.json"), `${JSON.stringify({ pairs: results, probes: probeResults }, null, 2)}\n`);
}
