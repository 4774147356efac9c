// Which moment is shown: the newest, or one of the past, standing still or playing. The run itself is not touched: the page
// only reads what the server keeps of it.

const TICK_MS = 100;
/** With reduced motion the scene changes this seldom. */
const CALM_MS = 1000;

export class Moments {
  /** `show(scene, past)` draws; `changed()` is called when time or state have changed. */
  constructor(show, changed) {
    Object.assign(this, { show, changed, person: undefined, speed: 1 });
    this.calm = window.matchMedia("(prefers-reduced-motion: reduce)");
    this.restart();
  }

  restart() {
    this.first = this.last = this.newestScene = this.at = undefined;
    this.playing = this.ended = false;
    clearInterval(this.clock);
  }

  get live() { return this.at === undefined; }

  /** The time that is shown. */
  get now() { return this.at ?? this.last; }

  /** What the server keeps: from `first` to `last`. */
  span(first, last) {
    if (first === null || last === null) return;
    this.first = first;
    this.last = Math.max(last, this.last ?? last);
    this.changed();
  }

  newest(scene) {
    if (this.last !== undefined && scene.t < this.last - 1) this.restart();
    this.first ??= scene.t;
    this.last = scene.t;
    this.newestScene = scene;
    const now = performance.now();
    if (this.live && !(this.calm.matches && now - (this.shownAt ?? -CALM_MS) < CALM_MS)) {
      this.shownAt = now;
      this.show(scene, false);
    }
    this.changed();
  }

  seek(t) {
    if (this.last === undefined) return;
    this.at = Math.min(Math.max(t, this.first), this.last);
    this.changed();
    return this.fetchScene();
  }

  pause() {
    if (this.live && this.last !== undefined) this.at = this.last;
    this.playing = false;
    clearInterval(this.clock);
    this.changed();
  }

  play() {
    if (this.last === undefined) return;
    // At its end a run begins again.
    if (this.live || this.at >= this.last) this.at = this.ended ? this.first : this.last;
    this.playing = true;
    clearInterval(this.clock);
    this.clock = setInterval(() => {
      const next = this.at + (this.speed * TICK_MS) / 1000;
      if (next < this.last) this.seek(next);
      else if (this.ended) { this.seek(this.last); this.pause(); }
      else this.follow();
    }, TICK_MS);
    this.changed();
  }

  /** Back to what is happening, or to the end of what has ended. */
  follow() {
    this.playing = false;
    clearInterval(this.clock);
    this.at = undefined;
    if (this.newestScene) this.show(this.newestScene, false);
    this.changed();
  }

  /** Of several wishes only the last is asked for. */
  async fetchScene() {
    if (this.asking) { this.again = true; return; }
    this.asking = true;
    try {
      do {
        this.again = false;
        const person = this.person === undefined ? "" : `&person=${this.person}`;
        const answer = await fetch(`scene?t=${this.at ?? this.last}${person}`);
        const scene = answer.ok ? await answer.json() : null;
        if (scene && !this.live) this.show(scene, true);
      } while (this.again && !this.live);
    } catch {
      // The connection is lost: the pill in the header says so.
    } finally {
      this.asking = false;
    }
  }
}
