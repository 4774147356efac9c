// The view from above: robot, people, goals, risk cone. It grows to cover every place visited.

const SVG = "http://www.w3.org/2000/svg";
const TRAIL_S = 8;
const MARGIN = 1.5;

const element = (name, attributes = {}, parent) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  parent?.append(made);
  return made;
};

export class Scene {
  constructor(svg, text) {
    this.svg = svg;
    this.text = text;
    this.grid = element("g", {}, svg);
    this.body = element("g", {}, svg);
    this.trails = new Map();
    this.told = 0;
    this.restart();
  }

  restart() {
    this.box = undefined;
    this.time = undefined;
    this.trails.clear();
  }

  /** Draws one scene, in metres with y upwards. */
  show(scene) {
    if (this.time !== undefined && scene.t < this.time - 1) this.restart();
    this.time = scene.t;
    const bodies = [...(scene.robot ? [scene.robot] : []), ...scene.people];
    if (!bodies.length) return;
    this.grow(bodies.flatMap((b) => [[b.x, b.y], ...(b.goal ? [b.goal] : [])]));
    this.body.replaceChildren();
    if (scene.cone) this.cone(scene.cone);
    for (const person of scene.people) this.person(person, person.id === scene.person, scene.t);
    if (scene.robot) this.robot(scene.robot, scene.t);
    if (scene.cone) element("circle", { class: "ahead", cx: scene.cone.ahead[0], cy: -scene.cone.ahead[1], r: 0.12 }, this.body);
    this.tell(scene);
  }

  grow(points) {
    const known = points.filter((p) => p.every(Number.isFinite));
    if (!known.length) return;
    const [xs, ys] = [known.map((p) => p[0]), known.map((p) => -p[1])];
    const old = this.box ?? [Infinity, Infinity, -Infinity, -Infinity];
    const box = [
      Math.min(old[0], Math.floor(Math.min(...xs) - MARGIN)), Math.min(old[1], Math.floor(Math.min(...ys) - MARGIN)),
      Math.max(old[2], Math.ceil(Math.max(...xs) + MARGIN)), Math.max(old[3], Math.ceil(Math.max(...ys) + MARGIN)),
    ];
    if (this.box && box.every((value, i) => value === this.box[i])) return;
    this.box = box;
    const [w, h] = [box[2] - box[0], box[3] - box[1]];
    this.svg.setAttribute("viewBox", `${box[0]} ${box[1]} ${w} ${h}`);
    this.unit = Math.max(w, h) / 24;
    const step = Math.max(w, h) > 60 ? 10 : Math.max(w, h) > 24 ? 5 : 1;
    this.grid.replaceChildren();
    // The view may be wider or taller than the box, so the grid extends beyond it.
    const [left, top, right, bottom] = [box[0] - 2 * h, box[1] - 2 * w, box[2] + 2 * h, box[3] + 2 * w];
    const line = (at, horizontal) => {
      const ends = horizontal ? { x1: left, x2: right, y1: at, y2: at } : { x1: at, x2: at, y1: top, y2: bottom };
      element("line", { class: at === 0 ? "axis" : "grid", ...ends }, this.grid);
    };
    for (let x = Math.ceil(left / step) * step; x <= right; x += step) line(x, false);
    for (let y = Math.ceil(top / step) * step; y <= bottom; y += step) line(y, true);
    const note = element("text", { x: box[0] + 0.3 * this.unit, y: box[3] - 0.3 * this.unit, "font-size": 0.55 * this.unit }, this.grid);
    note.textContent = `grid ${step} m`;
  }

  cone(cone) {
    const points = cone.corners.map(([x, y]) => `${x},${-y}`).join(" ");
    element("polygon", { class: cone.collision ? "cone collision" : "cone", points }, this.body);
  }

  person(person, chosen, time) {
    const group = element("g", { class: chosen ? "someone chosen" : "someone" }, this.body);
    if (chosen) {
      this.trail("person", person, time, "chosen-trail");
      this.goal(person, group);
    }
    const r = 0.3;
    const place = element("g", { transform: `translate(${person.x} ${-person.y})` }, group);
    element("circle", { class: "person", r }, place);
    const turn = -(person.theta ?? 0) * 180 / Math.PI;
    element("path", { class: "nose", d: `M ${0.9 * r} 0 L ${0.15 * r} ${0.42 * r} L ${0.15 * r} ${-0.42 * r} Z`, transform: `rotate(${turn})` }, place);
    const label = element("text", { class: "label", x: 0.42, y: -0.3, "font-size": 0.6 * this.unit }, place);
    label.textContent = person.id;
  }

  robot(robot, time) {
    this.trail("robot", robot, time, "robot-trail");
    const group = element("g", { id: "robot" }, this.body);
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

  trail(who, body, time, kind) {
    const trail = this.trails.get(who) ?? [];
    if (!trail.length || time - trail.at(-1)[0] > 0.15) trail.push([time, body.x, -body.y]);
    while (trail.length && trail[0][0] < time - TRAIL_S) trail.shift();
    this.trails.set(who, trail);
    const points = [...trail.map((p) => `${p[1]},${p[2]}`), `${body.x},${-body.y}`].join(" ");
    element("polyline", { class: `trail ${kind}`, points }, this.body);
  }

  tell(scene) {
    const now = performance.now();
    if (now - this.told < 500) return;
    this.told = now;
    const number = (value, unit) => (value === null || value === undefined ? "unknown" : `${value.toFixed(2)} ${unit}`);
    const robot = scene.robot ? `Robot at (${scene.robot.x.toFixed(1)}, ${scene.robot.y.toFixed(1)}), ${number(scene.robot.v, "m/s")}. ` : "No robot. ";
    const people = `${scene.people.length} ${scene.people.length === 1 ? "person" : "people"}. `;
    const course = scene.cone ? `Person ${scene.person}: ${number(scene.v, "m/s")}, ${number(scene.cone.distance, "m")} from the robot, risk ${scene.cone.risk.toFixed(2)}${scene.cone.collision ? ", on collision course" : ""}.` : "";
    this.text.textContent = robot + people + course;
  }
}
