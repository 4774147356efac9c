// What all drawings share: elements, numbers, times, ticks.

const SVG = "http://www.w3.org/2000/svg";

/** The element of the page with this id. */
export const $ = (id) => document.getElementById(id);

/** A new SVG element. Text from outside becomes text, never markup. */
export const element = (name, attributes = {}, parent, text) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  parent?.append(made);
  return made;
};

/** A new HTML element. */
export const make = (name, text, kind) => {
  const made = document.createElement(name);
  made.textContent = text ?? "";
  if (kind) made.className = kind;
  return made;
};

/** A time: of the day if it is one, else seconds. */
export const clock = (t) => (t > 1e8 ? new Date(t * 1000).toISOString().slice(11, 19) : `${t.toFixed(1)} s`);

/** The step of about `count` round ticks over `span`: 1, 2 or 5 times a power of ten. */
export function step(span, count) {
  const rough = Math.max(span, 1e-12) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((by) => by * power >= rough * 0.999);
}

/** Round ticks from `low` to `high`, with as many digits as they need. */
export function ticks(low, high, count) {
  const by = step(high - low, count);
  const digits = Math.min(8, Math.max(0, -Math.floor(Math.log10(by) + 1e-9)));
  const found = [];
  for (let i = Math.ceil(low / by - 1e-9); i * by <= high + 1e-9 * by && found.length < 50; i++) found.push([i * by, (i * by).toFixed(digits)]);
  return found;
}
