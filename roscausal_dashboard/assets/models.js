// The models of the run: history, graph, sentences, and the evidence of a link.

import { $, clock, make } from "./draw.js";
import { showEvidence } from "./evidence.js";
import { pictures, sentence, showGraph, showMatrix } from "./graph.js";

/** Evidence of models by their batch, newest last. */
const evidence = new Map();
const MOST_EVIDENCE = 20;
/** What may be said of each model, by its batch. */
const summaries = new Map();

let models = [];
/** Change events of the discovery node, where it sends them: it alone tells a change from chance. */
let changes = [];
let shown = 0;
let following = true;

/** After a reconnect the server sends everything again. */
export function restart() { [models, changes] = [[], []]; }

/** All models that are known, oldest first. */
export const known = () => models;

/** All changes that are known. */
export const changed = () => changes;

export function addEvidence(data) {
  evidence.delete(data.batch);
  evidence.set(data.batch, data.evidence);
  if (evidence.size > MOST_EVIDENCE) evidence.delete(evidence.keys().next().value);
}

export function addSummary(data) {
  summaries.set(data.batch, data);
  if (models[shown]?.batch === data.batch) showSummary(data.batch);
}

export function addChange(change) {
  changes.push(change);
  if (models[shown]?.batch === change.batch) showModel();
}

export function addModel(model) {
  const index = models.findIndex((known) => known.number === model.number);
  if (index >= 0) models[index] = model;
  else models.push(model);
  if (following) shown = models.length - 1;
  showModel();
}

function showSummary(batch) {
  const { conclusion, advice } = summaries.get(batch) ?? { conclusion: [], advice: [] };
  $("conclusion").replaceChildren(...conclusion.map((one) => make("li", one)));
  $("advice").replaceChildren(...advice.map((one) => make("li", one)));
  $("next").hidden = !advice.length;
}

function showModel() {
  const model = models[shown];
  if (!model) return;
  const confirmed = changes.filter((change) => change.kind === "confirmed" && change.batch === model.batch);
  drawModel(model, confirmed);
  showSummary(model.batch);
  $("model-title").textContent = `Model ${model.number}, ${clock(model.t)}: ${model.method.toUpperCase()} with ${model.test.toUpperCase()}, ${model.level_name} ${model.level ?? "chosen by a score"}, ${model.samples} samples from ${model.batch}`;
  const slider = $("history");
  [slider.min, slider.max, slider.value] = [1, models.length, shown + 1];
  slider.setAttribute("aria-valuetext", `model ${model.number} of ${models.at(-1).number}, ${clock(model.t)}`);
  slider.disabled = models.length < 2;
  $("history-text").textContent = `${model.number} of ${models.at(-1).number}`;
  $("earlier").disabled = shown === 0;
  $("later").disabled = shown === models.length - 1;
  $("newest").disabled = models.length < 2;
  $("newest").setAttribute("aria-pressed", String(following));
  anew($("links"), () => $("links").replaceChildren(...confirmed.map((change) => make("li", change.text, "new")), ...model.links.map((link) => {
    const item = document.createElement("li");
    const button = Object.assign(make("button", sentence(link, model), "asking"), { type: "button" });
    button.dataset.link = `${link.cause} ${link.effect} ${link.lag}`;
    button.addEventListener("click", () => ask(link));
    item.append(button);
    return item;
  })));
  if (!model.links.length) $("links").append(make("li", "no causal link found", ""));
}

/** The pictures of a model, unless another one is shown by the time they come. Of many at once, as on a slider, only the last is asked for. */
async function drawModel(model, confirmed) {
  await new Promise((done) => setTimeout(done, 50));
  const drawn = models[shown] === model && await pictures(model);
  if (models[shown] !== model) return;
  $("matrix-box").hidden = !drawn?.matrix;
  if (!drawn) {
    $("graph").replaceChildren(make("p", "The server has no picture of this model; its links are listed below."));
    return;
  }
  anew($("graph"), () => showGraph($("graph"), drawn.graph, model, confirmed, ask));
  if (drawn.matrix) anew($("matrix"), () => showMatrix($("matrix"), drawn.matrix, model, ask));
}

/** Fills a place anew. A link of it that the keyboard is at is found again afterwards. */
function anew(place, fill) {
  const kept = place.contains(document.activeElement) ? document.activeElement.dataset.link : undefined;
  fill();
  if (kept) [...place.querySelectorAll("[data-link]")].find((link) => link.dataset.link === kept)?.focus();
}

/** Opens what stands behind a link of the model that is shown; Escape or Close leads back to where it was asked. */
function ask(link) {
  const model = models[shown];
  const back = document.activeElement;
  const place = $("asked");
  const close = showEvidence(place, link, model, models, evidence.get(model.batch), sentence(link, model));
  const end = () => {
    place.hidden = true;
    place.replaceChildren();
    (back?.isConnected ? back : $("links")).focus?.();
  };
  close.addEventListener("click", end);
  place.onkeydown = (event) => { if (event.key === "Escape") end(); };
  place.focus();
  place.scrollIntoView({ block: "nearest" });
}

function choose(index) {
  shown = Math.max(0, Math.min(models.length - 1, index));
  following = shown === models.length - 1;
  showModel();
}

$("history").addEventListener("input", (event) => choose(Number(event.target.value) - 1));
$("earlier").addEventListener("click", () => choose(shown - 1));
$("later").addEventListener("click", () => choose(shown + 1));
$("newest").addEventListener("click", () => choose(models.length - 1));
