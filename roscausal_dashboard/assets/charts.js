// Strip charts of the variables that the reader has chosen. Hover reads values; a drag shows the scene of that moment.

import { band, line } from "./ahead.js";
import { clock, element, make, ticks } from "./draw.js";

const [LEFT, RIGHT, TOP, BOTTOM, HEIGHT] = [46, 8, 6, 18, 96];
const MOST_ROWS = 6000;
/** A prediction from this long before or after the newest row is of no use any more, seconds. */
const STALE_S = 10;
/** Time between two rows that the page adds itself, seconds. */
const EVERY_S = 0.1;
/** In the order of the server's rows, after the time. */
export const VARIABLES = [
  ["h_v", "speed of the person", "m/s"], ["h_dg", "their distance to goal", "m"], ["h_risk", "their risk", ""],
  ["distance", "person to robot", "m"], ["h_x", "person, east", "m"], ["h_y", "person, north", "m"],
  ["h_theta", "their heading", "rad"], ["r_v", "speed of the robot", "m/s"], ["r_dg", "its distance to goal", "m"],
  ["r_x", "robot, east", "m"], ["r_y", "robot, north", "m"], ["r_theta", "its heading", "rad"],
].map(([key, name, unit], i) => ({ key, name, unit, column: i + 1 }));
const FIRST = ["h_v", "h_dg", "h_risk"];

/** A scene as a row of the variables. */
export function row(scene) {
  const person = scene.people.find((p) => p.id === scene.person);
  const of = (b) => (b ? [b.v, b.goal ? Math.hypot(b.goal[0] - b.x, b.goal[1] - b.y) : null, b.x, b.y, b.theta] : [null, null, null, null, null]);
  const [v, dg, x, y, theta] = of(person);
  return [scene.t, v, dg, person?.cone?.risk ?? null, person?.cone?.distance ?? null, x, y, theta, ...of(scene.robot)];
}

export class Charts {
  /** `seek(t)` shows the scene of a moment; `spans()` are the interventions. */
  constructor(parent, choice, seek, spans) {
    Object.assign(this, { parent, seek, spans, rows: [], charts: [], length: 60, told: 0, ahead: [], other: false });
    this.chosen = new Set(FIRST);
    for (const variable of VARIABLES) {
      const label = make("label", "");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: this.chosen.has(variable.key), value: variable.key });
      box.addEventListener("change", () => {
        if (box.checked) this.chosen.add(variable.key);
        else this.chosen.delete(variable.key);
        this.build();
      });
      label.append(box, `${variable.key}, ${variable.name}`);
      choice.append(label);
    }
    new ResizeObserver(() => this.draw()).observe(parent);
    this.build();
  }

  build() {
    this.charts = VARIABLES.filter((variable) => this.chosen.has(variable.key)).map((variable) => {
      const box = make("div", "", "chart");
      const title = document.createElement("h3");
      const value = make("span", "", "value");
      title.append(make("span", `${variable.key}, ${variable.name}`), value);
      const svg = element("svg", { role: "img", "aria-label": `Course of ${variable.key}, ${variable.name}`, height: HEIGHT });
      const back = element("g", {}, svg);
      const path = element("path", { class: "course" }, svg);
      const cursor = element("path", { class: "cursor" }, svg);
      box.append(title, svg);
      this.listen(svg);
      return { ...variable, box, svg, back, path, cursor, value };
    });
    this.parent.replaceChildren(...this.charts.map((chart) => chart.box));
    if (!this.charts.length) this.parent.replaceChildren(make("p", "No variable is chosen."));
    this.draw();
  }

  listen(svg) {
    const at = (event) => this.from + ((event.clientX - svg.getBoundingClientRect().left - LEFT) / this.width()) * (this.to - this.from);
    svg.addEventListener("pointermove", (event) => {
      if (!this.rows.length) return;
      this.hover = at(event);
      if (event.buttons === 1) this.seek(this.hover);
      this.read();
    });
    svg.addEventListener("pointerleave", () => { this.hover = undefined; this.read(); });
    svg.addEventListener("pointerdown", (event) => {
      if (!this.rows.length) return;
      svg.setPointerCapture(event.pointerId);
      this.seek(at(event));
    });
  }

  restart() {
    this.rows = [];
    this.now = this.hover = undefined;
  }

  /** All rows of the run, in place of those that are known. */
  fill(rows) {
    const last = rows.at(-1)?.[0] ?? -Infinity;
    this.rows = [...rows, ...this.rows.filter((known) => known[0] > last)];
    this.draw();
  }

  add(scene) {
    const last = this.rows.at(-1)?.[0];
    if (last !== undefined && scene.t < last - 1) this.restart();
    else if (last !== undefined && scene.t - last < EVERY_S) return;
    this.rows.push(row(scene));
    // A long run is kept from its beginning, with its older half twice as sparse.
    if (this.rows.length > MOST_ROWS) this.rows = this.rows.filter((_, i) => i % 2 === 0 || i > MOST_ROWS / 2);
  }

  /** The moment that is shown; `live` if it is the newest. */
  show(now, live) {
    [this.now, this.live] = [now, live];
    // Not more often than something would be seen to move: half a pixel.
    const pause = Math.min(Math.max((500 * (this.to - this.from)) / this.width(), 100), 1000) || 100;
    if (performance.now() - this.told > pause) this.draw();
    else if (!live) this.read();
  }

  width() { return Math.max(40, (this.charts[0]?.svg.clientWidth ?? 600) - LEFT - RIGHT); }

  window() {
    const [first, last] = [this.rows[0][0], this.rows.at(-1)[0]];
    if (!Number.isFinite(this.length)) return [first, Math.max(last, first + 1)];
    // In the past the moment that is shown stands in the middle.
    const end = this.live || this.now === undefined ? last : Math.min(last, this.now + this.length / 2);
    return [end - this.length, end];
  }

  /** The fans that begin where the rows end, and when the longest of them ends; none in the past. */
  fans() {
    const last = this.rows.at(-1)[0];
    const fresh = this.live ? this.ahead.filter((fan) => Math.abs(fan.t - last) < STALE_S) : [];
    const end = (fan) => fan.t + fan.dt * Math.max(0, ...[...fan.forecasts.values()].map((forecast) => forecast.mean.length));
    return [fresh, Math.max(last, ...fresh.map(end))];
  }

  /** The fan of a variable; those of a person are of the one of the settings. */
  fanOf(chart, fan) { return this.other && (chart.key.startsWith("h_") || chart.key === "distance") ? undefined : fan.forecasts.get(chart.key); }

  draw() {
    this.told = performance.now();
    if (!this.rows.length) return;
    [this.from, this.to] = this.window();
    const [fans, end] = this.fans();
    this.to = Math.max(this.to, end);
    const begin = this.rows.findIndex((known) => known[0] >= this.from);
    const seen = this.rows.slice(Math.max(begin - 1, 0)).filter((known) => known[0] <= this.to + 1);
    const width = this.width();
    // No more points than can be told apart.
    const stride = Math.ceil(seen.length / (2 * width));
    const x = (t) => LEFT + ((t - this.from) / (this.to - this.from)) * width;
    const imposed = this.spans().filter((span) => span.to >= this.from && span.from <= this.to);
    for (const chart of this.charts) this.one(chart, seen, stride, x, width, imposed, fans);
    this.read();
  }

  one(chart, seen, stride, x, width, imposed, fans) {
    const coming = fans.map((fan) => [fan, this.fanOf(chart, fan)]).filter(([, forecast]) => forecast);
    const values = [...seen.map((known) => known[chart.column]), ...coming.flatMap(([, forecast]) => [...forecast.lower, ...forecast.upper])].filter((value) => value !== null);
    chart.svg.setAttribute("viewBox", `0 0 ${LEFT + width + RIGHT} ${HEIGHT}`);
    chart.back.replaceChildren();
    let low = values.reduce((a, b) => Math.min(a, b), Infinity);
    let high = values.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!values.length) [low, high] = [0, 1];
    if (high - low < 1e-9) [low, high] = [low - 0.5, high + 0.5];
    const y = (value) => HEIGHT - BOTTOM - 3 - ((value - low) / (high - low)) * (HEIGHT - BOTTOM - TOP - 6);
    const clamp = (t) => Math.min(Math.max(x(t), LEFT), LEFT + width);
    for (const span of imposed) {
      const bar = element("rect", { class: "imposed", x: clamp(span.from), width: Math.max(clamp(span.to) - clamp(span.from), 1), y: TOP, height: HEIGHT - BOTTOM - TOP }, chart.back);
      element("title", {}, bar, `intervention ${span.name}`);
    }
    for (const [value, text] of ticks(low, high, 3)) {
      element("path", { class: "tick", d: `M ${LEFT} ${y(value)} h ${width}` }, chart.back);
      element("text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, chart.back, text);
    }
    const day = this.to > 1e8;
    for (const [t, text] of ticks(this.from, this.to, Math.max(2, width / 110))) {
      if (x(t) < LEFT + 12 || x(t) > LEFT + width - 14) continue;
      element("path", { class: "tick", d: `M ${x(t)} ${HEIGHT - BOTTOM} v 4` }, chart.back);
      element("text", { x: x(t), y: HEIGHT - 3, "text-anchor": "middle" }, chart.back, day ? clock(t) : `${text} s`);
    }
    element("path", { class: "axes", d: `M ${LEFT} ${TOP} V ${HEIGHT - BOTTOM} h ${width}` }, chart.back);
    for (const [fan, forecast] of coming) {
      const course = (all) => all.map((value, k) => [fan.t + (k + 1) * fan.dt, value]);
      const area = element("path", { class: `fan ${fan.kind}`, d: band(course(forecast.lower), course(forecast.upper), x, y) }, chart.back);
      element("title", {}, area, fan.name ?? "prediction, if nobody acts");
      element("path", { class: `coming ${fan.kind}`, d: line(course(forecast.mean), x, y) }, chart.back);
    }
    const points = seen.map((known) => [known[0], known[chart.column]]);
    // What is missing stays, so that no line leads over it.
    const drawn = points.filter(([t, value], i) => value === null || (t >= this.from && (i % stride === 0 || i === seen.length - 1)));
    chart.path.setAttribute("d", line(drawn, x, y));
  }

  /** The values where the pointer is, or else at the moment shown. */
  read() {
    if (!this.rows.length) return;
    const t = this.hover ?? (this.live ? undefined : this.now);
    const at = t === undefined ? this.rows.length - 1 : nearest(this.rows, t);
    const [time, x] = [this.rows[at][0], t === undefined ? undefined : LEFT + ((this.rows[at][0] - this.from) / (this.to - this.from)) * this.width()];
    for (const chart of this.charts) {
      const value = this.rows[at][chart.column];
      const text = value === null || value === undefined ? "unknown" : `${value.toFixed(2)} ${chart.unit}`.trim();
      chart.value.textContent = t === undefined ? text : `${text} at ${clock(time)}`;
      const within = x !== undefined && x >= LEFT && x <= LEFT + this.width();
      chart.cursor.setAttribute("d", within ? `M ${x} ${TOP} V ${HEIGHT - BOTTOM}` : "");
    }
  }
}

function nearest(rows, t) {
  let [low, high] = [0, rows.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (rows[middle][0] <= t) low = middle;
    else high = middle;
  }
  return t - rows[low][0] <= rows[high][0] - t ? low : high;
}
