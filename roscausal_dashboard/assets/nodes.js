// Batches, nodes and messages, as lists.

import { $, clock, make } from "./draw.js";

const MOST_MESSAGES = 200;

export function showStatus(status) {
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
      item = make("li");
      item.dataset.name = node.name;
      const [details, table] = [make("details"), make("table")];
      table.createTBody();
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
        const [row, head] = [make("tr"), make("th", name, "")];
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
  [meter.max, meter.value] = of ? [of, done] : [1, 0];
  $(`${id}-text`).textContent = of ? `${done} of ${of} ${unit}` : done ? `${done} ${unit}` : "idle";
}

export function addMessage(message) {
  const item = document.createElement("p");
  item.append(make("time", clock(message.t), ""), message.text);
  $("messages").prepend(item);
  while ($("messages").children.length > MOST_MESSAGES) $("messages").lastChild.remove();
}

