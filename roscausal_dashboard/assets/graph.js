// The causal graph of a model: the engine's own pictures, whose links can be asked.

/** A link as a sentence. */
export function sentence(link, { dt, smallest_p: smallest }) {
  const earlier = link.lag === 0 ? "at the same time" : `at t-${link.lag}${dt > 0 ? ` (${+(link.lag * dt).toPrecision(3)} s earlier)` : ""}`;
  const effect = link.cause === link.effect ? "itself" : link.effect;
  const p = link.p < smallest ? `p < ${smallest}` : `p = ${link.p.toFixed(3)}`;
  // What is not an arrow of a cause comes in the node's own words.
  const words = link.words ?? `${link.cause} ${earlier} drives ${effect}`;
  return link.tested ? `${words}: strength ${link.value.toFixed(2)}, ${p}` : `${words}: required, not tested`;
}

/** The server's pictures of a model: graph, and matrix if it has many variables. Null: it draws none. */
export async function pictures(model) {
  try {
    const answer = await fetch(`model?number=${model.number}`);
    return answer.ok ? await answer.json() : null;
  } catch {
    return null;
  }
}

/** Puts a picture in place. It is parsed as a picture of its own, so nothing in it runs. */
function put(place, text, name) {
  const svg = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
  place.setAttribute("aria-label", name);
  place.classList.toggle("fits", svg.viewBox.baseVal.width <= 900);
  place.replaceChildren(svg);
}

/** What is clicked, tapped or given Enter calls `ask` with its link. */
function askable(spot, link, words, ask) {
  const facts = { class: `${spot.getAttribute("class")} ask`, tabindex: 0, role: "button", "aria-label": `Evidence: ${words}`, "data-link": `${link.cause} ${link.effect} ${link.lag}` };
  for (const [name, value] of Object.entries(facts)) spot.setAttribute(name, value);
  spot.addEventListener("click", () => ask(link));
  spot.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    ask(link);
  });
}

/** A copy of an arrow's line behind it: a glow, or the room in which a click is one on the arrow. */
function behind(arrow, line, kind) {
  const copy = line.cloneNode();
  copy.setAttribute("class", kind);
  arrow.insertBefore(copy, line);
}

/** Shows the graph of `model`, with a halo for what `changes` name. An arrow that is asked calls `ask` with its strongest link. */
export function showGraph(place, picture, model, changes, ask) {
  const words = model.links.map((link) => link.words ?? `${link.cause} at lag ${link.lag} drives ${link.effect}`).join("; ");
  put(place, picture, `Causal graph of model ${model.number}: ${words || "no links"}`);
  for (const arrow of place.querySelectorAll(".link")) {
    const joins = (link) => link.cause === arrow.dataset.cause && link.effect === arrow.dataset.effect;
    const here = model.links.filter(joins);
    const [line, strongest] = [arrow.querySelector("path"), here.reduce((a, b) => (Math.abs(b.value) > Math.abs(a.value) ? b : a), here[0])];
    if (!strongest) continue;
    if (!line) {
      arrow.addEventListener("click", () => ask(strongest));
      continue;
    }
    if (changes.some(joins)) behind(arrow, line, "halo");
    behind(arrow, line, "reach");
    askable(arrow, strongest, sentence(strongest, model), ask);
  }
}

/** Shows the links of `model` as a matrix, whose discs are in the order of the links. */
export function showMatrix(place, picture, model, ask) {
  put(place, picture, `Matrix of ${model.links.length} links: rows are effects, columns causes`);
  const discs = [...place.querySelectorAll(".cell")].filter((disc) => disc.querySelector("title"));
  model.links.forEach((link, i) => {
    const sure = typeof link.confidence === "number" ? `, confidence ${link.confidence.toFixed(2)}` : "";
    askable(discs[i], link, `${sentence(link, model)}${sure}`, ask);
  });
}
