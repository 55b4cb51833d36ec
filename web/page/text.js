// Text on the page, and numbers in it.

export const element = (id) => document.getElementById(id);

// Shows a text, or nothing.
export function say(id, text) {
  element(id).textContent = text;
  element(id).hidden = text === "";
}

export const grouped = (n) => n.toLocaleString("en");

export function counted(n, word, words = `${word}s`) {
  return `${grouped(n)} ${n === 1 ? word : words}`;
}
