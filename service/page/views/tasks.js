// What the worker does, did and will do: cancel what waits or runs, try again what failed.

import { get, post } from "../parts/api.js";
import { empty, h, notify, select, table, time } from "../parts/dom.js";
import { path, remember, withQuery } from "../parts/router.js";
import { explained, taskWords } from "../parts/words.js";

const KINDS = { describe: "Describe a shape", query: "Find similar", evaluate: "Evaluate", denoise: "Smooth a mesh", synthesise: "Make synthetic shapes", map: "Draw a map", duplicates: "Look for duplicates" };
const STATES = [["", "all"], ["running", "running"], ["queued", "waiting"], ["failed", "failed"], ["succeeded", "done"], ["cancelled", "cancelled"]];
const EVERY = 2000;

export async function show(view) {
  view.title("Tasks");
  const place = h("div", {});
  const state = select(STATES, view.query.state ?? "", { "aria-label": "Which tasks", onchange: () => { remember({ state: state.value }); load(); } });
  view.root.append(h("header", { class: "heading" }, h("div", { class: "spread" }, h("h1", {}, "Tasks"), h("div", { class: "bar" }, state))), place);
  let shown = "";
  const load = async (force = true) => {
    const { items } = await get(withQuery("/v1/tasks", { limit: 100, state: state.value }), view.signal);
    const now = JSON.stringify(items);
    if (now === shown || (!force && place.contains(document.activeElement) && document.activeElement.matches("button"))) return;
    shown = now;
    place.replaceChildren(items.length === 0 ? empty("No tasks", "What the worker does shows up here: shapes to describe, questions, evaluations.") : list(items, load));
  };
  await load();
  const timer = setInterval(() => load(false).catch(() => {}), EVERY);
  view.signal.addEventListener("abort", () => clearInterval(timer));
}

function list(items, load) {
  const act = (task, verb, text) => h("button", { type: "button", class: "plain", "aria-label": `${text}: ${KINDS[task.kind] ?? task.kind}`, onclick: async () => {
    try {
      await post(path`/v1/tasks/${task.id}/${verb}`);
      await load();
    } catch (error) {
      notify(explained(error), { bad: true });
    }
  } }, text);
  return table("The newest tasks first", [
    { title: "Task", cell: (task) => where(task) },
    { title: "State", cell: (task) => h("span", { class: task.error ? "bad" : task.state === "running" ? null : "state" }, task.error ? explained(task.error) : taskWords(task)) },
    { title: "Since", cell: (task) => time(task.finished_at ?? task.started_at ?? task.created_at) },
    { title: "Do", cell: (task) => (task.state === "queued" || task.state === "running"
      ? (task.cancel_requested ? "stopping …" : act(task, "cancel", "Cancel"))
      : task.state === "failed" || task.state === "cancelled" ? act(task, "retry", "Try again") : "") },
  ], items);
}

function where(task) {
  const text = KINDS[task.kind] ?? task.kind;
  const { collection, shape } = task;
  const to = result(task);
  const named = collection && shape && task.shape_name;
  const about = named && [": ", h("a", { href: path`/collections/${collection}/shapes/${shape}` }, task.shape_name)];
  const inside = collection && [" in ", h("a", { href: path`/collections/${collection}` }, collection)];
  return h("span", {}, to ? h("a", { href: to }, text) : text, about, inside);
}

/** Where what a task made is seen; null where its shape or collection shows it, or there is nothing yet. */
function result({ id, kind, state, collection }) {
  if (kind === "query" && collection) return withQuery(path`/collections/${collection}/query`, { task: id });
  if (kind === "map" && collection) return path`/collections/${collection}/map`;
  return kind === "evaluate" && state === "succeeded" ? "/evaluations" : null;
}
