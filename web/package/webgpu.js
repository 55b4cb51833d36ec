// impinge on WebGPU, asynchronous; and the readers of mesh files.

import load, { Engine, MeshFile, read_frames, weld_f32, weld_f64 } from "./gpu/impinge.js";
import { Bodies, bodies, chosen, loader, mustBeNone, welder } from "./shared.js";

const [init, mustBeReady] = loader(load, new URL("./gpu/impinge_bg.wasm", import.meta.url));
export default init;

const welded = welder(weld_f32, weld_f64);

export function weld(mesh) {
  mustBeReady();
  return welded(mesh);
}

// The module cannot be entered while it awaits an answer, so later calls wait for their turn.
export class GpuDetector {
  #bodies;
  #last = Promise.resolve();

  constructor(bodies) {
    if (!(bodies instanceof Bodies)) throw new TypeError("use await GpuDetector.open()");
    this.#bodies = bodies;
  }

  static async open(options) {
    mustBeReady();
    if (!globalThis.navigator?.gpu) {
      const isSafe = globalThis.isSecureContext !== false;
      const why = isSafe ? "" : ": pages have it over https or from localhost only";
      throw new Error(`there is no WebGPU here${why}`);
    }
    return new GpuDetector(new Bodies(await Engine.webgpu(...chosen(options))));
  }

  #turn(work) {
    const turn = this.#last.then(() => work(this.#bodies));
    this.#last = turn.catch(() => undefined);
    return turn;
  }

  // Arrays are copied at once: the caller may write to them while the call waits.
  add(index, positions) {
    const copies = [copy(index), copy(positions)];
    return this.#turn((bodies) => bodies.add(...copies));
  }

  addTetrahedra(index, positions) {
    const copies = [copy(index), copy(positions)];
    return this.#turn((bodies) => bodies.addTetrahedra(...copies));
  }

  setPositions(body, positions) {
    const copied = copy(positions);
    return this.#turn((bodies) => bodies.setPositions(body, copied));
  }

  remove(body) {
    return this.#turn((bodies) => bodies.remove(body));
  }

  size(body) {
    return this.#turn((bodies) => bodies.size(body));
  }

  between(a, b) {
    return this.#answer([a, b]);
  }

  betweenAll() {
    return this.#answer([], false);
  }

  within(body) {
    return this.#answer([body]);
  }

  everything() {
    return this.#answer([]);
  }

  #answer(which, withSelf = true) {
    return this.#turn(async (held) => ({
      pairs: await held.engine.detect_async(bodies(...which), withSelf),
      hash: held.hash,
      statistics: held.statistics,
    }));
  }

  dispose() {
    return this.#turn((bodies) => bodies.dispose());
  }
}

// Other things than arrays are refused by the call itself, when its turn comes.
function copy(array) {
  return ArrayBuffer.isView(array) ? array.slice() : array;
}

function taken(file) {
  try {
    return {
      name: file.name(),
      index: file.index(),
      positions: file.positions(),
      corners: file.corners(),
      map: file.map(),
    };
  } finally {
    file.free();
  }
}

export function readMesh(name, bytes, { weld = true, ...others } = {}) {
  mustBeReady();
  mustBeNone(others, '"weld"');
  return taken(new MeshFile(String(name), bytes, Boolean(weld)));
}

export function readBodies(name, bytes, { weld = true, ...others } = {}) {
  mustBeReady();
  mustBeNone(others, '"weld"');
  return MeshFile.bodies(String(name), bytes, Boolean(weld)).map(taken);
}

export function readFrames(name, bytes) {
  mustBeReady();
  return read_frames(String(name), bytes);
}
