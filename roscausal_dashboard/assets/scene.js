// The scene from above: walls, robot, people, goals, risk cone, trails. It grows to cover every place visited.

import { element, ticks } from "./draw.js";
import { View } from "./view.js";

const TRAIL_S = 8;
/** Time between two dots on a trail, seconds. */
const DOT_S = 2;
const MARGIN = 1.5;
/** How near a click has to be to somebody, in pixels, and how far a pointer may move in a click. */
const [NEAR, STILL] = [16, 4];

export class Scene {
  /** `choose("robot")` or `choose(id)` is called when the reader clicks on somebody. */
  constructor(svg, text, choose) {
    Object.assign(this, { svg, text, bodies: [], known: [], drawn: new Map(), trails: new Map(), told: 0, pressed: [0, 0] });
    this.grid = element("g", {}, svg);
    this.plan = element("g", {}, svg);
    // What belongs to the person chosen, all people, and the robot. People keep their elements: there may be a hundred.
    this.body = element("g", {}, svg);
    this.crowd = element("g", {}, svg);
    this.over = element("g", {}, svg);
    this.marks = element("g", {}, svg);
    this.view = new View(svg, () => this.look());
    this.restart();
    // By place: what is drawn is replaced with each scene.
    svg.addEventListener("pointerdown", (event) => { this.pressed = [event.clientX, event.clientY]; });
    svg.addEventListener("click", (event) => {
      if (!this.view.box || Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) > STILL) return;
      const who = this.at(this.view.place(event));
      if (who !== undefined) choose(who);
    });
    new ResizeObserver(() => this.look()).observe(svg);
  }

  /** Whoever is nearest to a place, if near enough. */
  at([x, y]) {
    const reach = Math.max(0.45, NEAR / this.view.scale());
    const far = this.bodies.map(([who, body]) => [Math.hypot(body.x - x, -body.y - y), who]).filter(([distance]) => distance <= reach);
    return far.sort((a, b) => a[0] - b[0])[0]?.[1];
  }

  restart() {
    this.view.box = undefined;
    this.time = undefined;
    this.drawn.clear();
    this.crowd.replaceChildren();
    this.trails.clear();
  }

  walls(walls) {
    this.known = walls;
    this.plan.replaceChildren();
    for (const [x1, y1, x2, y2] of walls) element("line", { class: "wall", x1, y1: -y1, x2, y2: -y2 }, this.plan);
    if (this.view.box) this.grow(this.corners());
  }

  corners() { return this.known.flatMap(([x1, y1, x2, y2]) => [[x1, y1], [x2, y2]]); }

  /** Draws one scene, in metres with y upwards. */
  show(scene) {
    if (this.time !== undefined && scene.t < this.time - 1 && !scene.trails) this.restart();
    this.time = scene.t;
    if (scene.trails) for (const [who, dots] of Object.entries(scene.trails)) this.trails.set(who, dots.map(([t, x, y]) => [t, x, -y]));
    const bodies = [...(scene.robot ? [scene.robot] : []), ...scene.people];
    this.bodies = [...(scene.robot ? [["robot", scene.robot]] : []), ...scene.people.map((person) => [person.id, person])];
    if (!bodies.length) return;
    if (!this.view.box) this.grow(this.corners());
    this.grow(bodies.flatMap((b) => [[b.x, b.y], ...(b.goal ? [b.goal] : [])]));
    const chosen = scene.people.find((person) => person.id === scene.person);
    const followed = { robot: scene.robot, person: chosen }[this.view.follow];
    if (followed) this.view.centre([followed.x, -followed.y]);
    this.body.replaceChildren();
    this.over.replaceChildren();
    if (chosen?.cone) this.cone(chosen.cone);
    const here = new Set(scene.people.map((person) => person.id));
    for (const [id, { group }] of this.drawn) if (!here.has(id)) { group.remove(); this.drawn.delete(id); }
    for (const person of scene.people) this.person(person, person === chosen, scene.t);
    if (scene.robot) this.robot(scene.robot, scene.t);
    if (chosen?.cone) element("circle", { class: "ahead", cx: chosen.cone.ahead[0], cy: -chosen.cone.ahead[1], r: 0.12 }, this.over);
    this.tell(scene, chosen);
  }

  grow(points) {
    const known = points.filter((p) => p.every(Number.isFinite));
    if (!known.length) return;
    const old = this.view.box ? [this.view.box[0], this.view.box[1], this.view.box[0] + this.view.box[2], this.view.box[1] + this.view.box[3]] : [Infinity, Infinity, -Infinity, -Infinity];
    const [xs, ys] = [known.map((p) => p[0]), known.map((p) => -p[1])];
    const box = [
      Math.min(old[0], Math.floor(Math.min(...xs) - MARGIN)), Math.min(old[1], Math.floor(Math.min(...ys) - MARGIN)),
      Math.max(old[2], Math.ceil(Math.max(...xs) + MARGIN)), Math.max(old[3], Math.ceil(Math.max(...ys) + MARGIN)),
    ];
    if (this.view.box && box.every((value, i) => value === old[i])) return;
    this.view.box = [box[0], box[1], box[2] - box[0], box[3] - box[1]];
    if (!this.view.own) this.look();
  }

  /** Shows what the reader looks at: grid with its scale, sizes of letters. */
  look() {
    const shown = this.view.shown();
    if (!shown || !this.svg.clientWidth) return;
    const [left, top, w, h] = shown;
    this.svg.setAttribute("viewBox", shown.join(" "));
    const scale = this.view.scale();
    this.unit = 20 / scale;
    const [wide, tall] = [this.svg.clientWidth / scale, this.svg.clientHeight / scale];
    const [west, north] = [left + w / 2 - wide / 2, top + h / 2 - tall / 2];
    this.grid.replaceChildren();
    this.marks.replaceChildren();
    const size = 0.55 * this.unit;
    const count = Math.max(3, this.svg.clientWidth / 90);
    const xs = ticks(west, west + wide, count);
    const by = xs.length > 1 ? xs[1][0] - xs[0][0] : wide;
    for (const [x, text] of xs) {
      element("line", { class: Math.abs(x) < 1e-9 ? "axis" : "grid", x1: x, x2: x, y1: north, y2: north + tall }, this.grid);
      if (x > west + 2 * size && x < west + wide - 3.5 * size) element("text", { class: "scale", x, y: north + tall - 0.4 * size, "font-size": size, "text-anchor": "middle" }, this.marks, text);
    }
    for (let i = Math.ceil(north / by); i * by <= north + tall; i++) {
      const y = i * by;
      element("line", { class: i === 0 ? "axis" : "grid", x1: west, x2: west + wide, y1: y, y2: y }, this.grid);
      if (y > north + 1.5 * size && y < north + tall - 2 * size) element("text", { class: "scale", x: west + 0.3 * size, y: y + 0.35 * size, "font-size": size }, this.marks, String(+(-y).toFixed(6)));
    }
    element("text", { class: "scale", x: west + wide - 0.3 * size, y: north + tall - 0.4 * size, "font-size": size, "text-anchor": "end" }, this.marks, "m");
  }

  cone(cone) {
    const points = cone.corners.map(([x, y]) => `${x},${-y}`).join(" ");
    element("polygon", { class: cone.collision ? "cone collision" : "cone", points }, this.body);
  }

  person(person, chosen, time) {
    if (chosen) {
      this.trail("person", person, time, "chosen-trail", this.body);
      this.goal(person, this.body);
    }
    const known = this.drawn.get(person.id) ?? this.somebody(person.id);
    const set = (part, name, value) => { if (part.getAttribute(name) !== value) part.setAttribute(name, value); };
    set(known.group, "class", chosen ? "someone chosen" : "someone");
    set(known.place, "transform", `translate(${person.x} ${-person.y})`);
    set(known.nose, "transform", `rotate(${-(person.theta ?? 0) * 180 / Math.PI})`);
    set(known.label, "font-size", String(0.6 * this.unit));
  }

  /** The elements of a person, for as long as the person is there. */
  somebody(id) {
    const r = 0.3;
    const group = element("g", { class: "someone" }, this.crowd);
    const place = element("g", {}, group);
    element("circle", { class: "person", r }, place);
    const nose = element("path", { class: "nose", d: `M ${0.9 * r} 0 L ${0.15 * r} ${0.42 * r} L ${0.15 * r} ${-0.42 * r} Z` }, place);
    const label = element("text", { class: "label", x: 0.42, y: -0.3 }, place, id);
    const known = { group, place, nose, label };
    this.drawn.set(id, known);
    return known;
  }

  robot(robot, time) {
    this.trail("robot", robot, time, "robot-trail", this.over);
    const group = element("g", { id: "robot" }, this.over);
    this.goal(robot, group);
    const turn = -(robot.theta ?? 0) * 180 / Math.PI;
    const place = element("g", { transform: `translate(${robot.x} ${-robot.y}) rotate(${turn})` }, group);
    element("rect", { class: "robot", x: -0.32, y: -0.27, width: 0.64, height: 0.54, rx: 0.1 }, place);
    element("path", { class: "nose", d: "M 0.26 0 L 0.02 0.15 L 0.02 -0.15 Z" }, place);
  }

  goal(body, group) {
    if (!body.goal) return;
    const [x, y] = [body.goal[0], -body.goal[1]];
    element("line", { class: "goal-line", x1: body.x, y1: -body.y, x2: x, y2: y }, group);
    element("circle", { class: "goal", cx: x, cy: y, r: 0.25 }, group);
    element("path", { class: "goal", d: `M ${x - 0.12} ${y} h 0.24 M ${x} ${y - 0.12} v 0.24` }, group);
  }

  trail(who, body, time, kind, layer) {
    const trail = this.trails.get(who) ?? [];
    if (!trail.length || time - trail.at(-1)[0] > 0.15) trail.push([time, body.x, -body.y]);
    while (trail.length && (trail[0][0] < time - TRAIL_S || trail[0][0] > time)) trail.shift();
    this.trails.set(who, trail);
    const points = [...trail.map((p) => `${p[1]},${p[2]}`), `${body.x},${-body.y}`].join(" ");
    element("polyline", { class: `trail ${kind}`, points }, layer);
    // A dot for each full two seconds: close together is slow.
    for (let i = 1; i < trail.length; i++) {
      if (Math.floor(trail[i][0] / DOT_S) === Math.floor(trail[i - 1][0] / DOT_S)) continue;
      element("circle", { class: `dot ${kind}`, cx: trail[i][1], cy: trail[i][2], r: 0.15 * this.unit }, layer);
    }
  }

  tell(scene, chosen) {
    const now = performance.now();
    if (now - this.told < 500 && !scene.trails) return;
    this.told = now;
    const number = (value, unit) => (value === null || value === undefined ? "unknown" : `${value.toFixed(2)} ${unit}`);
    const robot = scene.robot ? `Robot at (${scene.robot.x.toFixed(1)}, ${scene.robot.y.toFixed(1)}), ${number(scene.robot.v, "m/s")}. ` : "No robot. ";
    const people = `${scene.people.length} ${scene.people.length === 1 ? "person" : "people"}. `;
    const cone = chosen?.cone;
    const course = cone ? `Person ${chosen.id}: ${number(chosen.v, "m/s")}, ${number(cone.distance, "m")} from the robot, risk ${cone.risk?.toFixed(2) ?? "unknown"}${cone.collision ? ", on collision course" : ""}.` : "";
    this.text.textContent = robot + people + course;
  }
}
