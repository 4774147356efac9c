// The time line: batches, models, interventions and changes of the model over the whole run, and the moment that is shown.

import { clock, element } from "./draw.js";

const LANES = ["batches", "models", "interventions", "changes", "regimes"];
const [LANE, LEFT, RIGHT, TOP] = [16, 96, 8, 4];
const HEIGHT = TOP + LANES.length * LANE + 18;

export class Timeline {
  constructor(svg, seek) {
    this.svg = svg;
    this.marks = element("g", {}, svg);
    this.cursor = element("path", { class: "cursor" }, svg);
    this.told = 0;
    this.restart();
    const at = (event) => this.first + ((event.clientX - svg.getBoundingClientRect().left - LEFT) / this.width()) * (this.last - this.first);
    svg.addEventListener("pointerdown", (event) => {
      if (this.first === undefined) return;
      svg.setPointerCapture(event.pointerId);
      seek(at(event));
    });
    svg.addEventListener("pointermove", (event) => { if (event.buttons === 1 && this.first !== undefined) seek(at(event)); });
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  restart() {
    Object.assign(this, { models: [], spans: new Map(), changes: [], first: undefined, last: undefined });
  }

  width() { return Math.max(40, this.svg.clientWidth - LEFT - RIGHT); }

  /** An intervention began or ended. */
  intervention({ name, on, t }) {
    const spans = this.spans.get(name) ?? [];
    const open = spans.at(-1)?.to === undefined ? spans.at(-1) : undefined;
    if (on && !open) spans.push({ from: t, to: undefined });
    if (!on && open) open.to = t;
    this.spans.set(name, spans);
  }

  /** Spans with a beginning and an end, for the charts. */
  imposed() {
    return [...this.spans].flatMap(([name, spans]) => spans.map((span) => ({ name, from: span.from, to: span.to ?? this.last })));
  }

  show(first, last, now) {
    // What the server keeps of a run that has ended comes at once, and nothing after it.
    const longer = first !== this.first;
    [this.first, this.last, this.now] = [first, last, now];
    if (longer || performance.now() - this.told > 500) this.draw();
    else this.place();
  }

  x(t) { return LEFT + ((t - this.first) / Math.max(this.last - this.first, 1e-9)) * this.width(); }

  place() {
    if (this.now === undefined) return;
    const x = this.x(this.now);
    this.cursor.setAttribute("d", `M ${x} 0 V ${HEIGHT - 14} M ${x - 5} 0 h 10 l -5 7 Z`);
  }

  draw() {
    this.told = performance.now();
    this.svg.setAttribute("viewBox", `0 0 ${LEFT + this.width() + RIGHT} ${HEIGHT}`);
    this.svg.setAttribute("height", HEIGHT);
    this.marks.replaceChildren();
    const middle = (lane) => TOP + (lane + 0.5) * LANE;
    LANES.forEach((name, lane) => {
      element("path", { class: "lane", d: `M ${LEFT} ${middle(lane)} h ${this.width()}` }, this.marks);
      element("text", { x: LEFT - 8, y: middle(lane) + 4, "text-anchor": "end" }, this.marks, name);
    });
    if (this.first === undefined) return;
    const span = (lane, from, to, kind, words) => {
      if (to < this.first || from > this.last) return;
      const [left, right] = [this.x(Math.max(from, this.first)), this.x(Math.min(to, this.last))];
      const bar = element("rect", { class: kind, x: left, width: Math.max(right - left - 1, 2), y: middle(lane) - 5, height: 10, rx: 2 }, this.marks);
      element("title", {}, bar, words);
    };
    const point = (lane, t, kind, words, d) => {
      if (t < this.first || t > this.last + 1) return;
      const mark = element("path", { class: kind, d: d(this.x(Math.min(t, this.last)), middle(lane)) }, this.marks);
      element("title", {}, mark, words);
    };
    for (const model of this.models) {
      if (model.to > model.from) span(0, model.from, model.to, "batch", `${model.batch}: ${clock(model.from)} to ${clock(model.to)}`);
      point(1, model.t, "model", `model ${model.number}: ${model.links.length} links`, (x, y) => `M ${x} ${y - 6} l 5 6 l -5 6 l -5 -6 Z`);
    }
    for (const { name, from, to } of this.imposed()) span(2, from, to, "imposed", `${name}: ${clock(from)} to ${clock(to)}`);
    for (const change of this.changes) point(3, change.t, `change ${change.kind ?? ""}`, change.text, (x, y) => `M ${x} ${y - 5} v 10 M ${x - 5} ${y} h 10`);
    const begins = this.changes.filter((change) => change.regime).map((change) => change.t).sort((a, b) => a - b);
    const regimes = begins.length ? [this.first, ...new Set(begins)] : [];
    regimes.forEach((from, i) => {
      const to = regimes[i + 1] ?? this.last;
      span(4, from, to, `regime ${i % 2 ? "odd" : "even"}`, `regime ${i + 1}: ${clock(from)} to ${clock(to)}`);
    });
    for (const [t, anchor] of [[this.first, "start"], [this.last, "end"]]) element("text", { x: this.x(t), y: HEIGHT - 3, "text-anchor": anchor }, this.marks, clock(t));
    const count = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;
    this.svg.setAttribute("aria-label", `Time line from ${clock(this.first)} to ${clock(this.last)}: ${count(this.models.length, "model")}, ${count(this.imposed().length, "intervention")}, ${count(this.changes.length, "change")}`);
    this.place();
  }
}
