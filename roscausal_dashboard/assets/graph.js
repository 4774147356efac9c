// The causal graph of one model, compared with the previous one. A variable keeps its place from model to model.

import { element } from "./draw.js";

const NODE = 34;

const key = (link) => `${link.cause}\n${link.effect}\n${link.lag}`;
const plus = (p, q, by = 1) => [p[0] + q[0] * by, p[1] + q[1] * by];
const towards = (from, to) => {
  const d = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(...d) || 1;
  return [d[0] / length, d[1] / length];
};

/** The links of `model`, with `state` new or same, and those links of `before` that are gone. */
export function compared(model, before) {
  const had = new Set((before?.links ?? []).map(key));
  const has = new Set(model.links.map(key));
  const links = model.links.map((link) => ({ ...link, state: before && !had.has(key(link)) ? "new" : "same" }));
  return [...links, ...(before?.links ?? []).filter((link) => !has.has(key(link))).map((link) => ({ ...link, state: "gone" }))];
}

/** GPDC's p-values are fractions of 500 null values, so 0 means "below 0.002". */
const smallestP = (test) => (test.startsWith("gpdc") ? 0.002 : 0.001);

/** Solid below the smallest p-value that is told, long dashes below 0.01, short ones above: as in the pictures of `roscausal show`. */
const dash = (p, test) => (p < smallestP(test) ? "none" : p < 0.01 ? "14 5" : "5 4");

/** A link as a sentence. */
export function sentence(link, { dt, test }) {
  const earlier = link.lag === 0 ? "at the same time" : `at t-${link.lag}${dt > 0 ? ` (${+(link.lag * dt).toFixed(3)} s earlier)` : ""}`;
  const effect = link.cause === link.effect ? "itself" : link.effect;
  const smallest = smallestP(test);
  const p = link.p < smallest ? `p < ${smallest}` : `p = ${link.p.toFixed(3)}`;
  // What is not an arrow of a cause comes in the node's own words.
  const words = link.words ?? `${link.cause} ${earlier} drives ${effect}`;
  return link.tested ? `${words}: strength ${link.value.toFixed(2)}, ${p}` : `${words}: required, not tested`;
}

/** Draws `model`. An arrow that is clicked, tapped or given Enter calls `ask` with its strongest link. */
export function drawGraph(svg, model, before, ask) {
  svg.replaceChildren();
  const names = model.features;
  const links = compared(model, before);
  const radius = names.length <= 2 ? 90 : 70 + 24 * names.length;
  const size = 2 * (radius + NODE + 66);
  const centre = [Math.max(size, 400) / 2, size / 2];
  const places = new Map(names.map((name, i) => {
    const angle = (names.length === 2 ? Math.PI : -Math.PI / 2) + (2 * Math.PI * i) / names.length;
    const r = names.length === 1 ? 0 : radius;
    return [name, [centre[0] + r * Math.cos(angle), centre[1] + r * Math.sin(angle)]];
  }));
  // Space for loops and their labels around the outermost nodes.
  const [xs, ys] = [0, 1].map((i) => [...places.values(), ...(names.length ? [] : [centre])].map((place) => place[i]));
  const [left, top] = [Math.min(...xs) - NODE - 96, Math.min(...ys) - NODE - 62];
  svg.setAttribute("viewBox", `${left} ${top} ${Math.max(...xs) + NODE + 96 - left} ${Math.max(...ys) + NODE + 62 - top}`);
  const labels = [];
  for (const group of grouped(links)) {
    const [from, to] = [places.get(group.cause), places.get(group.effect)];
    if (!from || !to) continue;
    const forth = names.indexOf(group.cause) < names.indexOf(group.effect);
    const curve = group.cause === group.effect ? loop(from, centre) : arc(from, to, names.length > 4 ? centre : undefined, forth);
    const asking = element("g", { class: "ask", "data-link": `${group.cause} ${group.effect} ${group.lag}` }, svg);
    arrow(asking, curve, group, dash(group.p, model.test));
    if (group.state !== "gone") askable(asking, group, model, ask);
    labels.push([curve, `${group.lags.join(",")} · ${group.tested ? group.value.toFixed(2) : "required"}`, group.state]);
  }
  for (const [name, [x, y]] of places) {
    element("circle", { class: "node", cx: x, cy: y, r: NODE }, svg);
    element("text", { x, y: y + 5, "font-size": 13 }, svg, name);
  }
  const taken = [...places.values()].map(([x, y]) => [x, y, NODE + 1, NODE + 1]);
  for (const [curve, text, state] of labels) {
    const place = free(curve, 4 * text.length + 2, taken);
    // Where there is no room the arrow's name and the list say it.
    if (!place) continue;
    const [x, y] = place;
    element("rect", { class: "plate", x: x - 4 * text.length - 2, y: y - 9, width: 8 * text.length + 4, height: 18, rx: 4 }, svg);
    element("text", { x, y: y + 4, class: state === "gone" ? "quiet" : "" }, svg, text);
  }
  if (!links.length) element("text", { x: centre[0], y: centre[1], class: "quiet" }, svg, "no causal link found");
  const words = model.links.map((link) => link.words ?? `${link.cause} at lag ${link.lag} drives ${link.effect}`).join("; ");
  svg.setAttribute("aria-label", `Causal graph of model ${model.number}: ${words || "no links"}`);
}

function askable(group, link, model, ask) {
  group.setAttribute("tabindex", "0");
  group.setAttribute("role", "button");
  group.setAttribute("aria-label", `Evidence: ${sentence(link, model)}`);
  group.addEventListener("click", () => ask(link));
  group.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    ask(link);
  });
}

/** One arrow per pair: all lags, the strongest value. */
function grouped(links) {
  const groups = new Map();
  for (const link of links) {
    const id = `${link.cause}\n${link.effect}\n${link.state === "gone"}`;
    const group = groups.get(id) ?? { ...link, lags: [] };
    group.lags.push(link.lag);
    if (Math.abs(link.value) > Math.abs(group.value)) Object.assign(group, { value: link.value, tested: link.tested, lag: link.lag, p: link.p, mark: link.mark, words: link.words });
    if (link.state === "new") group.state = "new";
    groups.set(id, group);
  }
  return groups.values();
}

/** A place on the curve where a label of this half width meets neither a variable nor another label. */
function free({ start, bend, end, label }, half, taken) {
  const on = (t) => [0, 1].map((i) => (1 - t) ** 2 * start[i] + 2 * t * (1 - t) * bend[i] + t ** 2 * end[i]);
  const meets = ([x, y]) => taken.some(([ox, oy, w, h]) => Math.abs(x - ox) < half + w && Math.abs(y - oy) < 9 + h);
  const place = [label, ...[0.42, 0.58, 0.34, 0.66, 0.27, 0.73].map(on)].find((at) => !meets(at));
  if (place) taken.push([...place, half, 9]);
  return place;
}

/**
 * An arrow to another variable. On a ring of many it bends towards the centre: the chord between two places of a ring has all
 * other places on its outer side, so it passes none of them. The way back bends more, so that both are seen.
 */
function arc(from, to, centre, forth) {
  const along = towards(from, to);
  const distance = Math.hypot(to[0] - from[0], to[1] - from[1]);
  const middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
  let [side, by] = [[along[1], -along[0]], 0.18 * distance];
  if (centre && Math.hypot(middle[0] - centre[0], middle[1] - centre[1]) > 1) {
    const inwards = towards(middle, centre);
    if (side[0] * inwards[0] + side[1] * inwards[1] < 0) side = [-side[0], -side[1]];
    by = (forth ? 0.18 : 0.36) * distance;
  }
  const bend = plus(middle, side, by);
  const [start, end] = [plus(from, towards(from, bend), NODE), plus(to, towards(to, bend), NODE + 2)];
  return { start, bend, end, label: [0.25 * start[0] + 0.5 * bend[0] + 0.25 * end[0], 0.25 * start[1] + 0.5 * bend[1] + 0.25 * end[1]] };
}

function loop(at, centre) {
  const out = at[0] === centre[0] && at[1] === centre[1] ? [0, -1] : towards(centre, at);
  const side = [-out[1], out[0]];
  const rim = (turn) => plus(plus(at, out, NODE * Math.cos(turn)), side, NODE * Math.sin(turn));
  const peak = 2.05 * NODE;
  return { start: rim(-0.6), bend: plus(at, out, 3.1 * NODE), end: rim(0.62), label: plus(at, out, peak + 14 + 20 * Math.abs(out[0])) };
}

function arrow(svg, { start, bend, end }, link, dashes) {
  const width = 1.5 + 5 * Math.min(Math.abs(link.value), 1);
  const size = 6 + 1.8 * width;
  const back = towards(end, bend);
  const neck = (link.mark ?? "-->")[2] === ">" ? plus(end, back, size * 0.9) : end;
  const d = `M ${start} Q ${bend} ${neck}`;
  const kind = `${link.state}${link.value < 0 ? " negative" : ""}`;
  if (link.state === "new") element("path", { class: "halo", d, "stroke-width": width + 8 }, svg);
  element("path", { class: "reach", d }, svg);
  element("path", { class: `edge ${kind}`, d, "stroke-width": link.state === "gone" ? 2 : width, "stroke-dasharray": dashes }, svg);
  const [tail, , tip] = link.mark ?? "-->";
  ending(svg, tip, end, back, size, kind);
  ending(svg, tail, start, towards(start, bend), size, kind);
}

/** The end of a link at `at`, seen from which the link goes `back`: a head, a circle where the data do not tell, a cross where they contradict themselves. */
function ending(svg, mark, at, back, size, kind) {
  const half = size * 0.45;
  const aside = [-back[1], back[0]];
  const corner = (along, side) => plus(plus(at, back, along), aside, side);
  if (mark === ">" || mark === "<") {
    element("path", { class: `head ${kind}`, d: `M ${at} L ${corner(0.9 * size, half)} L ${corner(0.9 * size, -half)} Z` }, svg);
  } else if (mark === "o") {
    const [cx, cy] = plus(at, back, half);
    element("circle", { class: `end ${kind}`, cx, cy, r: half }, svg);
  } else if (mark === "x") {
    element("path", { class: `end ${kind}`, d: `M ${corner(0, half)} L ${corner(2 * half, -half)} M ${corner(0, -half)} L ${corner(2 * half, half)}` }, svg);
  }
}

const ENDS = { o: "a circle: the data do not tell whether there is a head", x: "a cross: the data contradict themselves" };

/** What the ends of these links mean, of those that are there. */
export function endsExplained(links) {
  const marks = links.map((link) => link.mark ?? "-->");
  const told = Object.keys(ENDS).filter((end) => marks.some((mark) => mark.includes(end))).map((end) => ENDS[end]);
  if (marks.includes("<->")) told.unshift("two heads: something not recorded drives both");
  return told.length ? `Ends of links: ${told.join("; ")}.` : "";
}
