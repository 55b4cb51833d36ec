// impinge on WebGPU, asynchronous; and the readers of mesh files.

import load, * as module from "./gpu/impinge.js";
import { Pairs, statsOf } from "./answers.js";
import { answering, ask, makeScene, settings } from "./classes.js";
import { watch } from "./query.js";
import { ImpingeError, call, disposable, kindOf, loader, mustBeNone, named, options, refuse, typeOf, welder } from "./shared.js";

export { KINDS, SHAPES } from "./answers.js";
export { ImpingeError } from "./shared.js";

const beside = () => new URL("./gpu/impinge_bg.wasm", import.meta.url);
const [init, mustBeReady] = loader(load, beside, () => module.set_watch(watch));
export default init;

export const weld = welder(mustBeReady, module);

const { Scene, handleOf } = makeScene(module, mustBeReady);
export { Scene };

// Questions that the device answers: all are about the pairs.
const ON_DEVICE = {
  detect: (pairs) => pairs,
  count: (pairs) => pairs.length,
  any: (pairs) => pairs.length > 0,
};

// A scene as it was when a question was asked. It is freed as soon as nothing needs it: questions that are given up may be many, and garbage is
// collected late.
class Copy {
  constructor(held) {
    this.held = held;
  }

  // The module's, which is freed by whoever takes it.
  take() {
    const { held } = this;
    this.held = null;
    return held;
  }

  free() {
    this.take()?.free();
  }
}

// The module cannot be entered while it awaits an answer, so later questions wait for their turn.
export class Detector {
  #handle;
  #stats = null;
  #last = Promise.resolve();

  static {
    answering(Detector, (detector, question, scene, asked) => detector.#ask(question, scene, asked));
    disposable(Detector);
  }

  constructor(handle) {
    if (!(handle instanceof module.DetectorHandle)) refuse("use await Detector.open()");
    this.#handle = handle;
  }

  static async open(given) {
    mustBeReady();
    const of = settings(given);
    if (!globalThis.navigator?.gpu) {
      const isSafe = globalThis.isSecureContext !== false;
      const why = isSafe ? "" : ": pages have it over https or from localhost only";
      throw new ImpingeError("device", `there is no WebGPU here${why}`);
    }
    return new Detector(await awaited(module.DetectorHandle.open(...of)));
  }

  #turn(work) {
    const turn = this.#last.then(() => work(this.#handle));
    this.#last = turn.catch(() => undefined);
    return turn;
  }

  // About the scene as it is now: the caller may move bodies while the question waits.
  async #ask(question, scene, asked) {
    const held = handleOf(scene);
    const take = ON_DEVICE[question];
    const about = asked();
    const copy = new Copy(call(() => held.snapshot()));
    const begins = about.watch.whileItWaits(() => copy.free());
    return this.#turn(async (handle) => {
      begins();
      try {
        if (handle === null) refuse("this detector has been disposed of");
        if (take) {
          const pairs = await detect(handle, copy, about);
          this.#stats = pairs.stats;
          return take(pairs);
        }
        const { answer, stats } = ask(handle, copy.held, about);
        this.#stats = stats;
        return answer;
      } finally {
        copy.free();
      }
    });
  }

  get stats() {
    return this.#stats;
  }

  dispose() {
    return this.#turn((handle) => {
      handle?.free();
      this.#handle = null;
    });
  }
}

const awaited = (promise) => promise.catch((error) => Promise.reject(named(error)));

// The module takes the copy over.
async function detect(handle, copy, { words, numbers, watch, moves }) {
  const lists = await watch.duringAsync((id) => awaited(handle.detect(copy.take(), id, words, numbers)));
  return new Pairs(lists, statsOf(handle.stats(true)), moves, { words, numbers });
}

function checkBytes(bytes) {
  if (typeOf(bytes) !== "Uint8Array") refuse(`bytes: ${kindOf(bytes)} given, a Uint8Array is needed`);
}

function readers(name, bytes, given, inBodies) {
  mustBeReady();
  const { weld = true, ...others } = options("options", given);
  mustBeNone("options", others, ["weld"]);
  checkBytes(bytes);
  const meshes = call(() => module.read(String(name), bytes, Boolean(weld), inBodies));
  return meshes.map(([name, corners, index, positions, map, notes]) => {
    return { name, [corners === 4 ? "tetrahedra" : "faces"]: index, positions, map, notes };
  });
}

export function read(name, bytes, given) {
  const [mesh] = readers(name, bytes, given, false);
  return mesh;
}

export function readBodies(name, bytes, given) {
  return readers(name, bytes, given, true);
}

export function readFrames(name, bytes) {
  mustBeReady();
  checkBytes(bytes);
  return call(() => module.read_frames(String(name), bytes));
}
