// Strip charts of the variables: speed, distance to goal, risk of the person shown.

const SVG = "http://www.w3.org/2000/svg";
const WINDOW_S = 60;
const WIDTH = 600;
const HEIGHT = 70;
const VARIABLES = [
  { key: "v", name: "h_v, speed", unit: "m/s" },
  { key: "dg", name: "h_dg, distance to goal", unit: "m" },
  { key: "risk", name: "h_risk, risk", unit: "" },
];

export class Charts {
  constructor(parent) {
    this.samples = [];
    this.charts = VARIABLES.map((variable) => {
      const box = document.createElement("div");
      box.className = "chart";
      const title = document.createElement("h3");
      const value = document.createElement("span");
      value.className = "value";
      title.append(Object.assign(document.createElement("span"), { textContent: variable.name }), value);
      const svg = document.createElementNS(SVG, "svg");
      svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
      svg.setAttribute("preserveAspectRatio", "none");
      svg.setAttribute("role", "img");
      svg.setAttribute("aria-label", `Course of ${variable.name} over the last ${WINDOW_S} seconds`);
      const path = document.createElementNS(SVG, "path");
      svg.append(path);
      const range = document.createElement("div");
      range.className = "range";
      const [low, high] = [document.createElement("span"), document.createElement("span")];
      range.append(low, high);
      box.append(title, svg, range);
      parent.append(box);
      return { ...variable, path, value, low, high };
    });
  }

  /** Adds samples [time, v, dg, risk] from before this page was opened. */
  fill(samples) {
    if (this.samples.length) return;
    this.samples = samples;
    this.draw();
  }

  add(scene) {
    const last = this.samples.at(-1)?.[0];
    if (last !== undefined && scene.t < last - 1) this.samples = [];
    if (scene.v === null || (last !== undefined && scene.t <= last)) return;
    this.samples.push([scene.t, scene.v, scene.dg, scene.risk]);
    while (this.samples[0][0] < scene.t - WINDOW_S) this.samples.shift();
    this.draw();
  }

  draw() {
    const end = this.samples.at(-1)?.[0];
    this.charts.forEach((chart, i) => {
      const known = this.samples.filter((s) => s[i + 1] !== null);
      if (!known.length) {
        chart.value.textContent = "unknown";
        return;
      }
      const values = known.map((s) => s[i + 1]);
      const [low, high] = [Math.min(...values), Math.max(...values)];
      const scale = high > low ? (HEIGHT - 12) / (high - low) : 0;
      const at = (s) => `${(WIDTH + ((s[0] - end) / WINDOW_S) * WIDTH).toFixed(1)} ${(HEIGHT - 6 - (s[i + 1] - low) * scale).toFixed(1)}`;
      let pen = "M";
      let d = "";
      for (const sample of this.samples) {
        if (sample[i + 1] === null) { pen = "M"; continue; }
        d += `${pen} ${at(sample)} `;
        pen = "L";
      }
      chart.path.setAttribute("d", d);
      chart.value.textContent = `${values.at(-1).toFixed(2)} ${chart.unit}`;
      chart.low.textContent = `lowest ${low.toFixed(2)}`;
      chart.high.textContent = `highest ${high.toFixed(2)}`;
    });
  }
}
