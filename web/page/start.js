// Loads the page and says so. Files that are chosen or dropped meanwhile are opened once it is loaded.

import { element, say } from "./text.js";

const MODULE = "impinge/cpu/impinge_bg.wasm";

// They are disabled until the page is loaded.
const controls = [...document.querySelectorAll("button:not(#retry), select, input:not(#files)")];
// What opens files, once it is there, and what waits for it: files and names of folders.
let open = null;
const waiting = [];
let share = "";
// Why the page is not there; nothing while it loads. Files wait on unless they are lost.
let problem = "";
let isLost = false;
let nFailed = 0;
let nFailedImports = 0;

function tell() {
  const names = waiting.flatMap(([files]) => files.map(({ name }) => name)).join(", ");
  const next = names === "" ? "" : ` ${isLost ? "Not opened" : "Next"}: ${names}.`;
  say("status", problem === "" ? `Loading …${share}${next}` : "");
  say("message", problem === "" ? "" : `${problem}${next}`);
}

// The module is compiled while it comes. How large it is, is not known if it is compressed on its way.
async function compiled(signal) {
  const response = await fetch(MODULE, { signal, cache: nFailed > 0 ? "reload" : "default" });
  if (!response.ok) throw new Error(`${MODULE}: ${response.status} ${response.statusText}`);
  const { headers, body } = response;
  const all = headers.has("content-encoding") ? 0 : Number(headers.get("content-length"));
  let n = 0;
  const counted = new TransformStream({
    transform(chunk, to) {
      n += chunk.length;
      share = all > 0 ? ` ${Math.floor((100 * n) / all)} %` : ` ${(n / 1e6).toFixed(1)} MB`;
      if (!signal.aborted) tell();
      to.enqueue(chunk);
    },
    // The scripts may take longer.
    flush() {
      share = "";
      if (!signal.aborted) tell();
    },
  });
  return WebAssembly.compileStreaming(new Response(body.pipeThrough(counted), { headers: { "content-type": "application/wasm" } }));
}

async function imported() {
  try {
    return await Promise.all([import("impinge"), import("./main.js")]);
  } catch (error) {
    nFailedImports += 1;
    throw error;
  }
}

async function load() {
  const loading = new AbortController();
  try {
    return await Promise.all([imported(), compiled(loading.signal)]);
  } catch (error) {
    nFailed += 1;
    loading.abort();
    // Some browsers remember that an import failed.
    isLost = nFailedImports > 1;
    const advice = isLost ? "Reload it once you are online, and open files then." : "Try again once you are online.";
    problem = `The page could not be loaded. ${advice} (${error.message ?? error})`;
    element("retry").textContent = isLost ? "Reload" : "Try again";
    element("retry").hidden = false;
    return null;
  }
}

async function start() {
  element("retry").hidden = true;
  problem = "";
  share = "";
  tell();
  const loaded = await load();
  if (loaded === null) return tell();
  const [[{ default: init }, main], module] = loaded;
  try {
    await init(module);
    for (const control of controls) control.disabled = false;
    main.begin();
  } catch (error) {
    for (const control of controls) control.disabled = true;
    isLost = true;
    problem = String(error.message ?? error);
    return tell();
  }
  say("status", "");
  open = main.open;
  for (const given of waiting.splice(0)) void open(...given);
}

function offer(files, folders = []) {
  // Text may be dropped, too.
  if (files.length + folders.length === 0) return;
  if (open !== null) return void open(files, folders);
  waiting.push([files, folders]);
  tell();
}

function offerChosen() {
  const chosen = [...element("files").files];
  element("files").value = "";
  offer(chosen);
}

element("files").addEventListener("change", offerChosen);
window.addEventListener("dragover", () => document.body.classList.add("dropping"));
for (const done of ["dragleave", "drop"]) {
  window.addEventListener(done, () => document.body.classList.remove("dropping"));
}
window.addEventListener("drop", ({ dataTransfer: { files: dropped, items } }) => {
  const entries = [...items].filter(({ kind }) => kind === "file").map((item) => item.webkitGetAsEntry?.());
  offer([...dropped], entries.filter((entry) => entry?.isDirectory).map(({ name }) => name));
});
element("retry").addEventListener("click", () => (isLost ? location.reload() : void start()));
// What was offered before this script was there.
for (const files of window.early) offer(files);
delete window.early;
offerChosen();
void start();
