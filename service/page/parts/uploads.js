// Files on their way in: how much is sent, then what the worker does with each, then where it is.

import { send, upload } from "./api.js";
import { announce, h } from "./dom.js";
import { ended, follow } from "./follow.js";
import { path, withQuery } from "./router.js";
import { count, explained, taskWords } from "./words.js";

const LANES = 2;
const waiting = [];
let running = 0;
let panel = null;

/** Add files to a collection, a few at a time. label: for all of them, or null. */
export function addFiles(collection, files, label = null) {
  const list = opened();
  for (const file of files) {
    const line = new Line(file.name);
    list.append(line.element);
    waiting.push(() => one(collection, file, label, line));
  }
  while (running < LANES && waiting.length > 0) lane();
  headline();
}

async function lane() {
  running += 1;
  while (waiting.length > 0) {
    const next = waiting.shift();
    await next();
    headline();
  }
  running -= 1;
  headline();
  if (running === 0) dispatchEvent(new CustomEvent("shapes-changed"));
}

async function one(collection, file, label, line) {
  const form = new FormData();
  if (label) form.append("label", label);
  form.append("file", file);
  try {
    const { status, body } = await upload(path`/v1/collections/${collection}/shapes`, form,
      (share) => line.tell(share < 1 ? `sending, ${Math.round(share * 100)} %` : "sent, checking", share * 0.3));
    dispatchEvent(new CustomEvent("shapes-changed"));
    const task = body.task && !ended(body.task) && body.shape.state !== "indexed"
      ? await follow(body.task.id, (now) => line.tell(taskWords(now), 0.3 + 0.7 * now.progress.fraction)) : body.task;
    if (task?.error) throw Object.assign(new Error(task.error.detail), task.error);
    if (task?.state === "cancelled") line.fail("cancelled");
    else line.done(collection, body.shape, status === 200 ? "was there already" : "ready");
  } catch (error) {
    line.fail(explained(error), error.status === undefined && error.code === "unreachable"
      ? () => { waiting.push(() => one(collection, file, label, line)); if (running < LANES) lane(); } : null);
  }
}

class Line {
  constructor(name) {
    this.name = name;
    this.text = h("span", { class: "quiet small" }, "waiting");
    this.bar = h("progress", { max: 1, value: 0, "aria-label": `Progress of ${name}` });
    this.ways = h("span", { class: "ways" });
    this.element = h("li", {}, h("span", { class: "name" }, name), this.ways, this.bar, this.text);
  }

  tell(text, fraction) {
    this.text.textContent = text;
    this.text.className = "quiet small";
    this.bar.value = fraction;
    this.bar.hidden = false;
    this.ways.replaceChildren();
  }

  done(collection, shape, text) {
    this.tell(text, 1);
    this.bar.hidden = true;
    this.text.className = "good small";
    this.ways.replaceChildren(
      h("a", { href: path`/collections/${collection}/shapes/${shape.id}`, "aria-label": `Look at ${this.name}` }, "Look"),
      h("a", { href: withQuery(path`/collections/${collection}/query`, { shape: shape.id }), "aria-label": `Find shapes like ${this.name}` }, "Find similar"));
    announce(`${this.name}: ${text}`);
  }

  fail(text, again) {
    this.bar.hidden = true;
    this.text.textContent = text;
    this.text.className = "bad small";
    this.ways.replaceChildren(...(again ? [h("button", { type: "button", class: "plain", onclick: again }, "Try again")] : []));
    announce(`${this.name}: ${text}`);
  }
}

function opened() {
  panel = document.getElementById("uploads");
  if (!panel.querySelector("ul")) {
    panel.replaceChildren(
      h("header", {}, h("h2", { id: "uploads-title" }, ""),
        h("button", { type: "button", class: "plain", "aria-label": "Close the list of uploads", onclick: close }, "×")),
      h("ul", {}));
  }
  panel.hidden = false;
  panel.onclick = (event) => { if (event.target.closest("a") && running === 0) close(); };
  return panel.querySelector("ul");
}

function close() {
  panel.hidden = true;
  if (running === 0) panel.replaceChildren();
}

function headline() {
  const left = waiting.length + running;
  const title = document.getElementById("uploads-title");
  const failed = panel.querySelectorAll(".bad").length;
  const ready = panel.querySelectorAll("li").length - failed;
  const result = failed === 0 ? "Shapes added" : ready === 0 ? "No shape is ready" : `${count(ready, "shape")} ready, ${failed} not`;
  if (title) title.textContent = left > 0 ? `Adding shapes, ${left} to go` : result;
}

/** The collection of this name; it is made when there is none. */
export async function ensureCollection(name) {
  try {
    await send("POST", "/v1/collections", { name });
  } catch (error) {
    if (error.code !== "collection_exists") throw error;
  }
  return name;
}
