// Draws bodies with three.js: each body, and over it its colliding triangles, which shine through the surfaces that hide
// them.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const BODY = ["#aebccd", "#d8c8ae", "#b9cdb4", "#cbb6cf"];
const COLLIDING = ["#e0312f", "#2263e6", "#ef9500", "#8a2be2"];

// The corners of the triangles that show a primitive: itself, or the faces of a tetrahedron.
const CORNERS = { 3: [0, 1, 2], 4: [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3] };

function material(color, more) {
  return new THREE.MeshLambertMaterial({ color, flatShading: true, side: THREE.DoubleSide, ...more });
}

// A body as three meshes that share their vertices.
class Figure {
  constructor({ index, corners = 3, positions }, ix) {
    this.corners = corners;
    const pattern = CORNERS[corners];
    this.index = new Uint32Array((index.length / corners) * pattern.length);
    for (let to = 0; to < this.index.length; to += 1) {
      const primitive = Math.floor(to / pattern.length);
      this.index[to] = index[primitive * corners + pattern[to % pattern.length]];
    }
    this.positions = new THREE.BufferAttribute(new Float32Array(positions), 3);
    this.positions.setUsage(THREE.DynamicDrawUsage);
    const geometry = (elements) => {
      const made = new THREE.BufferGeometry();
      made.setAttribute("position", this.positions);
      made.setIndex(new THREE.BufferAttribute(elements, 1));
      return made;
    };
    this.colliding = new Uint32Array(this.index.length);
    this.marks = new Uint8Array(index.length / corners);
    this.all = geometry(this.index);
    this.hits = geometry(this.colliding);
    this.hits.index.setUsage(THREE.DynamicDrawUsage);
    this.hits.setDrawRange(0, 0);
    this.body = new THREE.Mesh(this.all, material(BODY[ix % BODY.length]));
    const color = COLLIDING[ix % COLLIDING.length];
    const over = new THREE.Mesh(this.hits, material(color));
    const through = new THREE.Mesh(
      this.hits,
      material(color, {
        transparent: true,
        opacity: 0.35,
        depthFunc: THREE.GreaterDepth,
        depthWrite: false,
      }),
    );
    over.renderOrder = 1;
    through.renderOrder = 2;
    this.meshes = [this.body, over, through];
    // Vertices move every frame, so no bounds of an earlier frame may hide a body.
    for (const mesh of this.meshes) mesh.frustumCulled = false;
  }

  // Shows the primitives with a mark as colliding.
  show() {
    const n = CORNERS[this.corners].length;
    let end = 0;
    for (let primitive = 0; primitive < this.marks.length; primitive += 1) {
      if (this.marks[primitive] === 0) continue;
      for (let corner = 0; corner < n; corner += 1) {
        this.colliding[end] = this.index[primitive * n + corner];
        end += 1;
      }
    }
    this.hits.setDrawRange(0, end);
    this.hits.index.clearUpdateRanges();
    this.hits.index.addUpdateRange(0, end);
    this.hits.index.needsUpdate = end > 0;
    this.positions.needsUpdate = true;
  }

  dispose() {
    this.all.dispose();
    this.hits.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }
}

export class View {
  #figures = [];
  #drag = null;

  // `onDrag(body, dx, dy, dz)` is called while a body is dragged, `onChange` when the picture must be drawn again.
  constructor(canvas, onDrag, onChange) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#9aa3b0", 1.9));
    const sun = new THREE.DirectionalLight("#ffffff", 1.9);
    sun.position.set(-0.4, 0.3, 1);
    this.camera.add(sun);
    this.scene.add(this.camera);
    // Before the controls, so that a body under the pointer is dragged and the view stays.
    canvas.addEventListener("pointerdown", (event) => this.#press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.#move(event, onDrag));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.#release(event));
    }
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", onChange);
    new ResizeObserver(() => {
      this.#resize();
      onChange();
    }).observe(canvas);
    this.#resize();
  }

  #resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
  }

  // Replaces all bodies.
  setBodies(bodies) {
    for (const figure of this.#figures) {
      this.scene.remove(...figure.meshes);
      figure.dispose();
    }
    this.#drag = null;
    this.#figures = bodies.map((body, ix) => new Figure(body, ix));
    for (const figure of this.#figures) this.scene.add(...figure.meshes);
  }

  // Places the camera so that a ball around `centre` fills the picture.
  frame([x, y, z], radius) {
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(1, this.camera.aspect);
    const away = radius / Math.sin(Math.atan(half));
    this.controls.target.set(x, y, z);
    this.camera.position.set(x - 0.25 * away, y - 0.82 * away, z + 0.52 * away);
    this.camera.near = away / 100;
    this.camera.far = away * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }

  // The vertices of a body, to be written in place.
  positions(ix) {
    return this.#figures[ix].positions.array;
  }

  // Draws the bodies; `rows` are `[bodyA, i, bodyB, j]` per pair.
  draw(rows) {
    for (const figure of this.#figures) figure.marks.fill(0);
    for (let at = 0; at < rows.length; at += 2) this.#figures[rows[at]].marks[rows[at + 1]] = 1;
    for (const figure of this.#figures) figure.show();
    this.render();
  }

  render() {
    this.renderer.render(this.scene, this.camera);
  }

  // A point of the page, in CSS pixels, where a body is seen and no other one is before it; `null` if there is none.
  seenAt(ix) {
    const { positions } = this.#figures[ix];
    const box = this.canvas.getBoundingClientRect();
    const few = Math.ceil(positions.count / 50);
    for (let vertex = 0; vertex < positions.count; vertex += few) {
      const at = new THREE.Vector3().fromBufferAttribute(positions, vertex).project(this.camera);
      const x = box.left + (box.width * (1 + at.x)) / 2;
      const y = box.top + (box.height * (1 - at.y)) / 2;
      if (this.#hit({ clientX: x, clientY: y })?.body === ix) return [x, y];
    }
    return null;
  }

  #ray(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1;
    const y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
    return ray;
  }

  // The body under the pointer, and where it is hit.
  #hit(event) {
    for (const { all } of this.#figures) {
      all.computeBoundingSphere();
      all.boundingBox = null;
    }
    const bodies = this.#figures.map((figure) => figure.body);
    const [hit] = this.#ray(event).intersectObjects(bodies, false);
    return hit && { body: bodies.indexOf(hit.object), point: hit.point };
  }

  #press(event) {
    if (!event.isPrimary || event.button !== 0) return;
    const hit = this.#hit(event);
    if (!hit) return;
    const ahead = this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(ahead, hit.point);
    this.#drag = { body: hit.body, plane, last: hit.point, id: event.pointerId };
    this.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
  }

  #move(event, onDrag) {
    if (this.#drag?.id !== event.pointerId) return;
    const now = this.#ray(event).ray.intersectPlane(this.#drag.plane, new THREE.Vector3());
    if (!now) return;
    const { x, y, z } = now.clone().sub(this.#drag.last);
    this.#drag.last = now;
    onDrag(this.#drag.body, x, y, z);
  }

  #release(event) {
    if (this.#drag?.id !== event.pointerId) return;
    this.#drag = null;
    this.controls.enabled = true;
  }
}
