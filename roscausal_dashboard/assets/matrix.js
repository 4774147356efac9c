// The links of a model with many variables as a matrix: effects in rows, causes in columns, a mark for each link. The fill tells the
// lag, the size the confidence (or else the strength), the shape the sign.

import { element } from "./draw.js";
import { sentence } from "./graph.js";

/** From this many variables on the matrix stands below the graph. */
export const MANY = 16;
const [SLOT, LEFT, TOP, KEY] = [13, 96, 96, 34];
/** Classes of lags, from none to the longest. */
const SHADES = 5;

/** What the size of a mark shows of a link, from 0 to 1. */
const share = (link, sure) => (sure ? link.confidence ?? 0 : Math.min(Math.abs(link.value), 1));

const shade = (lag, longest) => `shade-${Math.min(SHADES - 1, Math.round((lag / longest) * (SHADES - 1)))}`;

/** Draws the links of `model`. A mark that is clicked, tapped or given Enter calls `ask` with its link. */
export function drawMatrix(svg, model, ask) {
  svg.replaceChildren();
  const names = model.features;
  const place = new Map(names.map((name, i) => [name, i]));
  // Each lag has its own place within a cell.
  const first = Math.min(1, ...model.links.map((link) => link.lag));
  const longest = Math.max(1, ...model.links.map((link) => link.lag));
  const side = Math.ceil(Math.sqrt(longest - first + 1));
  const cell = SLOT * side + 5;
  const size = cell * names.length;
  const sure = model.links.some((link) => link.confidence !== null && link.confidence !== undefined);
  svg.setAttribute("viewBox", `0 0 ${LEFT + size + 8} ${TOP + size + KEY}`);
  names.forEach((name, i) => {
    const middle = cell * (i + 0.5);
    const text = name.length > 12 ? `${name.slice(0, 11)}…` : name;
    element("path", { class: "lane", d: `M ${LEFT} ${TOP + middle} h ${size} M ${LEFT + middle} ${TOP} v ${size}` }, svg);
    element("text", { x: LEFT - 6, y: TOP + middle + 4, "text-anchor": "end" }, svg, text);
    element("text", { transform: `translate(${LEFT + middle + 4} ${TOP - 6}) rotate(-90)`, "text-anchor": "start" }, svg, text);
  });
  element("path", { class: "frame", d: `M ${LEFT} ${TOP} h ${size} v ${size} h ${-size} Z` }, svg);
  for (const link of model.links) {
    const [column, row] = [place.get(link.cause), place.get(link.effect)];
    if (column === undefined || row === undefined) continue;
    const [slot, half] = [link.lag - first, (0.16 + 0.3 * share(link, sure)) * SLOT];
    const x = LEFT + cell * column + 2.5 + SLOT * ((slot % side) + 0.5);
    const y = TOP + cell * row + 2.5 + SLOT * (Math.floor(slot / side) + 0.5);
    const words = `${sentence(link, model)}${sure ? `, confidence ${(link.confidence ?? 0).toFixed(2)}` : ""}`;
    const spot = element("g", { class: "cell", role: "button", tabindex: 0, "data-link": `${link.cause} ${link.effect} ${link.lag}`, "aria-label": `Evidence: ${words}` }, svg);
    element("title", {}, spot, words);
    element("rect", { class: "reach", x: x - SLOT / 2, y: y - SLOT / 2, width: SLOT, height: SLOT }, spot);
    element("rect", { class: `mark ${shade(link.lag, longest)}`, x: x - half, y: y - half, width: 2 * half, height: 2 * half, rx: link.value < 0 ? 0 : half }, spot);
    spot.addEventListener("click", () => ask(link));
    spot.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      ask(link);
    });
  }
  const key = TOP + size + 18;
  element("text", { x: LEFT - 6, y: key + 4, "text-anchor": "end" }, svg, "lag");
  for (let i = 0; i < SHADES; i++) element("rect", { class: `mark shade-${i}`, x: LEFT + 16 * i, y: key - 6, width: 14, height: 12 }, svg);
  element("text", { x: LEFT + 16 * SHADES + 4, y: key + 4 }, svg, `0 to ${longest} · size: ${sure ? "confidence" : "strength"} · circle +, square −`);
  svg.setAttribute("aria-label", `Matrix of ${model.links.length} links: rows are effects, columns causes`);
}
