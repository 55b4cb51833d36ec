// Loads the page and says so. Files that are chosen or dropped meanwhile are opened once it is loaded.

import { element, say } from "./text.js";

const MODULE = "impinge/cpu/impinge_bg.wasm";

const controls = [...document.querySelectorAll("button:not(#retry), select, input:not(#files)")];
// What opens files, once it is there, and the files that wait for it: the last that were offered.
let open = null;
let waiting = null;
let share = "";
let nFailed = 0;

function tell() {
  const then = waiting === null ? "" : ` Then ${waiting[0].map(({ name }) => name).join(", ")} is opened.`;
  say("status", `Loading …${share}${then}`);
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

async function start() {
  for (const control of controls) control.disabled = true;
  element("retry").hidden = true;
  say("message", "");
  share = "";
  tell();
  const loading = new AbortController();
  try {
    const [{ default: init }, main, module] = await Promise.all([import("impinge"), import("./main.js"), compiled(loading.signal)]);
    await init(module);
    for (const control of controls) control.disabled = false;
    main.begin();
    say("status", "");
    open = main.open;
    if (waiting !== null) void open(...waiting);
  } catch (error) {
    nFailed += 1;
    loading.abort();
    say("status", "");
    say("message", `The page could not be loaded. Try again once you are online. (${error.message ?? error})`);
    element("retry").hidden = false;
  }
}

function offer(...files) {
  if (open !== null) return void open(...files);
  waiting = files;
  if (element("retry").hidden) tell();
}

element("files").addEventListener("change", ({ target }) => {
  offer([...target.files]);
  target.value = "";
});
window.addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
});
for (const done of ["dragleave", "drop"]) {
  window.addEventListener(done, () => document.body.classList.remove("dropping"));
}
window.addEventListener("drop", (event) => {
  event.preventDefault();
  const { files: dropped, items } = event.dataTransfer;
  const entries = [...items].filter(({ kind }) => kind === "file").map((item) => item.webkitGetAsEntry?.());
  offer([...dropped], entries.filter((entry) => entry?.isDirectory).map(({ name }) => name));
});
// Some browsers remember that an import failed.
element("retry").addEventListener("click", () => (nFailed > 1 ? location.reload() : void start()));
void start();
