// The page: receives the events and passes them to scene, charts, time line, models and lists.

import { Ahead } from "./ahead.js";
import { Charts } from "./charts.js";
import { $, clock } from "./draw.js";
import { addChange, addEvidence, addModel, addSummary, changed, known, restart } from "./models.js";
import { Moments } from "./moments.js";
import { addMessage, showStatus } from "./nodes.js";
import { Scene } from "./scene.js";
import { Timeline } from "./timeline.js";

const scene = new Scene($("scene"), $("scene-text"), (who) => {
  const list = $(who === "robot" ? "follow" : "person");
  list.value = String(who);
  list.dispatchEvent(new Event("change"));
});
const moments = new Moments(showScene, showTime);
const timeline = new Timeline($("timeline"), (t) => moments.seek(t));
const charts = new Charts($("charts"), $("variables"), (t) => moments.seek(t), () => timeline.imposed());
const ahead = new Ahead(charts);
let ended = "";

function connect() {
  const source = new EventSource("events");
  const on = (kind, act) => source.addEventListener(kind, (event) => act(JSON.parse(event.data)));
  source.onopen = () => {
    restart();
    timeline.restart();
    ahead.restart();
    $("messages").replaceChildren();
    ended = "";
    state("live", "live");
    loadRun();
  };
  source.onerror = () => {
    state(ended ? `${ended}; the program is closed` : "connection lost, trying again", "lost");
    // If the server refused the connection, the browser does not retry, so the page does.
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, 3000);
  };
  on("scene", (data) => {
    choosePeople(data.people);
    if (moments.person !== undefined && data.people.some((person) => person.id === moments.person)) data.person = moments.person;
    if (moments.last !== undefined && data.t < moments.last - 1) timeline.restart();
    charts.add(data);
    moments.newest(data);
  });
  on("walls", (data) => scene.walls(data));
  on("status", showStatus);
  on("model", (model) => {
    addModel(model);
    marks();
  });
  on("summary", addSummary);
  on("evidence", addEvidence);
  on("change", (change) => {
    addChange(change);
    marks();
  });
  on("message", (message) => {
    if (message.kind === "do") {
      timeline.intervention(message);
      timeline.draw();
    }
    addMessage(message);
  });
  on("prediction", (news) => ahead.prediction(news));
  on("explanation", (answer) => ahead.explanation(answer));
  on("ended", (text) => {
    ended = text;
    moments.ended = true;
    state(text, "ended");
    loadRun();
  });
}

function marks() {
  timeline.models = known();
  timeline.changes = changed();
  // After the end no scene comes that would draw it.
  timeline.draw();
}

/** The whole run, for whoever comes late or chooses another person. */
async function loadRun() {
  try {
    const answer = await fetch(`series${moments.person === undefined ? "" : `?person=${moments.person}`}`);
    if (!answer.ok) return;
    const { first, last, rows } = await answer.json();
    charts.fill(rows);
    moments.span(first, last);
  } catch {
    // The connection is lost: the pill in the header says so.
  }
}

function state(text, kind) {
  $("connection").textContent = text;
  $("connection").className = `pill ${kind}`;
}

function showScene(data) {
  scene.show(data);
  $("time").textContent = clock(data.t);
}

/** Slider, buttons, time line and charts follow the moment that is shown. */
function showTime() {
  const { first, last, now, live } = moments;
  if (last === undefined) return;
  const seek = $("seek");
  [seek.min, seek.max, seek.value] = [first, last, now];
  seek.disabled = false;
  seek.setAttribute("aria-valuetext", clock(now));
  $("moment").textContent = `${clock(now)} of ${clock(last)}`;
  const label = live && !moments.ended || moments.playing ? "Pause" : "Play";
  if ($("pause").textContent !== label) $("pause").textContent = label;
  $("pause").disabled = $("follow-now").disabled = false;
  $("follow-now").textContent = moments.ended ? "To the end" : "Live";
  $("follow-now").setAttribute("aria-pressed", String(live));
  timeline.show(first, last, now);
  charts.show(now, live);
}

/** The list of people, made anew only when somebody comes or goes. */
function choosePeople(people) {
  const ids = people.map((person) => person.id);
  const list = $("person");
  if (list.dataset.ids === ids.join()) return;
  list.dataset.ids = ids.join();
  const chosen = list.value;
  list.replaceChildren(new Option("of the settings", ""), ...ids.map((id) => new Option(`person ${id}`, id)));
  list.value = ids.some((id) => String(id) === chosen) ? chosen : "";
}

$("pause").addEventListener("click", () => (moments.live && !moments.ended || moments.playing ? moments.pause() : moments.play()));
$("follow-now").addEventListener("click", () => moments.follow());
$("speed").addEventListener("change", (event) => { moments.speed = Number(event.target.value); });
$("seek").addEventListener("input", (event) => moments.seek(Number(event.target.value)));
$("window").addEventListener("change", (event) => {
  charts.length = event.target.value === "all" ? Infinity : Number(event.target.value);
  charts.draw();
});
$("person").addEventListener("change", (event) => {
  moments.person = event.target.value === "" ? undefined : Number(event.target.value);
  charts.restart();
  charts.other = moments.person !== undefined;
  scene.trails.clear();
  loadRun();
  if (moments.live && !moments.ended) return;
  moments.seek(moments.now);
});
$("follow").addEventListener("change", (event) => {
  scene.view.follow = event.target.value;
  if (event.target.value === "all") scene.view.fit();
});
$("nearer").addEventListener("click", () => scene.view.zoom(1 / 1.25));
$("farther").addEventListener("click", () => scene.view.zoom(1.25));
$("fit").addEventListener("click", () => {
  $("follow").value = scene.view.follow = "all";
  scene.view.fit();
});
connect();
