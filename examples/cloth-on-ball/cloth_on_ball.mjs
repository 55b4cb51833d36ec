// A cloth falls on a ball that breathes: in each frame which elements intersect and how near the two are, then the step to the next
// frame as far as it is free.
import init, { Detector, Scene } from "impinge";
import { readFile } from "node:fs/promises";

async function read(name) {
  const positions = [], faces = [];
  for (const line of (await readFile(new URL(name, import.meta.url), "utf8")).split("\n")) {
    const [kind, ...numbers] = line.split(" ");
    if (kind === "v") positions.push(...numbers.map(Number));
    if (kind === "f") faces.push(...numbers.map((vertex) => vertex - 1));
  }
  return { faces: Uint32Array.from(faces), positions: Float64Array.from(positions) };
}

await init();
const scene = new Scene(), detector = new Detector();
const clothMesh = await read("cloth.obj"), ballMesh = await read("ball.obj");
const cloth = scene.add(clothMesh), ball = scene.add(ballMesh);
const sizes = [1, 1.015625, 1.03125, 1.015625];
for (let frame = 0; frame < 10; ++frame) {
  const pairs = detector.detect(scene);
  const { distance } = detector.distance(scene, cloth, ball);
  const [between, within] = [pairs.between(cloth, ball).length / 2, pairs.selfOf(cloth).length / 2];
  console.log(`${frame}: ${between} pairs, ${within} in the cloth, ${distance.toFixed(9)} apart`);
  scene.setEndPositions(cloth, scene.positions(cloth).map((x, ix) => (ix % 3 === 2 ? x - 0.03125 : x)));
  scene.setEndPositions(ball, ballMesh.positions.map((x) => x * sizes[frame % 4]));
  detector.advance(scene, { clearance: 1e-4 }).apply(scene);
}
