// Where bodies collide: connected groups of colliding elements, as the program's window lists them.

// The places of an answer, the largest first. `rows` are `[bodyA, i, bodyB, j]` per pair; a body has `index`, `corners` and the
// positions `now`. Two elements are connected if they are a pair, or share a vertex.
export function places(rows, bodies) {
  const numbers = bodies.map(() => new Map());
  const colliding = [];
  const parents = [];
  const find = (x) => {
    while (parents[x] !== x) {
      parents[x] = parents[parents[x]];
      x = parents[x];
    }
    return x;
  };
  const join = (a, b) => {
    const [x, y] = [find(a), find(b)];
    parents[Math.max(x, y)] = Math.min(x, y);
  };
  const numberOf = (body, element) => {
    const known = numbers[body].get(element);
    if (known !== undefined) return known;
    const number = parents.length;
    numbers[body].set(element, number);
    parents.push(number);
    colliding.push([body, element]);
    return number;
  };
  for (let at = 0; at < rows.length; at += 4) {
    join(numberOf(rows[at], rows[at + 1]), numberOf(rows[at + 2], rows[at + 3]));
  }
  const firstAt = bodies.map(() => new Map());
  for (const [number, [body, element]] of colliding.entries()) {
    for (const vertex of cornersOf(bodies[body], element)) {
      const first = firstAt[body].get(vertex);
      if (first === undefined) firstAt[body].set(vertex, number);
      else join(first, number);
    }
  }
  const found = new Map();
  for (const [number, [body, element]] of colliding.entries()) {
    const root = find(number);
    const place = found.get(root) ?? { n: 0, first: [body, element], bodies: new Set(), ...emptyBox() };
    found.set(root, place);
    place.n += 1;
    place.bodies.add(body);
    for (const vertex of cornersOf(bodies[body], element)) extend(place, bodies[body].now, 3 * vertex);
  }
  return [...found.values()].sort((a, b) => b.n - a.n);
}

export function cornersOf({ index, corners }, element) {
  return index.subarray(element * corners, (element + 1) * corners);
}

export function emptyBox() {
  return { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
}

// Lets a box hold the point whose coordinates begin at `at`.
export function extend({ low, high }, positions, at) {
  for (let axis = 0; axis < 3; axis += 1) {
    low[axis] = Math.min(low[axis], positions[at + axis]);
    high[axis] = Math.max(high[axis], positions[at + axis]);
  }
}

// The middle of a box, and half of its diagonal. Halves first: the sum of two large numbers may not be finite.
export function ballAround({ low, high }) {
  const half = low.map((x, axis) => high[axis] / 2 - x / 2);
  const radius = Math.hypot(...half);
  return {
    centre: low.map((x, axis) => x / 2 + high[axis] / 2),
    radius: radius > 0 && Number.isFinite(radius) ? radius : 1,
  };
}
