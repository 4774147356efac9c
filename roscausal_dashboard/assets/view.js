// Where the reader looks: zoom, pan, fit, follow. By wheel and drag, by buttons and by keys.

const STEP = 1.25;
const [NEAREST, FARTHEST] = [2, 2000];

export class View {
  /** `changed()` is called when another part of the world is to be seen. */
  constructor(svg, changed) {
    Object.assign(this, { svg, changed, box: undefined, own: undefined, follow: "all" });
    svg.addEventListener("wheel", (event) => {
      if (!this.box) return;
      event.preventDefault();
      this.zoom(event.deltaY > 0 ? STEP : 1 / STEP, this.place(event));
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      this.held = [event.clientX, event.clientY];
    });
    svg.addEventListener("pointermove", (event) => {
      if (!this.held || !this.box) return;
      const scale = this.scale();
      this.pan(-(event.clientX - this.held[0]) / scale, -(event.clientY - this.held[1]) / scale);
      this.held = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { this.held = undefined; });
    svg.addEventListener("keydown", (event) => {
      const by = (this.shown()?.[2] ?? 10) / 10;
      const acts = {
        ArrowLeft: () => this.pan(-by, 0), ArrowRight: () => this.pan(by, 0), ArrowUp: () => this.pan(0, -by), ArrowDown: () => this.pan(0, by),
        "+": () => this.zoom(1 / STEP), "=": () => this.zoom(1 / STEP), "-": () => this.zoom(STEP), 0: () => this.fit(),
      };
      if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      acts[event.key]();
    });
  }

  /** Left, top, width and height of what is to be seen, in metres, y downwards. */
  shown() { return this.own ?? this.box; }

  /** Pixels per metre. */
  scale() {
    const [, , w, h] = this.shown();
    return Math.min(this.svg.clientWidth / w, this.svg.clientHeight / h) || 1;
  }

  place(event) {
    const [left, top, w, h] = this.shown();
    const [frame, scale] = [this.svg.getBoundingClientRect(), this.scale()];
    return [left + w / 2 + (event.clientX - frame.left - frame.width / 2) / scale, top + h / 2 + (event.clientY - frame.top - frame.height / 2) / scale];
  }

  zoom(by, about) {
    if (!this.box) return;
    const [left, top, w, h] = this.shown();
    const [x, y] = about ?? [left + w / 2, top + h / 2];
    if (Math.max(w, h) * by < NEAREST || Math.max(w, h) * by > FARTHEST) return;
    this.own = [x - (x - left) * by, y - (y - top) * by, w * by, h * by];
    this.changed();
  }

  pan(dx, dy) {
    if (!this.box) return;
    const [left, top, w, h] = this.shown();
    this.own = [left + dx, top + dy, w, h];
    this.changed();
  }

  fit() {
    this.own = undefined;
    this.changed();
  }

  /** Keeps somebody in the middle. */
  centre([x, y]) {
    const [left, top, w, h] = this.shown();
    if (Math.hypot(x - left - w / 2, y - top - h / 2) < 1e-3) return;
    this.own = [x - w / 2, y - h / 2, w, h];
    this.changed();
  }
}
