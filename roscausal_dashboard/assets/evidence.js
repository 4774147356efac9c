// What stands behind a link: opened by click, tap or Enter. All of it comes from the model's own run; nothing is computed
// here but where dots go.

import { element, make, ticks } from "./draw.js";

const [WIDTH, HEIGHT, LEFT, TOP, BOTTOM] = [300, 190, 46, 22, 152];

const same = (a, b) => a.cause === b.cause && a.effect === b.effect && a.lag === b.lag;

/** Shows in `place` what stands behind `link` of `model`. `seen` is the evidence of the model, if it is known. */
export function showEvidence(place, link, model, models, seen, words) {
  const found = seen?.links.find((other) => same(other, link));
  const list = make("dl");
  const fact = (name, value) => {
    const row = make("div");
    row.append(make("dt", name), make("dd", value));
    list.append(row);
  };
  fact("strength", link.tested ? link.value.toFixed(4) : "required, not tested");
  if (link.tested) fact("p-value", link.p < model.smallest_p ? `< ${model.smallest_p}` : String(+link.p.toFixed(4)));
  fact("samples", String(found?.n_samples ?? model.samples));
  if (typeof link.confidence === "number") fact("confidence", `${Math.round(100 * link.confidence)} % of the resamples have it`);
  if (found?.interval) fact("interval", found.interval.map((value) => value.toFixed(4)).join(" to "));
  if (found) {
    const given = found.conditions.map((c) => (c.lag ? `${c.name}(t-${c.lag})` : `${c.name}(t)`)).join(", ") || "nothing";
    fact("given", found.note ? `${given}; ${found.note}` : given);
  }
  const having = models.filter((other) => other.links.some((l) => same(l, link)));
  fact("found in", `${having.length} of ${models.length} models: ${having.length > 4 ? "..., " : ""}${having.slice(-4).map((m) => m.batch).join(", ")}`);
  const plots = make("div", "", "plots");
  if (found) {
    plots.append(lagFunction(found, model.level, model.has_sign));
    const axes = [`${found.cause}(t-${found.lag})`, `${found.effect}(t)`];
    plots.append(dots(found.scatter, `${found.scatter.length} of ${found.n_samples} samples`, ...axes));
    if (found.residuals.length) plots.append(dots(found.residuals, "After the conditions (linear)", ...axes));
  }
  const close = Object.assign(make("button", "Close"), { type: "button", id: "asked-close" });
  place.replaceChildren(make("h3", words), list, plots);
  if (!found) place.append(make("p", "The evidence of this model is not here: it is kept for the newest models, and only if the discovery node sends it."));
  place.append(close);
  place.hidden = false;
  place.dataset.link = `${link.cause} ${link.effect} ${link.lag}`;
  return close;
}

function frame(title) {
  const svg = element("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title });
  element("text", { x: LEFT, y: 13 }, svg, title);
  element("path", { class: "axes", d: `M ${LEFT} ${TOP} V ${BOTTOM} H ${WIDTH - 8}` }, svg);
  return svg;
}

function range(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const room = high > low ? 0.05 * (high - low) : Math.max(Math.abs(high), 1) / 2;
  return [low - room, high + room];
}

function upwards(svg, [low, high]) {
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (value - low)) / (high - low);
  for (const [value, text] of ticks(low, high, 4)) element("text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, svg, text);
  return y;
}

function lagFunction(found, level, has_sign) {
  const svg = frame("Strength at each lag");
  const band = found.band ?? 0;
  const y = upwards(svg, range([...found.lags.map((at) => at.value), 0, band, -band]));
  const [first, last] = [found.lags[0]?.lag ?? 0, found.lags.at(-1)?.lag ?? 1];
  const x = (lag) => LEFT + ((WIDTH - 8 - LEFT) * (lag - first + 0.6)) / (last - first + 1.2);
  if (band) element("rect", { class: "band", x: LEFT, width: WIDTH - 8 - LEFT, y: y(band), height: y(-band) - y(band) }, svg);
  element("path", { class: "axes", d: `M ${LEFT} ${y(0)} H ${WIDTH - 8}` }, svg);
  for (const at of found.lags) {
    const kind = !has_sign ? "stem unsigned" : at.value < 0 ? "stem negative" : "stem";
    element("path", { class: kind, d: `M ${x(at.lag)} ${y(0)} V ${y(at.value)}` }, svg);
    element("circle", { class: level !== null && at.p_value <= level ? `${kind} full` : kind, cx: x(at.lag), cy: y(at.value), r: 3.6 }, svg);
    if (at.lag === found.lag) element("circle", { class: "own", cx: x(at.lag), cy: y(at.value), r: 7 }, svg);
    element("text", { x: x(at.lag), y: BOTTOM + 15, "text-anchor": "middle" }, svg, String(at.lag));
  }
  element("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 5, "text-anchor": "middle" }, svg, "lag in steps");
  return svg;
}

function dots(points, title, across, up) {
  const svg = frame(title);
  if (!points.length) return svg;
  const [low, high] = range(points.map((p) => p[0]));
  const x = (value) => LEFT + ((WIDTH - 8 - LEFT) * (value - low)) / (high - low);
  const y = upwards(svg, range(points.map((p) => p[1])));
  element("path", { class: "dots", d: points.map((p) => `M${x(p[0]).toFixed(1)} ${y(p[1]).toFixed(1)}h0`).join("") }, svg);
  for (const [value, text] of ticks(low, high, 4)) element("text", { x: x(value), y: BOTTOM + 15, "text-anchor": "middle" }, svg, text);
  element("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 5, "text-anchor": "middle" }, svg, across);
  element("text", { x: WIDTH - 8, y: 13, "text-anchor": "end" }, svg, `↑ ${up}`);
  return svg;
}
