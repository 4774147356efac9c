// What may come: predictions, what-if by a slider, candidate actions side by side, and the last explanation. The server asks the
// reasoning node; the robot is not touched.

import { $, clock, element, make, ticks } from "./draw.js";

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [260, 92, 38, 6, 6, 16];
/** Most candidates that are kept beside the slider's, and most variables that a candidate shows. */
const [MOST_KEPT, MOST_SHOWN] = [3, 4];
/** A new answer for the same question comes at most this often, and one for a moved slider after this. */
const [AGAIN_MS, MOVED_MS] = [1500, 120];

export class Ahead {
  /** `charts` draws the fans in its strips. */
  constructor(charts) {
    Object.assign(this, { charts, names: [], kept: [], asked: 0 });
    $("act-variable").addEventListener("change", () => { this.range(true); this.act(); });
    $("act-value").addEventListener("input", () => this.act());
    $("act-cost").addEventListener("change", () => this.act());
    $("act-keep").addEventListener("click", () => this.keep());
    $("act-clear").addEventListener("click", () => this.clear());
    $("why").addEventListener("click", () => this.explain());
    this.restart();
  }

  restart() {
    this.newest = this.action = undefined;
    this.kept = [];
    this.charts.ahead = [];
    $("candidates").replaceChildren();
    $("ahead-advice").textContent = "";
    $("explanation").replaceChildren();
    $("act-clear").disabled = true;
  }

  /** A prediction of the reasoning node: what comes if nobody acts. */
  prediction(news) {
    this.newest = news;
    const share = news.coverage;
    const held = share === null || share === undefined ? "not scored yet" : `${Math.round(100 * share)} % of recent outcomes fell within their intervals`;
    $("ahead-state").textContent = `Prediction from ${clock(news.t)}, ${news.forecasts[0]?.mean.length ?? 0} steps of ${+news.dt?.toFixed(3) || "?"} s ahead. Coverage: ${held}.`;
    this.choices(news.forecasts.map((forecast) => forecast.variable));
    this.fans("go", news);
    if (this.action && performance.now() - this.asked > AGAIN_MS) this.ask();
  }

  /** The lists of variables, made anew only when the model has others. */
  choices(names) {
    if (names.length === this.names.length && names.every((name, i) => name === this.names[i])) return this.range(false);
    this.names = names;
    for (const id of ["act-variable", "act-cost", "why-variable"]) {
      const [list, chosen] = [$(id), $(id).value];
      const options = id === "act-cost" ? names.flatMap((name) => [[`less ${name}`, `-${name}`], [`more ${name}`, `+${name}`]]) : names.map((name) => [name, name]);
      list.replaceChildren(...(id === "act-cost" ? [new Option("do not rank", "")] : []), ...options.map(([text, value]) => new Option(text, value)));
      if (options.some(([, value]) => value === chosen)) list.value = chosen;
    }
    const robot = names.find((name) => name.startsWith("r_"));
    if (robot) $("act-variable").value = robot;
    $("ahead-tools").hidden = $("why-tools").hidden = !names.length;
    this.clear();
    this.range(true);
  }

  /** The slider goes over what was seen of the variable; its place is kept unless another variable is chosen. */
  range(anew) {
    const slider = $("act-value");
    const seen = this.newest?.seen.find(([name]) => name === $("act-variable").value);
    slider.disabled = $("act-keep").disabled = !seen;
    if (!seen) return;
    const [, low, high] = seen;
    const now = anew ? (low + high) / 2 : Number(slider.value);
    [slider.min, slider.max] = [low, high];
    slider.value = now;
    if (anew) $("act-shown").textContent = "(move the slider)";
  }

  get chosen() {
    const slider = $("act-value");
    return { variable: $("act-variable").value, value: +Number(slider.value).toFixed(decimals(slider.max - slider.min)) };
  }

  /** The reader has moved the slider, or asks for another ranking. */
  act() {
    this.action = this.chosen;
    $("act-shown").textContent = String(this.action.value);
    $("act-value").setAttribute("aria-valuetext", `${this.action.variable} = ${this.action.value}`);
    clearTimeout(this.soon);
    this.soon = setTimeout(() => this.ask(), MOVED_MS);
  }

  keep() {
    this.action ??= this.chosen;
    const same = (one) => one.variable === this.action.variable && one.value === this.action.value;
    if (!this.kept.some(same)) this.kept = [...this.kept, this.action].slice(-MOST_KEPT);
    $("act-clear").disabled = false;
    this.act();
  }

  clear() {
    this.kept = [];
    this.action = undefined;
    this.charts.ahead = this.charts.ahead.filter((fan) => fan.kind === "go");
    $("act-clear").disabled = true;
    $("act-shown").textContent = "(move the slider)";
    $("candidates").replaceChildren();
    $("ahead-advice").textContent = "";
    $("rests").hidden = true;
  }

  /** Of several wishes only the last is asked for. */
  async ask() {
    if (!this.action) return;
    if (this.asking) { this.again = true; return; }
    this.asking = true;
    try {
      do {
        this.again = false;
        this.asked = performance.now();
        const cost = $("act-cost").value;
        const question = { actions: [...this.kept, this.action], ...(cost && { cost: { variable: cost.slice(1), weight: cost[0] === "-" ? 1 : -1 } }) };
        const answer = await questioned("whatif", question);
        if (this.action) this.show(answer);
      } while (this.again && this.action);
    } finally {
      this.asking = false;
    }
  }

  show(answer) {
    const outlooks = answer.outlooks ?? [];
    const own = outlooks.find((one) => one.action === `${this.action.variable} = ${this.action.value}`);
    if (own?.forecasts.length) this.fans("what", { ...answer, forecasts: own.forecasts, name: own.action });
    else this.charts.ahead = this.charts.ahead.filter((fan) => fan.kind === "go");
    const best = outlooks[answer.ranking?.[0]];
    $("ahead-advice").textContent = best ? `Best first: ${answer.ranking.map((k) => outlooks[k].action).join(", ")}.` : answer.message ?? "";
    const shown = this.order(outlooks.find((one) => one.forecasts.length)?.forecasts.map((forecast) => forecast.variable) ?? []);
    const ranges = new Map(shown.map((name) => [name, span(outlooks, answer.past, name)]));
    $("candidates").replaceChildren(...outlooks.map((one) => candidate(one, answer, shown, ranges, one === best)));
    $("rests").hidden = !answer.caveats?.length;
    $("caveats").replaceChildren(...(answer.caveats ?? []).map((text) => make("li", text)));
  }

  /** The variable of the ranking first, then the others, the one that is acted on last. */
  order(names) {
    const rank = (name) => (name === $("act-cost").value.slice(1) ? 0 : name === this.action.variable ? 2 : 1);
    return [...names].sort((a, b) => rank(a) - rank(b)).slice(0, MOST_SHOWN);
  }

  fans(kind, { t, dt, forecasts, name }) {
    if (!(dt > 0)) return;
    this.charts.ahead = [...this.charts.ahead.filter((fan) => fan.kind !== kind), { kind, t, dt, name, forecasts: new Map(forecasts.map((forecast) => [forecast.variable, forecast])) }];
  }

  /** One question at a time: who presses again while the answer is on its way asks nothing new. */
  async explain() {
    if (this.explaining) return;
    this.explaining = true;
    try {
      const answer = await questioned("explain", { variable: $("why-variable").value });
      if (answer.status === "OK") this.explanation(answer);
      else $("explanation").replaceChildren(make("p", answer.message || answer.status));
    } finally {
      this.explaining = false;
    }
  }

  /** The last explanation, whoever asked for it. */
  explanation(answer) {
    const largest = Math.max(...[answer.expected, ...answer.parts.map((part) => part.value)].map((value) => Math.abs(value ?? 0)), 1e-12);
    const table = make("table");
    table.append(make("caption", `${answer.variable} from ${clock(answer.from)} to ${clock(answer.to)}, part by part`));
    const body = table.createTBody();
    for (const part of [{ variable: "to be expected", value: answer.expected }, ...answer.parts]) {
      const row = body.insertRow();
      const head = make("th", part.variable);
      head.scope = "row";
      const text = `${short(part.value)}${part.lower === undefined || part.lower === null ? "" : ` (${short(part.lower)} to ${short(part.upper)})`}`;
      const bar = element("svg", { viewBox: "-50 0 100 10", width: 100, height: 10, "aria-hidden": "true" });
      const length = (50 * (part.value ?? 0)) / largest;
      element("rect", { class: length < 0 ? "part negative" : "part", x: Math.min(length, 0), y: 1, width: Math.max(Math.abs(length), 0.5), height: 8 }, bar);
      const cell = make("td");
      cell.append(bar);
      row.append(head, make("td", text), cell);
    }
    $("explanation").replaceChildren(make("p", answer.text), table, ...answer.caveats.map((text) => make("p", text, "legend")));
  }
}

/** Decimals that tell a thousandth of a range: four, and more where the range is small. */
const decimals = (range) => (range > 0 ? Math.min(Math.max(4, 3 - Math.floor(Math.log10(range))), 100) : 4);

const short = (value) => (value === null || value === undefined ? "unknown" : String(+value.toPrecision(3)));

/** The server's answer; a sentence where there is none. */
async function questioned(kind, question) {
  try {
    const answer = await fetch(`${kind}?q=${encodeURIComponent(JSON.stringify(question))}`);
    return answer.ok ? await answer.json() : { status: "NO_ANSWER", message: await answer.text() };
  } catch {
    return { status: "NO_ANSWER", message: "The connection is lost." };
  }
}

const pastOf = (past, name) => past.values.find(([known]) => known === name)?.[1] ?? [];
const forecastOf = (one, name) => one.forecasts.find((forecast) => forecast.variable === name);

/** The same axis for all candidates. */
function span(outlooks, past, name) {
  const values = [...pastOf(past, name), ...outlooks.flatMap((one) => { const f = forecastOf(one, name); return f ? [...f.lower, ...f.upper] : []; })].filter((value) => value !== null);
  const [low, high] = values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
  return high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high)) ? [low - 0.5, high + 0.5] : [low, high];
}

function candidate(one, answer, shown, ranges, best) {
  const figure = make("figure", "", best ? "candidate best" : "candidate");
  figure.append(make("h3", one.action));
  if (best) figure.append(make("p", "best", "badge"));
  for (const name of shown) {
    const forecast = forecastOf(one, name);
    if (forecast) figure.append(make("h4", name), fan(name, one, forecast, answer, ranges.get(name)));
  }
  figure.append(make("figcaption", one.text));
  return figure;
}

function fan(name, one, forecast, { past, t, dt }, [low, high]) {
  const [first, last] = [past.t[0] ?? t, t + forecast.mean.length * dt];
  const x = (at) => LEFT + ((at - first) / (last - first || 1)) * (WIDTH - LEFT - RIGHT);
  const y = (value) => HEIGHT - BOTTOM - ((value - low) / (high - low)) * (HEIGHT - BOTTOM - TOP);
  const at = (k) => t + (k + 1) * dt;
  const end = forecast.mean.length - 1;
  const svg = element("svg", { role: "img", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-label": `${name} under ${one.action}: ${short(forecast.mean[end])} (${short(forecast.lower[end])} to ${short(forecast.upper[end])}) after ${+(forecast.mean.length * dt).toFixed(2)} s` });
  for (const [value, text] of ticks(low, high, 2)) {
    element("path", { class: "tick", d: `M ${LEFT} ${y(value)} H ${WIDTH - RIGHT}` }, svg);
    element("text", { x: LEFT - 4, y: y(value) + 4, "text-anchor": "end" }, svg, text);
  }
  element("path", { class: "axes", d: `M ${x(t)} ${TOP} V ${HEIGHT - BOTTOM} M ${LEFT} ${HEIGHT - BOTTOM} H ${WIDTH - RIGHT}` }, svg);
  element("text", { x: x(t), y: HEIGHT - 3, "text-anchor": "middle" }, svg, "now");
  element("text", { x: WIDTH - RIGHT, y: HEIGHT - 3, "text-anchor": "end" }, svg, `+${+(last - t).toFixed(1)} s`);
  const before = past.t.map((when, i) => [when, pastOf(past, name)[i]]);
  element("path", { class: "course", d: line(before, x, y) }, svg);
  const present = before.at(-1);
  const from = present && present[1] !== null && present[1] !== undefined ? [present] : [];
  const course = (values) => [...from, ...values.map((value, k) => [at(k), value])];
  element("path", { class: "band", d: band(course(forecast.lower), course(forecast.upper), x, y) }, svg);
  element("path", { class: "ahead", d: line(course(forecast.mean), x, y) }, svg);
  if (one.supported < forecast.mean.length) {
    const limit = x(t + one.supported * dt);
    element("rect", { class: "guess", x: limit, y: TOP, width: Math.max(WIDTH - RIGHT - limit, 0), height: HEIGHT - BOTTOM - TOP }, svg);
  }
  return svg;
}

/** A line through what is known. */
export function line(points, x, y) {
  let [pen, d] = ["M", ""];
  for (const [t, value] of points) {
    if (value === null || value === undefined) { pen = "M"; continue; }
    d += `${pen}${x(t).toFixed(1)} ${y(value).toFixed(1)}`;
    pen = "L";
  }
  return d;
}

/** The area between two lines. */
export function band(lower, upper, x, y) {
  const ring = [...lower, ...upper.toReversed()].filter(([, value]) => value !== null && value !== undefined);
  return ring.length > 2 ? `M${ring.map(([t, value]) => `${x(t).toFixed(1)} ${y(value).toFixed(1)}`).join("L")}Z` : "";
}
