// Where bodies are at a moment, and all the room that they need.

import { emptyBox, extend } from "./places.js";

// Writes the positions of a body at a moment: between two frames, every vertex is on the straight line.
export function pose({ pose: steady, frames, positions, offset }, at, to) {
  if (steady) steady(positions, at, to);
  else if (frames) {
    const from = Math.min(Math.floor(at), frames.length - 1);
    const share = at - from;
    to.set(frames[from]);
    const next = frames[from + 1];
    if (share > 0 && next) for (let ix = 0; ix < to.length; ix += 1) to[ix] += share * (next[ix] - to[ix]);
  } else to.set(positions);
  if (offset.some((x) => x !== 0)) for (let ix = 0; ix < to.length; ix += 1) to[ix] += offset[ix % 3];
  return to;
}

// A body as a scene takes it.
export const meshOf = ({ index, corners, now }) => ({ [corners === 4 ? "tetrahedra" : "faces"]: index, positions: now });

// The box around all frames of all bodies.
export function extentOf(given) {
  const box = emptyBox();
  for (const { frames, positions } of given) {
    for (const all of frames ?? [positions]) for (let at = 0; at < all.length; at += 3) extend(box, all, at);
  }
  return box;
}
