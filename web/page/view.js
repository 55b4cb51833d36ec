// Draws bodies with three.js: each body, and over it its colliding triangles, which shine through the surfaces that hide
// them.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const BODY = ["#aebccd", "#d8c8ae", "#b9cdb4", "#cbb6cf"];
const COLLIDING = ["#e0312f", "#2263e6", "#ef9500", "#8a2be2"];
// A press that moves less, in CSS pixels, is a click.
const CLICK = 5;
// More triangles are not searched for the one under a pointer that moves.
const MOST_HOVERED = 400_000;

// The colours of a body and of its colliding triangles.
export function colors(ix) {
  return [BODY[ix % BODY.length], COLLIDING[ix % COLLIDING.length]];
}

// The corners of the triangles that show an element: itself, or the faces of a tetrahedron.
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
      const element = Math.floor(to / pattern.length);
      this.index[to] = index[element * corners + pattern[to % pattern.length]];
    }
    this.positions = new THREE.BufferAttribute(new Float32Array(positions.length), 3);
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
    // Whether vertices may have moved since the ball around them was computed, which the search under the pointer needs. An old
    // ball stays until then: without one, the renderer would compute it in every frame.
    this.isBallOld = true;
    this.hits = geometry(this.colliding);
    this.hits.index.setUsage(THREE.DynamicDrawUsage);
    this.hits.setDrawRange(0, 0);
    const [own, color] = colors(ix);
    this.body = new THREE.Mesh(this.all, material(own));
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

  // Shows the elements with a mark as colliding. Returns how many there are.
  show() {
    const n = CORNERS[this.corners].length;
    let end = 0;
    for (let element = 0; element < this.marks.length; element += 1) {
      if (this.marks[element] === 0) continue;
      for (let corner = 0; corner < n; corner += 1) {
        this.colliding[end] = this.index[element * n + corner];
        end += 1;
      }
    }
    this.hits.setDrawRange(0, end);
    this.hits.index.clearUpdateRanges();
    this.hits.index.addUpdateRange(0, end);
    this.hits.index.needsUpdate = end > 0;
    this.positions.needsUpdate = true;
    return end / n;
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
  #flight = null;
  #chosen = [];

  // What the pointer does is told to `on`: `press()`, `drag(body, dx, dy, dz)` moves a body, `click(hit)` and `hover(hit, event)` name the
  // element there or `null`, `change()` says that the picture must be drawn again.
  constructor(canvas, on) {
    this.canvas = canvas;
    this.on = on;
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    } catch (cause) {
      throw new Error("The page needs WebGL, which this browser does not offer.", { cause });
    }
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#9aa3b0", 1.9));
    const sun = new THREE.DirectionalLight("#ffffff", 1.9);
    sun.position.set(-0.4, 0.3, 1);
    this.camera.add(sun);
    this.scene.add(this.camera);
    const outline = new THREE.LineBasicMaterial({ color: "#111", depthTest: false, transparent: true });
    this.outline = new THREE.LineSegments(new THREE.BufferGeometry(), outline);
    this.outline.renderOrder = 3;
    this.outline.frustumCulled = false;
    this.scene.add(this.outline);
    // Before the controls, so that a body under the pointer is dragged and the view stays.
    canvas.addEventListener("pointerdown", (event) => this.#press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.#release(event));
    }
    canvas.addEventListener("pointerleave", (event) => on.hover(null, event));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", on.change);
    this.controls.addEventListener("start", () => (this.#flight = null));
    new ResizeObserver(() => {
      this.#resize();
      on.change();
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
    if (this.insets) this.leaveRoom(this.insets);
  }

  // Keeps the middle of the view out of the panels: CSS pixels at each edge of the canvas.
  leaveRoom(insets) {
    this.insets = insets;
    const { top, right, bottom, left } = insets;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.camera.setViewOffset(width, height, (right - left) / 2, (bottom - top) / 2, width, height);
    this.on.change();
  }

  // The part of the canvas that no panel covers, as a share of its width and of its height.
  #room() {
    const { top, right, bottom, left } = this.insets ?? { top: 0, right: 0, bottom: 0, left: 0 };
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [1 - (left + right) / width, 1 - (top + bottom) / height].map((share) => Math.max(0.3, share));
  }

  // Replaces all bodies.
  setBodies(bodies) {
    for (const figure of this.#figures) {
      this.scene.remove(...figure.meshes);
      figure.dispose();
    }
    this.#drag = null;
    this.choose([]);
    this.#figures = bodies.map((body, ix) => new Figure(body, ix));
    for (const figure of this.#figures) this.scene.add(...figure.meshes);
  }

  // Places the camera so that a ball around `centre` fills the picture, and what is as far as `reach` from there is not cut at its sides.
  frame([x, y, z], radius, reach = radius) {
    this.#flight = null;
    const away = this.#distance(radius, reach);
    this.controls.target.set(x, y, z);
    this.camera.position.set(x - 0.25 * away, y - 0.82 * away, z + 0.52 * away);
    this.camera.near = away / 1000;
    this.camera.far = away * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }

  // How far away the camera sees a ball as high and as wide as the room that it has.
  #distance(radius, reach = radius) {
    const [wide, high] = this.#room();
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    return Math.max(radius / Math.sin(Math.atan(half * high)), reach / Math.sin(Math.atan(half * this.camera.aspect * wide)));
  }

  // Moves the camera, in its direction, to where a ball around `centre` fills a part of the picture.
  flyTo([x, y, z], radius) {
    const target = new THREE.Vector3(x, y, z);
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    const position = target.clone().addScaledVector(direction, this.#distance(radius));
    this.#flight = { from: [this.camera.position.clone(), this.controls.target.clone()], to: [position, target], start: null };
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.#flight.start = -Infinity;
    this.on.change();
  }

  // Whether the camera still flies after this step.
  fly(now) {
    if (this.#flight === null) return false;
    this.#flight.start ??= now;
    const { from, to, start } = this.#flight;
    const done = Math.min(1, (now - start) / 500);
    const share = done * done * (3 - 2 * done);
    this.camera.position.lerpVectors(from[0], to[0], share);
    this.controls.target.lerpVectors(from[1], to[1], share);
    this.controls.update();
    if (done === 1) this.#flight = null;
    return true;
  }

  // Turns the camera about its target, by angles around the vertical axis and up, and changes its distance.
  turn(around, up, nearer = 1) {
    const away = this.camera.position.clone().sub(this.controls.target);
    const at = new THREE.Spherical().setFromVector3(new THREE.Vector3(away.x, away.z, -away.y));
    at.theta += around;
    at.phi = Math.min(Math.PI - 0.01, Math.max(0.01, at.phi - up));
    at.radius *= nearer;
    const turned = new THREE.Vector3().setFromSpherical(at);
    this.camera.position.copy(this.controls.target).add(new THREE.Vector3(turned.x, -turned.z, turned.y));
    this.controls.update();
    this.on.change();
  }

  // The camera and its target, six numbers.
  get eye() {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()];
  }

  set eye(numbers) {
    this.#flight = null;
    this.camera.position.fromArray(numbers);
    this.controls.target.fromArray(numbers, 3);
    this.controls.update();
  }

  // The vertices of a body, to be written in place.
  positions(ix) {
    const figure = this.#figures[ix];
    figure.isBallOld = true;
    return figure.positions.array;
  }

  // Draws the bodies; `rows` are `[bodyA, i, bodyB, j]` per pair. Returns how many elements of each body collide.
  draw(rows) {
    for (const figure of this.#figures) figure.marks.fill(0);
    for (let at = 0; at < rows.length; at += 2) this.#figures[rows[at]].marks[rows[at + 1]] = 1;
    const counts = this.#figures.map((figure) => figure.show());
    this.#outline();
    this.render();
    return counts;
  }

  // Outlines these elements, `[body, element]` each.
  choose(elements) {
    this.#chosen = elements;
    this.#outline();
    this.on.change();
  }

  #outline() {
    this.outline.visible = this.#chosen.length > 0;
    if (!this.outline.visible) return;
    const points = [];
    for (const [ix, element] of this.#chosen) {
      const { corners, index, positions } = this.#figures[ix];
      const n = CORNERS[corners].length;
      for (let face = element * n; face < (element + 1) * n; face += 3) {
        for (const corner of [0, 1, 1, 2, 2, 0]) {
          const at = 3 * index[face + corner];
          points.push(...positions.array.subarray(at, at + 3));
        }
      }
    }
    this.outline.geometry.dispose();
    this.outline.geometry = new THREE.BufferGeometry();
    this.outline.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  }

  // Hides a body, or shows it again.
  hide(ix, isHidden) {
    for (const mesh of this.#figures[ix].meshes) mesh.visible = !isHidden;
    this.on.change();
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

  // The element under the pointer, and where it is hit.
  #hit(event) {
    const figures = this.#figures.filter(({ body }) => body.visible);
    for (const figure of figures) {
      if (figure.isBallOld) figure.all.computeBoundingSphere();
      figure.isBallOld = false;
    }
    const [hit] = this.#ray(event).intersectObjects(figures.map(({ body }) => body), false);
    if (!hit) return null;
    const body = this.#figures.findIndex((figure) => figure.body === hit.object);
    const faces = CORNERS[this.#figures[body].corners].length / 3;
    return { body, element: Math.floor(hit.faceIndex / faces), point: hit.point };
  }

  #press(event) {
    this.#flight = null;
    this.on.press();
    if (!event.isPrimary) return this.#pinch();
    if (event.button !== 0) return;
    const hit = this.#hit(event);
    this.#drag = { hit, at: [event.clientX, event.clientY], id: event.pointerId, isClick: true };
    // The only body is not moved: the view is turned.
    if (!hit || this.#figures.length < 2) return;
    const ahead = this.camera.getWorldDirection(new THREE.Vector3());
    this.#drag.plane = new THREE.Plane().setFromNormalAndCoplanarPoint(ahead, hit.point);
    Object.assign(this.#drag, { last: hit.point, first: hit.point, eye: this.eye });
    // The controls must know the first finger of a pinch, and turn the view until it has moved.
    this.controls.enabled = event.pointerType === "touch";
    this.canvas.setPointerCapture(event.pointerId);
  }

  // A second finger: both zoom and turn the view, and the body that the first one has moved goes back.
  #pinch() {
    const drag = this.#drag;
    this.#drag = null;
    this.controls.enabled = true;
    if (!drag?.plane || drag.isClick) return;
    const back = drag.first.clone().sub(drag.last);
    this.on.drag(drag.hit.body, back.x, back.y, back.z);
  }

  #move(event) {
    const drag = this.#drag;
    if (drag === null) {
      const n = this.#figures.reduce((sum, { marks }) => sum + marks.length, 0);
      if (event.pointerType === "mouse" && event.buttons === 0 && n <= MOST_HOVERED) this.on.hover(this.#hit(event), event);
      return;
    }
    if (drag.id !== event.pointerId) return;
    const [x, y] = drag.at;
    drag.isClick &&= Math.hypot(event.clientX - x, event.clientY - y) < CLICK;
    if (drag.isClick || !drag.plane) return;
    if (this.controls.enabled) {
      this.controls.enabled = false;
      this.eye = drag.eye;
    }
    const now = this.#ray(event).ray.intersectPlane(drag.plane, new THREE.Vector3());
    if (!now) return;
    const by = now.clone().sub(drag.last);
    drag.last = now;
    this.on.drag(drag.hit.body, by.x, by.y, by.z);
  }

  #release(event) {
    if (this.#drag?.id !== event.pointerId) return;
    const { isClick, hit } = this.#drag;
    this.#drag = null;
    this.controls.enabled = true;
    if (isClick && event.type === "pointerup") this.on.click(hit);
  }
}
