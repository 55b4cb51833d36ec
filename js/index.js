// impinge on the CPU: WebAssembly with SIMD, synchronous.

import load, * as module from "./cpu/impinge.js";
import { statsOf } from "./answers.js";
import { answering, ask, free, makeScene, settings } from "./classes.js";
import { watch } from "./query.js";
import { call, disposable, loader, refuse, welder } from "./shared.js";

export { KINDS, SHAPES } from "./answers.js";
export { ImpingeError } from "./shared.js";

const beside = () => new URL("./cpu/impinge_bg.wasm", import.meta.url);
const [init, mustBeReady] = loader(load, beside, () => module.set_watch(watch));
export default init;

export const weld = welder(mustBeReady, module);

const { Scene, handleOf } = makeScene(module, mustBeReady);
export { Scene };

export class Detector {
  #handle;
  #stats;

  static {
    answering(Detector, (detector, question, scene, asked) => {
      const { answer, stats } = ask(detector.#held, handleOf(scene), asked());
      detector.#stats = stats;
      return answer;
    });
    disposable(Detector);
  }

  constructor(given) {
    mustBeReady();
    this.#handle = call(() => new module.DetectorHandle(...settings(given)));
    this.#stats = statsOf(this.#handle.stats(false));
  }

  get #held() {
    return this.#handle ?? refuse("this detector has been disposed of");
  }

  get stats() {
    return this.#stats;
  }

  dispose() {
    free(this.#handle);
    this.#handle = null;
  }
}
