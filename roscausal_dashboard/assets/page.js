// The page: receives the events and passes them to scene, charts, graph and lists.

import { Charts } from "./charts.js";
import { showEvidence } from "./evidence.js";
import { compared, drawGraph, sentence } from "./graph.js";
import { Scene } from "./scene.js";

const $ = (id) => document.getElementById(id);
const MOST_MESSAGES = 200;

const scene = new Scene($("scene"), $("scene-text"));
const charts = new Charts($("charts"));
let models = [];
let shown = 0;
let following = true;
let ended = "";
/** Evidence of models by their batch, newest last. */
const evidence = new Map();
const MOST_EVIDENCE = 20;

const clock = (t) => (t > 1e8 ? new Date(t * 1000).toISOString().slice(11, 19) : `${t.toFixed(1)} s`);

function connect() {
  const source = new EventSource("events");
  const on = (kind, act) => source.addEventListener(kind, (event) => act(JSON.parse(event.data)));
  source.onopen = () => {
    // After a reconnect the server sends everything again.
    models = [];
    $("messages").replaceChildren();
    ended = "";
    state("live", "live");
  };
  source.onerror = () => {
    state(ended ? `${ended}; the program is closed` : "connection lost, trying again", "lost");
    // If the server refused the connection, the browser does not retry, so the page does.
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 3000);
  };
  on("scene", (data) => {
    scene.show(data);
    charts.add(data);
    $("time").textContent = clock(data.t);
  });
  on("series", (data) => charts.fill(data));
  on("status", showStatus);
  on("model", addModel);
  on("message", addMessage);
  on("evidence", (data) => {
    evidence.delete(data.batch);
    evidence.set(data.batch, data.evidence);
    if (evidence.size > MOST_EVIDENCE) evidence.delete(evidence.keys().next().value);
  });
  on("ended", (text) => {
    ended = text;
    state(text, "ended");
  });
}

function state(text, kind) {
  $("connection").textContent = text;
  $("connection").className = `pill ${kind}`;
}

function showStatus(status) {
  const known = (value) => (value === null || value === undefined ? "–" : value);
  meter("recording", status.rows, status.rows_of, "rows");
  meter("analysis", status.tests, status.tests_of, "tests");
  $("batches").textContent = known(status.batches);
  $("waiting").textContent = known(status.waiting);
  $("models").textContent = status.models;
  const list = $("nodes");
  for (const node of status.nodes) {
    let item = [...list.children].find((li) => li.dataset.name === node.name);
    if (!item) {
      item = document.createElement("li");
      item.dataset.name = node.name;
      const details = document.createElement("details");
      const table = document.createElement("table");
      table.append(document.createElement("tbody"));
      details.append(make("summary", "Figures", ""), table);
      item.append(make("strong", node.name, ""), make("span", "", "level"), make("p", "", ""), details);
      list.append(item);
      [...list.children].sort((a, b) => a.dataset.name.localeCompare(b.dataset.name)).forEach((li) => list.append(li));
    }
    const [, level, message, details] = item.children;
    level.textContent = node.level === 0 ? "running" : node.level === 1 ? "warning" : "error";
    level.className = `level ${node.level === 0 ? "ok" : "bad"}`;
    message.textContent = node.level === 0 ? "" : node.message;
    if (details.open || !details.querySelector("tr")) {
      details.querySelector("tbody").replaceChildren(...node.values.map(([name, value]) => {
        const row = document.createElement("tr");
        const head = make("th", name, "");
        head.scope = "row";
        row.append(head, make("td", value, ""));
        return row;
      }));
    }
  }
}

function meter(id, done, of, unit) {
  const meter = $(id);
  if (done === null || done === undefined) return;
  if (of) {
    meter.max = of;
    meter.value = done;
  } else {
    meter.max = 1;
    meter.value = 0;
  }
  $(`${id}-text`).textContent = of ? `${done} of ${of} ${unit}` : done ? `${done} ${unit}` : "idle";
}

function addModel(model) {
  const index = models.findIndex((known) => known.number === model.number);
  if (index >= 0) models[index] = model;
  else models.push(model);
  if (following) shown = models.length - 1;
  showModel();
}

function showModel() {
  const [model, before] = [models[shown], models[shown - 1]];
  if (!model) return;
  // What the keyboard is at is drawn anew, so it is found again afterwards.
  const at = document.activeElement?.closest?.("#graph [data-link], #links [data-link]");
  const kept = at && [at.closest("#graph, #links").id, at.dataset.link];
  drawGraph($("graph"), model, before, ask);
  $("model-title").textContent = `Model ${model.number}, ${clock(model.t)}: ${model.method.toUpperCase()} with ${model.test.toUpperCase()}, alpha ${model.alpha}, ${model.samples} samples from ${model.batch}`;
  const slider = $("history");
  slider.min = 1;
  slider.max = models.length;
  slider.value = shown + 1;
  slider.setAttribute("aria-valuetext", `model ${model.number} of ${models.at(-1).number}, ${clock(model.t)}`);
  slider.disabled = models.length < 2;
  $("history-text").textContent = `${model.number} of ${models.at(-1).number}`;
  $("earlier").disabled = shown === 0;
  $("later").disabled = shown === models.length - 1;
  $("newest").disabled = models.length < 2;
  $("newest").setAttribute("aria-pressed", String(following));
  const links = compared(model, before);
  $("links").replaceChildren(...links.map((link) => {
    const item = document.createElement("li");
    if (link.state !== "same") item.append(make("span", link.state === "new" ? "appeared: " : "vanished: ", link.state));
    if (link.state === "gone") {
      item.append(sentence(link, model));
      return item;
    }
    const button = make("button", sentence(link, model), "asking");
    button.type = "button";
    button.dataset.link = `${link.cause} ${link.effect} ${link.lag}`;
    button.addEventListener("click", () => ask(link));
    item.append(button);
    return item;
  }));
  if (!links.length) $("links").replaceChildren(make("li", "no causal link found", ""));
  if (kept) [...$(kept[0]).querySelectorAll("[data-link]")].find((place) => place.dataset.link === kept[1])?.focus();
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

function addMessage(message) {
  const item = document.createElement("p");
  item.append(make("time", clock(message.t), ""), message.text);
  $("messages").prepend(item);
  while ($("messages").children.length > MOST_MESSAGES) $("messages").lastChild.remove();
}

function make(name, text, kind) {
  const made = document.createElement(name);
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

$("history").addEventListener("input", (event) => choose(Number(event.target.value) - 1));
$("earlier").addEventListener("click", () => choose(shown - 1));
$("later").addEventListener("click", () => choose(shown + 1));
$("newest").addEventListener("click", () => choose(models.length - 1));
connect();
