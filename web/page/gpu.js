// The same question for WebGPU: always about the latest frame, and never two at once.

import { meshOf } from "./motion.js";

let loading = null;

export class NotLoaded extends Error {}

// The build with WebGPU and the readers of files is loaded when it is first needed.
export function withReaders() {
  loading ??= load().catch((error) => {
    loading = null;
    throw error;
  });
  return loading;
}

async function load() {
  const why = "The part of the page that reads files and asks WebGPU could not be loaded. Try again once you are online";
  // Some browsers remember that an import failed.
  const module = await import("impinge/webgpu").catch((cause) => {
    throw new NotLoaded(`${why}; if that is refused again, reload the page.`, { cause });
  });
  await module.default().catch((cause) => {
    throw new NotLoaded(`${why}.`, { cause });
  });
  return module;
}

// The browser's adapter: `"hardware"`, `"software"`, or `null` if there is none.
export async function lookForAdapter() {
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  if (!adapter) return null;
  const isSoftware = adapter.info?.isFallbackAdapter || /swiftshader|llvmpipe/i.test(adapter.info?.architecture ?? "");
  return isSoftware ? "software" : "hardware";
}

// Frees a detector that nobody waits for, and its scene. One that has failed may fail at this, too: that is no news.
function letGo(detector, scene) {
  scene?.dispose();
  detector?.dispose().catch(() => undefined);
}

export class Gpu {
  #detector = null;
  #scene = null;
  #isBusy = false;
  // Counts changes of the bodies. An answer about other bodies is not shown.
  #era = 0;

  // `on.answer(n, ms, hash, asked)` shows an answer, `on.note(text)` what happens, `on.stale()` asks for another question. `load`
  // gives the build with WebGPU; tests give another.
  constructor(on, load = withReaders) {
    this.on = on;
    this.load = load;
  }

  get isReady() {
    return this.#detector !== null && !this.#isBusy;
  }

  async close() {
    this.#era += 1;
    const previous = this.#detector;
    this.#detector = null;
    this.#scene?.dispose();
    this.#scene = null;
    await previous?.dispose();
  }

  async open(options, bodies) {
    const closing = this.close();
    // The era of this call, not that of a later one that begins while the previous detector is let go.
    const era = this.#era;
    await closing;
    if (era !== this.#era) return;
    this.on.note("WebGPU compiles its kernels …");
    let opened = null;
    let scene = null;
    try {
      const { Detector, Scene } = await this.load();
      opened = await Detector.open(options);
      scene = new Scene();
      for (const body of bodies) scene.add(meshOf(body));
      if (era !== this.#era) return letGo(opened, scene);
      this.#detector = opened;
      this.#scene = scene;
      this.on.stale();
    } catch (error) {
      letGo(opened, scene);
      if (era === this.#era) this.on.note(`WebGPU failed: ${error.message}`, true);
    }
  }

  // Asks about the bodies as they are. `asked` is handed back with the answer.
  async ask(bodies, which, asked) {
    const [detector, scene, era] = [this.#detector, this.#scene, this.#era];
    this.#isBusy = true;
    try {
      for (const [ix, { now }] of bodies.entries()) scene.setPositions(ix, now);
      const { length, hash, stats } = await detector.detect(scene, { which });
      if (era === this.#era) this.on.answer(length, stats.totalMs, hash, asked);
    } catch (error) {
      if (era === this.#era) {
        this.#detector = null;
        this.#scene = null;
        letGo(detector, scene);
        this.on.note(`WebGPU failed: ${error.message}`, true);
      }
    } finally {
      this.#isBusy = false;
    }
  }
}
