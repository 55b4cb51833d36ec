// What the panels say: the bodies, the places where they collide, and the element that was chosen.

import { counted, element, grouped } from "./text.js";
import { colors } from "./view.js";

// Longer lists are no help, and slow.
const MOST_PLACES = 200;
const MOST_PARTNERS = 12;
const MOST_NOTES = 12;

// Named elements in one line: make("li", { className: "x" }, "text", child).
export function make(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function swatch(color) {
  const made = make("i", { className: "swatch" });
  made.style.background = color;
  return made;
}

const kindOf = ({ corners }) => (corners === 4 ? "tetrahedron" : "triangle");
const plural = (body) => (body.corners === 4 ? "tetrahedra" : "triangles");

// What of the files was left out or changed, as the program says it.
export function showNotes(meshes) {
  const notes = meshes.flatMap(({ name, notes }) => notes.map((note) => `${name}: ${note}`));
  const items = notes.slice(0, MOST_NOTES);
  if (notes.length > items.length) items.push(`and ${counted(notes.length - items.length, "more note")}`);
  element("notes").replaceChildren(...items.map((text) => make("li", {}, text)));
  element("notes").hidden = items.length === 0;
}

// The legend: a row per body, with its colours and a switch that hides it.
export function showBodies(bodies, hide) {
  element("bodies").replaceChildren(
    ...bodies.map((body, ix) => {
      const [own, colliding] = colors(ix);
      const shown = make("input", { type: "checkbox", checked: true });
      shown.addEventListener("change", () => hide(ix, !shown.checked));
      const name = make("span", { className: "name", title: body.name }, body.name);
      const label = make("label", { title: "Show this body" }, shown, swatch(own), name);
      const text = `${counted(body.index.length / body.corners, kindOf(body), plural(body))}, `;
      return make("li", {}, label, make("small", {}, text, swatch(colliding), make("b", {}, "0"), " collide"));
    }),
  );
}

export function showColliding(counts) {
  const cells = element("bodies").querySelectorAll("b");
  for (const [ix, n] of counts.entries()) cells[ix].textContent = grouped(n);
}

// The places: a button each.
export function showPlaces(places, bodies, go) {
  element("n-places").textContent = grouped(places.length);
  const items = places.slice(0, MOST_PLACES).map(({ n, bodies: which }, ix) => {
    const names = [...which].map((body) => bodies[body].name);
    const word = [...which].some((body) => bodies[body].corners === 4) ? "element" : "triangle";
    const where = bodies.length > 1 ? ` of ${names.join(" and ")}` : "";
    const button = make("button", { type: "button" }, `${counted(n, word)}${where}`);
    button.addEventListener("click", () => go(ix));
    return make("li", {}, button);
  });
  const more = places.length - items.length;
  if (more > 0) items.push(make("li", { className: "more" }, `and ${counted(more, "smaller place")}`));
  if (places.length === 0) items.push(make("li", { className: "more" }, "Nothing collides here."));
  element("place-list").replaceChildren(...items);
}

// Marks the button of one place, or of none.
export function markPlace(chosen) {
  for (const [ix, button] of element("place-list").querySelectorAll("button").entries()) {
    if (ix === chosen) button.setAttribute("aria-current", "true");
    else button.removeAttribute("aria-current");
  }
}

// The chosen element and its partners in `rows`; a button per partner goes there.
export function showChosen(hit, rows, bodies, go) {
  const box = element("chosen");
  box.hidden = hit === null;
  if (hit === null) return [];
  const partners = partnersOf(hit, rows);
  const { body } = hit;
  const title = make("b", {}, nameOf(bodies, body, hit.element));
  const links = partners.slice(0, MOST_PARTNERS).map(([other, number]) => {
    const text = other === body ? grouped(number) : nameOf(bodies, other, number);
    const button = make("button", { type: "button" }, text);
    button.addEventListener("click", () => go({ body: other, element: number }));
    return button;
  });
  const more = partners.length - links.length;
  const text = partners.length === 0 ? " meets none." : ` meets ${grouped(partners.length)}: `;
  box.replaceChildren(title, text, ...links.flatMap((link) => [link, " "]), more > 0 ? `and ${grouped(more)} more` : "");
  return partners;
}

export function nameOf(bodies, body, number) {
  const of = bodies.length > 1 ? ` of ${bodies[body].name}` : "";
  return `${kindOf(bodies[body])} ${grouped(number)}${of}`;
}

function partnersOf({ body, element: number }, rows) {
  const partners = [];
  for (let at = 0; at < rows.length; at += 4) {
    if (rows[at] === body && rows[at + 1] === number) partners.push([rows[at + 2], rows[at + 3]]);
    else if (rows[at + 2] === body && rows[at + 3] === number) partners.push([rows[at], rows[at + 1]]);
  }
  return partners;
}
