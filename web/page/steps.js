// What touches on the way from a frame to the next, and when first.

import { pose } from "./motion.js";
import { counted, grouped } from "./text.js";
import { cornersOf, emptyBox, extend } from "./places.js";

// Asks a detector about the step of a scene from frame `from` on. Returns the number of contacts, their hash, the first one or `null`, and
// all of this in words.
export function askStep(detector, scene, bodies, from, which) {
  for (const [ix, body] of bodies.entries()) {
    scene.setPositions(ix, pose(body, from, body.now.slice()));
    if (body.frames) scene.setEndPositions(ix, pose(body, from + 1, body.now.slice()));
  }
  const nStart = detector.count(scene, { which });
  const impacts = detector.impacts(scene, { which });
  const { length: n, hash } = impacts;
  const first = [...impacts].reduce((least, impact) => (impact.toi < (least?.toi ?? 2) ? impact : least), null);
  const before = nStart > 0 ? `Frame ${from} intersects already. ` : "";
  const way = `${before}On the way to frame ${from + 1}`;
  if (first === null) return { n, hash, first, text: `${way} nothing ${nStart > 0 ? "else " : ""}touches.` };
  const { kind, bodyA, elementA, bodyB, elementB, toi, atStart } = first;
  const who = `${elementName(bodies, kind[0], bodyA, elementA)} and ${elementName(bodies, kind[1], bodyB, elementB)}`;
  const when = atStart ? "at the start" : `at ${Number(toi.toPrecision(6))} of the way`;
  return { n, hash, first, text: `${way}: ${counted(n, "contact")}. First ${when}, ${who}.` };
}

// Vertices are numbered as in the file.
function elementName(bodies, letter, ix, number) {
  const { map, name } = bodies[ix];
  const word = { v: "vertex", e: "edge", f: "face" }[letter];
  const inFile = letter === "v" && map ? map.indexOf(number) : number;
  return `${word} ${grouped(inFile)}${bodies.length > 1 ? ` of ${name}` : ""}`;
}

// The box around the two elements of a contact, and a triangle of each, as `[body, triangle]`.
export function contactAt({ kind, bodyA, elementA, bodyB, elementB }, bodies) {
  const vertices = {
    v: (body, vertex) => [vertex],
    e: edgeOf,
    f: (body, face) => [...cornersOf(body, face)],
  };
  const box = emptyBox();
  const triangles = [[kind[0], bodyA, elementA], [kind[1], bodyB, elementB]].map(([letter, ix, number]) => {
    const own = vertices[letter](bodies[ix], number);
    for (const vertex of own) extend(box, bodies[ix].now, 3 * vertex);
    return [ix, triangleWith(bodies[ix], own)];
  });
  return { box, triangles };
}

function triangleWith({ index }, vertices) {
  for (let at = 0; at < index.length; at += 3) {
    const own = index.subarray(at, at + 3);
    if (vertices.every((vertex) => own.includes(vertex))) return at / 3;
  }
  throw new Error(`no triangle has the vertices ${vertices}`);
}

// The vertices of an edge: edges are unique pairs (low, high), in the order of (high, low).
function edgeOf(body, number) {
  const n = body.now.length / 3;
  if (!body.edges) {
    const keys = new Set();
    for (let at = 0; at < body.index.length; at += 3) {
      for (const [a, b] of [[0, 1], [1, 2], [2, 0]]) {
        const [x, y] = [body.index[at + a], body.index[at + b]];
        if (x !== y) keys.add(Math.max(x, y) * n + Math.min(x, y));
      }
    }
    body.edges = Float64Array.from(keys).sort();
  }
  return [body.edges[number] % n, Math.floor(body.edges[number] / n)];
}
