// impinge on the CPU: WebAssembly with SIMD, synchronous.

import load, { Engine, StepQuestion, kind_names, weld_f32, weld_f64 } from "./cpu/impinge.js";
import { Bodies, bodies, chosen, loader, welder } from "./shared.js";

const [init, mustBeReady] = loader(load, new URL("./cpu/impinge_bg.wasm", import.meta.url));
export default init;

const welded = welder(weld_f32, weld_f64);

export function weld(mesh) {
  mustBeReady();
  return welded(mesh);
}

export class Detector {
  #bodies;

  constructor(options) {
    mustBeReady();
    this.#bodies = new Bodies(new Engine(...chosen(options)), { StepQuestion, kind_names });
  }

  add(index, positions) {
    return this.#bodies.add(index, positions);
  }

  addTetrahedra(index, positions) {
    return this.#bodies.addTetrahedra(index, positions);
  }

  setPositions(body, positions) {
    this.#bodies.setPositions(body, positions);
  }

  setEndPositions(body, positions) {
    this.#bodies.setEndPositions(body, positions);
  }

  remove(body) {
    this.#bodies.remove(body);
  }

  size(body) {
    return this.#bodies.size(body);
  }

  between(a, b) {
    return this.#bodies.engine.detect(bodies(a, b), true);
  }

  betweenAll() {
    return this.#bodies.engine.detect(bodies(), false);
  }

  within(body) {
    return this.#bodies.engine.detect(bodies(body), true);
  }

  everything() {
    return this.#bodies.engine.detect(bodies(), true);
  }

  impacts(options) {
    return this.#bodies.impacts(options);
  }

  earliest(options) {
    return this.#bodies.earliest(options);
  }

  isFree(options) {
    return this.#bodies.isFree(options);
  }

  advance(options) {
    return this.#bodies.advance(options);
  }

  get startIntersects() {
    return this.#bodies.startIntersects;
  }

  get hash() {
    return this.#bodies.hash;
  }

  get statistics() {
    return this.#bodies.statistics;
  }

  dispose() {
    this.#bodies.dispose();
  }
}
if (Symbol.dispose) Detector.prototype[Symbol.dispose] = Detector.prototype.dispose;
