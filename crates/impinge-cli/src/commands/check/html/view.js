
// The view: a mesh that is turned by mouse, fingers and keys, and visited place by place. Lengths
// are in units of the mesh's radius, from its middle.
const dialog = document.querySelector("dialog"), canvas = dialog.querySelector("canvas");
const zUp = document.currentScript.dataset.up === "z";
const numbers = (text) => text.split(",").map(Number);
// The colours of the two parts at a place of an assembly.
const PAIR = ["one", "two"].map((name) => {
  const sample = document.querySelector(`i.${name}`);
  return sample && [...getComputedStyle(sample).backgroundColor.match(/\d+/g).map((x) => x / 255), 1];
});
const shown = { row: null, at: -1, places: [], target: [0, 0, 0], azimuth: 0, elevation: 0, distance: 3, mesh: null };
let gl, uniforms, drawn = 0;

const VERTEX = `#version 300 es
in vec3 point; in vec4 face; uniform mat4 view; uniform vec3 target; out vec3 at, side; out vec4 color;
void main() {
  at = point - target; color = face;
  int corner = gl_VertexID % 3; side = vec3(corner == 0, corner == 1, corner == 2);
  gl_Position = view * vec4(at, 1.0);
}`;
// Flat faces, darker from the back, with their edges where they are large enough to be told apart.
const FRAGMENT = `#version 300 es
precision highp float; in vec3 at, side; in vec4 color; uniform vec3 eye; uniform float alpha; uniform vec4 paint; out vec4 pixel;
void main() {
  vec3 toEye = normalize(eye - at), normal = normalize(cross(dFdx(at), dFdy(at)));
  float light = (gl_FrontFacing ? 0.45 : 0.3) + (gl_FrontFacing ? 0.55 : 0.3) * abs(dot(normal, toEye));
  vec3 width = fwidth(side), near = side / max(width, 1e-6);
  float edge = min(min(near.x, near.y), near.z), fine = 1.0 - smoothstep(0.03, 0.15, max(max(width.x, width.y), width.z));
  pixel = vec4(mix(color.rgb, paint.rgb, paint.a) * light * mix(1.0, 0.72, fine * (1.0 - smoothstep(0.5, 1.5, edge))), alpha);
}`;

function start() {
  gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
  if (!gl) return false;
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, "point");
  gl.bindAttribLocation(program, 1, "face");
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  uniforms = Object.fromEntries(["view", "target", "eye", "alpha", "paint"].map((name) => [name, gl.getUniformLocation(program, name)]));
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.enableVertexAttribArray(0);
  gl.enableVertexAttribArray(1);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 16, 0);
  gl.vertexAttribPointer(1, 4, gl.UNSIGNED_BYTE, true, 16, 12);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  return true;
}

// Puts a mesh on the GPU: three corners per face, each with its position and the colour of the face.
function load(element) {
  const { points, fine, found, colors, parts, middle, radius } = element.dataset;
  const bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0)), read = new DataView(bytes.buffer);
  const nPoints = +points, nFaces = +fine + +found, palette = numbers(colors);
  const to = new DataView(new ArrayBuffer(48 * nFaces));
  for (let corner = 0; corner < 3 * nFaces; corner++) {
    const from = 12 * read.getUint32(12 * nPoints + 4 * corner, true), color = 3 * bytes[12 * (nPoints + nFaces) + Math.floor(corner / 3)];
    for (let k = 0; k < 3; k++) {
      to.setUint32(16 * corner + 4 * k, read.getUint32(from + 4 * k, true), true);
      to.setUint8(16 * corner + 12 + k, palette[color + k]);
    }
  }
  gl.bufferData(gl.ARRAY_BUFFER, to, gl.STATIC_DRAW);
  // Where the faces of each part of an assembly end.
  shown.mesh = { fine: +fine, found: +found, ends: parts && numbers(parts), middle: numbers(middle), radius: +radius };
}

// Axes of the camera, and the matrix from places around the target to the screen.
function camera() {
  const turn = ([x, y, z]) => (zUp ? [x, -z, y] : [x, y, z]);
  const [a, e] = [shown.azimuth, shown.elevation].map((degrees) => (degrees * Math.PI) / 180);
  const right = turn([Math.cos(a), 0, -Math.sin(a)]);
  const up = turn([-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)]);
  const back = turn([Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)]);
  return { right, up, back };
}

function draw() {
  drawn = 0;
  if (!dialog.open || !shown.mesh) return;
  const scale = Math.min(devicePixelRatio, 2);
  const [width, height] = [canvas.clientWidth * scale, canvas.clientHeight * scale].map(Math.round);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  gl.viewport(0, 0, width, height);
  const { right, up, back } = camera(), { distance } = shown, [far, near] = [distance + 2.5, distance / 20];
  // An angle of 28 degrees, as in the pictures.
  const focal = 4, [fx, fy] = width < height ? [focal, (focal * width) / height] : [(focal * height) / width, focal];
  const rows = [right.map((x) => fx * x), up.map((x) => fy * x), back.map((x) => (-x * (far + near)) / (far - near)), back.map((x) => -x)];
  rows[0].push(0);
  rows[1].push(0);
  rows[2].push((distance * (far + near) - 2 * far * near) / (far - near));
  rows[3].push(distance);
  const matrix = [0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column]));
  gl.uniformMatrix4fv(uniforms.view, false, matrix);
  gl.uniform3fv(uniforms.target, shown.target);
  gl.uniform3fv(uniforms.eye, back.map((x) => x * distance));
  gl.clearColor(0.93, 0.94, 0.96, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const { fine, found, ends } = shown.mesh, { pair, others } = shown;
  const faces = (from, to, paint = [0, 0, 0, 0]) => {
    gl.uniform4fv(uniforms.paint, paint);
    gl.drawArrays(gl.TRIANGLES, 3 * from, 3 * (to - from));
  };
  // At a place of an assembly its two parts have a colour each.
  const both = () => pair.forEach((part, ix) => faces(ends[part - 1] ?? 0, ends[part], PAIR[ix]));
  gl.enable(gl.DEPTH_TEST);
  gl.uniform1f(uniforms.alpha, 1);
  if (pair) both();
  else faces(0, fine + found);
  // What has a finding shows through what hides it, and so do the two parts.
  gl.disable(gl.DEPTH_TEST);
  gl.enable(gl.BLEND);
  gl.uniform1f(uniforms.alpha, 0.3);
  if (pair) both();
  else faces(fine, fine + found);
  if (pair) {
    // The other parts, faintly.
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(false);
    gl.uniform1f(uniforms.alpha, 0.12);
    for (const [from, to] of others) faces(from, to, [0.4, 0.4, 0.45, 1]);
    gl.depthMask(true);
  }
  gl.disable(gl.BLEND);
}
const redraw = () => (drawn ||= requestAnimationFrame(draw));

// Looks at place `at`, or at the whole mesh.
function visit(at) {
  const { places, mesh } = shown, n = places.length, line = dialog.querySelector(".at");
  shown.at = at;
  shown.pair = places[at]?.dataset.parts && numbers(places[at].dataset.parts);
  if (shown.pair) {
    const [a, b] = shown.pair, end = (part) => mesh.ends[part] ?? 0;
    shown.others = [[0, end(a - 1)], [end(a), end(b - 1)], [end(b), mesh.fine]];
  }
  if (at < 0) {
    Object.assign(shown, { target: [0, 0, 0], azimuth: -25, elevation: 20, distance: 4.2 });
    const { fine, found } = mesh, all = +shown.row.querySelector("script").dataset.all, grouped = (n) => n.toLocaleString("en");
    line.textContent = `${n} place${n === 1 ? "" : "s"}. ` +
      (fine + found < all ? `${grouped(fine + found)} of ${grouped(all)} faces are here: those with findings and those around the places.` : `${grouped(all)} faces.`);
  } else {
    const { point, from } = places[at].dataset, [azimuth, elevation, distance] = numbers(from);
    const target = numbers(point).map((x, k) => (x - mesh.middle[k]) / mesh.radius);
    Object.assign(shown, { target, azimuth, elevation, distance: distance / mesh.radius });
    line.replaceChildren(`Place ${at + 1} of ${n}: `, ...places[at].querySelector("span").cloneNode(true).childNodes);
  }
  redraw();
}

function open(row, at) {
  if (!gl && !start()) {
    alert("This browser has no WebGL 2, so meshes can't be turned.");
    return;
  }
  if (shown.row !== row) load(row.querySelector("script"));
  shown.row = row;
  shown.places = [...row.querySelectorAll("button.place")];
  dialog.querySelector("b").textContent = row.querySelector("[data-v]").dataset.v;
  for (const name of ["previous", "next"]) dialog.querySelector(`[data-do=${name}]`).hidden = !shown.places.length;
  dialog.showModal();
  canvas.focus();
  visit(at);
}

const acts = {
  next: () => shown.places.length && visit((shown.at + 1) % shown.places.length),
  previous: () => shown.places.length && visit((shown.at <= 0 ? shown.places.length : shown.at) - 1),
  whole: () => visit(-1),
  close: () => dialog.close(),
};
document.addEventListener("click", (event) => {
  const see = event.target.closest("button.see"), act = event.target.closest("[data-do]");
  if (act) acts[act.dataset.do]();
  if (!see) return;
  // An assembly is a section; cells of its matrix have numbers of places.
  const row = see.closest("section") ?? see.closest("tr");
  open(row, see.dataset.at ? +see.dataset.at : [...row.querySelectorAll("button.place")].indexOf(see));
});

function turn(x, y) {
  shown.azimuth -= x;
  shown.elevation = Math.max(-89, Math.min(89, shown.elevation + y));
  redraw();
}
function move(x, y) {
  const { right, up } = camera(), pixel = shown.distance / (2 * Math.min(canvas.clientWidth, canvas.clientHeight));
  shown.target = shown.target.map((t, k) => t - pixel * (x * right[k] - y * up[k]));
  redraw();
}
function zoom(factor) {
  shown.distance = Math.max(1e-6, Math.min(20, shown.distance * factor));
  redraw();
}

// One finger or button turns, two fingers move and come nearer.
const fingers = new Map();
canvas.onpointerdown = (event) => {
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  canvas.setPointerCapture(event.pointerId);
};
canvas.onpointermove = (event) => {
  const old = fingers.get(event.pointerId);
  if (!old) return;
  const [x, y] = [event.clientX - old[0], event.clientY - old[1]];
  const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
  if (other) {
    const apart = ([x, y]) => Math.hypot(x - other[0], y - other[1]);
    zoom(Math.max(1, apart(old)) / Math.max(1, apart([event.clientX, event.clientY])));
    move(x / 2, y / 2);
  } else if (event.shiftKey || event.buttons & 6) move(x, y);
  else turn(x / 2.5, y / 2.5);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
};
canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
canvas.oncontextmenu = (event) => event.preventDefault();
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
}, { passive: false });
const keys = {
  ArrowLeft: () => turn(-8, 0), ArrowRight: () => turn(8, 0), ArrowUp: () => turn(0, 8), ArrowDown: () => turn(0, -8),
  "+": () => zoom(0.8), "-": () => zoom(1.25), n: acts.next, p: acts.previous,
};
dialog.onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
  event.preventDefault();
  keys[event.key]();
};
addEventListener("resize", redraw);
