// The state of a scene in the page's address, so that a link shows what the visitor sees.

const NUMBER = /^-?\d+(\.\d+)?$/;

function numbers(text, n) {
  const parts = text?.split(",") ?? [];
  return parts.length > 0 && parts.length === (n ?? parts.length) && parts.every((part) => NUMBER.test(part)) ? parts.map(Number) : null;
}

// `{ scene, size, time, self, eye, moved }` as the part of an address after `#`. `eye` is the camera and the point it looks at,
// `moved` a displacement per body.
export function toLink({ scene, size, time, self, eye, moved }) {
  const short = (list) => list.map((x) => String(Number(x.toFixed(4)))).join(",");
  const parts = [`scene=${scene}`, `triangles=${size}`];
  if (time !== null) parts.push(`time=${short([time])}`);
  parts.push(`self=${self ? 1 : 0}`);
  if (eye) parts.push(`eye=${short(eye)}`);
  if (moved.some((by) => by.some((x) => x !== 0))) parts.push(`moved=${short(moved.flat())}`);
  return `#${parts.join("&")}`;
}

// The state that an address holds. Parts that are absent, or make no sense, are `null`.
export function fromLink(hash, scenes) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  const scene = given.get("scene");
  const self = given.get("self");
  return {
    scene: Object.hasOwn(scenes, scene) ? scene : null,
    size: numbers(given.get("triangles"), 1)?.[0] ?? null,
    time: numbers(given.get("time"), 1)?.[0] ?? null,
    self: self === "1" || self === "0" ? self === "1" : null,
    eye: numbers(given.get("eye"), 6),
    moved: numbers(given.get("moved")),
  };
}
