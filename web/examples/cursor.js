// A cursor on a BufferGeometry that deforms in each frame: where the ray under the mouse enters it, and where the mesh is nearest to a
// probe that goes around it. The part about rays and points is marked.
import * as THREE from "three";
import init, { Detector, Scene } from "impinge";

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 50);
camera.position.set(0, 0, 6);
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight("white", "gray", 3));
const geometry = new THREE.TorusKnotGeometry(1, 0.35, 300, 40);
const rest = geometry.attributes.position.array.slice();
const knot = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color: "steelblue", flatShading: true }));
knot.frustumCulled = false;
const dot = (color) => new THREE.Mesh(new THREE.SphereGeometry(0.04), new THREE.MeshBasicMaterial({ color }));
const [cursor, probe, foot] = [dot("red"), dot("gold"), dot("gold")];
const way = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: "gold" }));
way.frustumCulled = false;
scene.add(knot, cursor, probe, foot, way);

const mouse = new THREE.Vector2();
addEventListener("pointermove", ({ clientX, clientY }) => mouse.set((2 * clientX) / innerWidth - 1, 1 - (2 * clientY) / innerHeight));

// ---- rays and points
await init();
const [bodies, detector] = [new Scene(), new Detector()];
const body = bodies.addTriangles(geometry.index.array, geometry.attributes.position.array);

function look() {
  bodies.setPositions(body, geometry.attributes.position.array);
  const { origin, direction } = ray.ray;
  const [hit] = detector.cast(bodies, new Float64Array(origin.toArray()), new Float64Array(direction.toArray())).of(0); // the first, exact
  cursor.visible = hit !== undefined;
  if (hit) cursor.position.copy(origin).addScaledVector(direction, hit.t);
  const nearest = detector.closest(bodies, new Float64Array(probe.position.toArray())).at(0);
  foot.position.fromArray(nearest.point);
  way.geometry.setFromPoints([probe.position, foot.position]);
  return `${hit ? `triangle ${hit.element}, ${hit.t.toFixed(3)} away` : "nothing"} under the cursor; the probe is ${nearest.distance.toFixed(3)} away`;
}
// ----

const ray = new THREE.Raycaster();
renderer.setAnimationLoop((now) => {
  const t = now / 1000;
  const { array } = geometry.attributes.position;
  for (let ix = 0; ix < array.length; ix += 3) {
    const [x, y, z] = rest.subarray(ix, ix + 3);
    array[ix] = x + 0.15 * Math.sin(3 * y + 2 * t);
    array[ix + 1] = y + 0.15 * Math.sin(3 * x + 2 * t);
    array[ix + 2] = z;
  }
  geometry.attributes.position.needsUpdate = true;
  probe.position.set(2 * Math.cos(t / 2), 2 * Math.sin(t / 2), 0.5);
  ray.setFromCamera(mouse, camera);
  document.getElementById("hit").textContent = look();
  renderer.render(scene, camera);
});
