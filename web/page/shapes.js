// Surfaces with one vertex per point, and the scenes that the page shows before a file is dropped.
//
// Geometries of three.js repeat the vertices of their seams, because texture coordinates differ there. Self-collision
// needs to know which triangles are neighbours, so these share them.

const TAU = 2 * Math.PI;

// A grid of n by m vertices that closes in both directions.
function closedGrid(n, m, point) {
  const positions = new Float32Array(3 * n * m);
  const index = new Uint32Array(6 * n * m);
  for (let i = 0; i < n; i += 1) {
    for (let j = 0; j < m; j += 1) {
      positions.set(point(i / n, j / m), 3 * (i * m + j));
      const [right, up] = [((i + 1) % n) * m, (j + 1) % m];
      const [a, b, c, d] = [i * m + j, right + j, right + up, i * m + up];
      index.set([a, b, c, a, c, d], 6 * (i * m + j));
    }
  }
  return { index, positions };
}

// A sphere of about n triangles: rings between two poles.
export function ball(n, radius) {
  const rings = Math.max(3, Math.round(Math.sqrt(n / 4)));
  const around = 2 * rings;
  const positions = [0, 0, radius];
  for (let ring = 1; ring < rings; ring += 1) {
    const [z, r] = [Math.cos((Math.PI * ring) / rings), Math.sin((Math.PI * ring) / rings)];
    for (let k = 0; k < around; k += 1) {
      const turn = (TAU * k) / around;
      positions.push(radius * r * Math.cos(turn), radius * r * Math.sin(turn), radius * z);
    }
  }
  const last = positions.length / 3;
  positions.push(0, 0, -radius);
  const at = (ring, k) => 1 + (ring - 1) * around + (k % around);
  const index = [];
  for (let k = 0; k < around; k += 1) {
    index.push(0, at(1, k), at(1, k + 1));
    for (let ring = 1; ring < rings - 1; ring += 1) {
      const [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
      index.push(a, b, c, a, c, d);
    }
    index.push(last, at(rings - 1, k + 1), at(rings - 1, k));
  }
  return { index: Uint32Array.from(index), positions: Float32Array.from(positions) };
}

// A trefoil-like knot of about n triangles: a tube around a curve on a torus.
function knot(n, size, tube) {
  const around = Math.max(6, Math.round(Math.sqrt(n / 24)));
  const along = Math.max(12, Math.round(n / 2 / around));
  const centre = (u) => {
    const [p, q] = [2 * TAU * u, 3 * TAU * u];
    const r = size * (1 + 0.4 * Math.cos(q));
    return [r * Math.cos(p), r * Math.sin(p), 0.4 * size * Math.sin(q)];
  };
  return closedGrid(along, around, (u, v) => {
    const here = centre(u);
    const ahead = centre(u + 1e-3);
    const tangent = unit(ahead.map((x, axis) => x - here[axis]));
    const side = unit(cross(tangent, here));
    const up = cross(side, tangent);
    const [s, c] = [tube * Math.sin(TAU * v), tube * Math.cos(TAU * v)];
    return here.map((x, axis) => x + c * side[axis] + s * up[axis]);
  });
}

function cross([a, b, c], [x, y, z]) {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
}

function unit(v) {
  const length = Math.hypot(...v);
  return v.map((x) => x / length);
}

// Writes `at(x, y, z, t)` of every vertex of the rest pose.
function moved(at) {
  return (rest, t, now) => {
    for (let ix = 0; ix < rest.length; ix += 3) {
      const [x, y, z] = at(rest[ix], rest[ix + 1], rest[ix + 2], t);
      now[ix] = x;
      now[ix + 1] = y;
      now[ix + 2] = z;
    }
  };
}

// The scene of `impinge demo`: a worm bends into a ring until its head runs into its tail, a rippling knot sinks through
// the ring, and a bumpy, twisting ball comes in from the side.
function ring(nTriangles) {
  const n = nTriangles / 3;
  const length = 3;
  const worm = ball(n, 1);
  for (let ix = 0; ix < worm.positions.length; ix += 3) {
    // The poles become head and tail.
    const [x, y, z] = worm.positions.subarray(ix, ix + 3);
    worm.positions.set([(length / 2) * z, 0.1 * x, 0.1 * y], ix);
  }
  const bumpy = ball(n, 0.22);
  for (let ix = 0; ix < bumpy.positions.length; ix += 3) {
    const [x, y, z] = bumpy.positions.subarray(ix, ix + 3).map((value) => value / 0.22);
    const bump = 1 + 0.25 * Math.sin(9 * x) * Math.sin(9 * y) * Math.sin(9 * z);
    bumpy.positions.set([0.22 * x * bump, 0.22 * y * bump, 0.22 * z * bump], ix);
  }
  return [
    {
      name: "worm",
      ...worm,
      pose: moved((x, y, z, t) => {
        const curvature = ((0.3 + 0.77 * t) * TAU) / length;
        const radius = 1 / curvature;
        const angle = curvature * x;
        return [(radius - y) * Math.sin(angle), radius - (radius - y) * Math.cos(angle) - 0.45, z];
      }),
    },
    {
      name: "knot",
      ...knot(n, 0.25, 0.055),
      pose: moved((x, y, z, t) => {
        const wave = 0.015 * Math.sin((TAU * (x - t)) / 0.12);
        return [x, y, z + wave + 0.55 - 0.55 * t];
      }),
    },
    {
      name: "ball",
      ...bumpy,
      pose: moved((x, y, z, t) => {
        const turn = 5 * t * x;
        const [s, c] = [Math.sin(turn), Math.cos(turn)];
        return [x + 1.55 - 0.9 * t, c * y - s * z + 0.1, s * y + c * z];
      }),
    },
  ];
}

// A ball falls through a cloth. It is on one side in a frame and on the other in the next: no frame intersects, the steps do.
function fall(nTriangles) {
  const FRAMES = 7;
  const cells = Math.max(4, Math.round(Math.sqrt(nTriangles / 3)));
  const cloth = { index: [], positions: [] };
  for (let i = 0; i <= cells; i += 1) {
    for (let j = 0; j <= cells; j += 1) {
      cloth.positions.push((1.6 * i) / cells - 0.8, (1.6 * j) / cells - 0.8, 0);
      if (i === cells || j === cells) continue;
      const [a, b] = [i * (cells + 1) + j, (i + 1) * (cells + 1) + j];
      cloth.index.push(a, b, b + 1, a, b + 1, a + 1);
    }
  }
  const falling = ball(nTriangles / 3, 0.13);
  const frames = (positions, at) =>
    Array.from({ length: FRAMES }, (_, frame) => {
      const now = new Float32Array(positions.length);
      at(positions, frame, now);
      return now;
    });
  const flow = moved((x, y, z, t) => [x, y, z + 0.03 * Math.sin(5 * x + t) * Math.cos(4 * y - t)]);
  const drop = moved((x, y, z, t) => [x + 0.1, y - 0.05, z + 0.95 - 0.045 * t * t]);
  return [
    {
      name: "cloth",
      index: Uint32Array.from(cloth.index),
      positions: Float32Array.from(cloth.positions),
      frames: frames(cloth.positions, flow),
    },
    { name: "ball", ...falling, frames: frames(falling.positions, drop) },
  ];
}

// Scenes by name: bodies of about as many triangles as asked for, the ball of space where they meet, and, if they come
// from farther away, how far they ever are from its centre, and the moment shortly before they meet at which the scene begins to play.
export const SCENES = {
  ring: { make: ring, centre: [0.1, -0.05, 0.05], radius: 0.95, reach: 1.75, begin: 0.6, self: true },
  fall: { make: fall, centre: [0, 0, 0.12], radius: 1.2, self: false },
};
