// Two deforming BufferGeometries collide: colliding triangles turn red. The part about collisions is marked.
import * as THREE from "three";
import init, { Detector, Scene } from "impinge";

const renderer = new THREE.WebGLRenderer({ antialias: true });
renderer.setSize(innerWidth, innerHeight);
document.body.append(renderer.domElement);
const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight, 0.1, 50);
camera.position.set(0, 0, 6);
const scene = new THREE.Scene();
scene.add(new THREE.HemisphereLight("white", "gray", 3));
const geometries = [new THREE.TorusKnotGeometry(0.8, 0.25, 200, 24), new THREE.SphereGeometry(0.8, 64, 48)];
const rest = geometries.map((geometry) => geometry.attributes.position.array.slice());

// ---- collisions
await init();
const [colliding, detector] = [new Scene(), new Detector()];
const bodies = geometries.map(({ index, attributes }) => colliding.addTriangles(index.array, attributes.position.array));

function collide() {
  for (const body of bodies) colliding.setPositions(body, geometries[body].attributes.position.array);
  const pairs = detector.detect(colliding, { between: bodies }); // sorted, exact
  for (const body of bodies) {
    const { index } = geometries[body];
    const hit = [...pairs.colliding(body)];
    const corners = hit.flatMap((triangle) => [...index.array.subarray(3 * triangle, 3 * triangle + 3)]);
    overlays[body].geometry.setIndex(corners);
  }
  return pairs.length;
}
// ----

const material = (color) => new THREE.MeshLambertMaterial({ color, flatShading: true });
const overlays = geometries.map((geometry) => {
  const overlay = new THREE.BufferGeometry().setAttribute("position", geometry.attributes.position);
  const [whole, hit] = [new THREE.Mesh(geometry, material("#b0c4de")), new THREE.Mesh(overlay, material("red"))];
  hit.renderOrder = 1;
  for (const mesh of [whole, hit]) mesh.frustumCulled = false;
  scene.add(whole, hit);
  return hit;
});

renderer.setAnimationLoop((now) => {
  const t = now / 1000;
  for (const [body, { attributes }] of geometries.entries()) {
    const { array } = attributes.position;
    for (let ix = 0; ix < array.length; ix += 3) {
      const [x, y, z] = rest[body].subarray(ix, ix + 3);
      array[ix] = x + (body === 1 ? 1.4 * Math.cos(t) : 0);
      array[ix + 1] = y + 0.1 * Math.sin(6 * x + 3 * t);
      array[ix + 2] = z;
    }
    attributes.position.needsUpdate = true;
  }
  document.getElementById("pairs").textContent = `${collide()} pairs`;
  renderer.render(scene, camera);
});
