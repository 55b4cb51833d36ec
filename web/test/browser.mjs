// A headless Chromium with WebGPU on its software driver, and a server for its files.

import { chromium } from "playwright-core";

export { serve } from "../serve.mjs";

// Debian's Chromium, or the one that IMPINGE_CHROMIUM names. Without `gpu` it offers no WebGPU.
export function launch({ gpu = true } = {}) {
  const webgpu = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"];
  return chromium.launch({
    executablePath: process.env.IMPINGE_CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox",
      ...(gpu ? webgpu : ["--disable-features=WebGPUService", "--disable-blink-features=WebGPU"]),
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
    ],
  });
}
