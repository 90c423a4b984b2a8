// The shapes of a collection: thumbnails to browse, filter and sort, and to label or delete several at once.

import { events, get, post } from "../parts/api.js";
import { empty, h, notify, select } from "../parts/dom.js";
import { keep, askWith, picker } from "../parts/drop.js";
import { ended } from "../parts/follow.js";
import { thumbnail } from "../parts/pictures.js";
import { go, path, remember, withQuery } from "../parts/router.js";
import { loadSynthetic, SAMPLES } from "../parts/synthetic.js";
import { count, explained, flagWords, stateWords, taskWords } from "../parts/words.js";

const SORTS = [["created", "oldest first"], ["-created", "newest first"], ["name", "name"], ["label", "label"], ["endpoints", "fewest endpoints"], ["-endpoints", "most endpoints"]];
const STATES = [["", "any state"], ["indexed", "ready"], ["queued", "waiting"], ["running", "running"], ["failed", "failed"], ["cancelled", "cancelled"]];
const NONE = "\u0000none";
const SETTLE = 600;

export async function show(view) {
  const { collection } = view.params;
  const address = path`/v1/collections/${collection}`;
  const [found, labels] = await Promise.all([get(address, view.signal), get(`${address}/labels`, view.signal)]);
  view.title(collection);
  const browser = new Browser(view, address, labels.items);
  view.root.append(heading(collection, found, browser), browser.element);
  await browser.load();
  watch(view, address, browser);
}

function heading(collection, found, browser) {
  browser.counts = h("p", { class: "quiet", role: "status" });
  browser.count(found);
  return h("header", { class: "heading" }, h("p", { class: "crumbs" }, h("a", { href: "/" }, "Shapes")),
    h("div", { class: "spread" }, h("h1", {}, collection),
      h("div", { class: "bar" }, picker("Add meshes", (files) => keep(files, collection)),
        picker("Find similar to a file", ([file]) => askWith(file), { multiple: false, plain: true }),
        h("a", { class: "button secondary", href: path`/collections/${collection}/map` }, "Map"),
        h("a", { class: "button secondary", href: withQuery("/evaluations", { collection }) }, "Evaluate"))),
    found.description && h("p", { class: "quiet" }, found.description), browser.counts);
}

/** Take up what changes while the view is open: live, or by asking now and then. */
async function watch(view, address, browser) {
  let timer = null;
  const soon = () => { timer ??= setTimeout(() => { timer = null; if (!view.signal.aborted) browser.refresh(); }, SETTLE); };
  addEventListener("shapes-changed", soon, { signal: view.signal });
  view.signal.addEventListener("abort", () => clearTimeout(timer));
  while (!view.signal.aborted) {
    try {
      for await (const [name, data] of events(withQuery("/v1/events", { collection: view.params.collection }), view.signal)) {
        if (name === "snapshot") data.tasks.forEach((task) => browser.making(task));
        if (name === "task") browser.making(data);
        if (name !== "waiting") soon();
      }
    } catch (error) {
      if (view.signal.aborted) return;
    }
    await new Promise((done) => { setTimeout(done, 5000); });
    soon();
  }
}

class Browser {
  constructor(view, address, labels) {
    Object.assign(this, { view, address, labels, chosen: new Map(), next: null, shown: 0 });
    this.grid = h("ul", { class: "cards" });
    this.more = h("button", { type: "button", class: "secondary", hidden: true, onclick: () => this.page() }, "Show more");
    this.tools = h("div", { class: "toolbar" });
    this.selection = h("div", { class: "selection", role: "region", "aria-label": "Selected shapes", hidden: true });
    this.nothing = h("div", {});
    this.work = h("p", { class: "quiet", role: "status" });
    this.filters();
    this.element = h("section", { "aria-label": "Shapes" }, this.tools, this.work, this.nothing, this.grid, h("div", { class: "bar centre" }, this.more), this.selection);
  }

  filters() {
    const { query } = this.view;
    const on = (name) => (event) => { remember({ [name]: event.target.value }); query[name] = event.target.value; this.load(); };
    const labels = [["", "any label"], ...this.labels.map(({ label, shapes }) => [label ?? NONE, `${label ?? "no label"} (${shapes})`])];
    this.tools.replaceChildren(
      h("input", { type: "search", placeholder: "Search by name", "aria-label": "Search by name", value: query.text ?? "", oninput: typed(on("text")) }),
      select(labels, query.label ?? "", { "aria-label": "Label", onchange: on("label") }),
      select(STATES, query.state ?? "", { "aria-label": "State", onchange: on("state") }),
      select(SORTS, query.sort ?? "created", { "aria-label": "Order", onchange: on("sort") }));
  }

  listing(cursor, limit) {
    const { text, label, state, sort } = this.view.query;
    return withQuery(`${this.address}/shapes`, { limit, cursor, text, state, sort,
      label: label === NONE ? "" : label, unlabelled: label === NONE ? "true" : "" });
  }

  async load() {
    this.loading?.abort();
    const mine = (this.loading = new AbortController());
    this.view.signal.addEventListener("abort", () => mine.abort());
    try {
      const limit = Math.min(200, Math.max(60, this.shown));
      const page = await get(this.listing(null, limit), mine.signal);
      this.grid.replaceChildren(...page.items.map((shape) => this.card(shape)));
      this.took(page, page.items.length);
    } catch (error) {
      if (!mine.signal.aborted) notify(explained(error), { bad: true });
    }
  }

  async page() {
    const page = await get(this.listing(this.next, 60), this.view.signal);
    this.grid.append(...page.items.map((shape) => this.card(shape)));
    this.took(page, this.shown + page.items.length);
  }

  took(page, shown) {
    this.next = page.next;
    this.shown = shown;
    this.more.hidden = !page.next;
    this.more.textContent = `Show more (${shown} of ${page.total})`;
    const filtered = ["text", "label", "state"].some((name) => this.view.query[name]);
    this.nothing.replaceChildren(...(shown > 0 ? [] : [filtered
      ? empty("No shape passes these filters", "Take one of them away to see more.", h("button", { type: "button", class: "secondary", onclick: () => go(this.view.root.ownerDocument.location.pathname) }, "Show all"))
      : empty("This collection is empty", "Drop meshes anywhere on this page, pick them, or look around with sample shapes first.",
        picker("Add meshes", (files) => keep(files, this.view.params.collection)),
        h("button", { type: "button", class: "secondary", onclick: loadSynthetic }, `Load ${SAMPLES}`))]));
  }

  async refresh() {
    try {
      const [found, labels] = await Promise.all([get(this.address, this.view.signal), get(`${this.address}/labels`, this.view.signal)]);
      this.count(found);
      if (JSON.stringify(labels.items) !== JSON.stringify(this.labels)) {
        this.labels = labels.items;
        if (!this.tools.contains(document.activeElement)) this.filters();
      }
    } catch {
      return; // the next event asks again
    }
    if (this.chosen.size === 0 && !this.grid.contains(document.activeElement)) await this.load();
  }

  /** Tell of the sample shapes while they are being made: until then there is nothing else to see. */
  making(task) {
    if (task.kind !== "synthesise") return;
    this.work.textContent = ended(task) ? (task.error ? explained(task.error) : "") : `Sample shapes are being made: ${taskWords(task)}. They appear here as they are ready.`;
    this.nothing.hidden = !ended(task);
  }

  count({ counts }) {
    const states = Object.entries(counts.states).filter(([state, n]) => n > 0 && state !== "indexed").map(([state, n]) => `${n} ${stateWords(state)}`);
    this.counts.textContent = counts.shapes === 0 ? "No shapes yet" : [count(counts.shapes, "shape"), ...states].join(", ");
  }

  card(shape) {
    if (this.chosen.has(shape.id)) this.chosen.set(shape.id, shape.label);
    const ready = shape.state === "indexed";
    const box = h("input", { type: "checkbox", class: "pick", "aria-label": `Select ${shape.name}`, checked: this.chosen.has(shape.id),
      onchange: () => { if (box.checked) this.chosen.set(shape.id, shape.label); else this.chosen.delete(shape.id); this.select(); } });
    return h("li", {}, box, h("a", { class: "card", href: path`/collections/${this.view.params.collection}/shapes/${shape.id}` },
      ready ? thumbnail(shape.thumbnail) : h("span", { class: "thumbnail waiting" }, h("span", {}, stateWords(shape.state))),
      h("strong", { title: shape.name }, shape.name),
      h("span", { class: shape.error ? "bad small" : "quiet small" }, shape.error ? shape.error.detail
        : [shape.label, ready && count(shape.endpoint_count, "endpoint"), shape.flags.length > 0 && flagWords(shape.flags[0])].filter(Boolean).join(" · "))));
  }

  select() {
    const before = new Map(this.chosen);
    const ids = [...before.keys()];
    this.selection.hidden = ids.length === 0;
    if (ids.length === 0) return;
    const label = h("input", { maxlength: 200, list: "labels", oninput: () => { set.disabled = label.value.trim() === ""; } });
    const set = h("button", { disabled: true }, "Set");
    this.selection.replaceChildren(h("strong", { role: "status" }, `${count(ids.length, "shape")} selected`),
      h("form", { class: "bar", onsubmit: (event) => { event.preventDefault(); if (!set.disabled) this.act(() => this.label(before, label.value.trim())); } },
        h("label", { class: "inline" }, "Label ", label),
        h("datalist", { id: "labels" }, this.labels.filter((one) => one.label).map((one) => h("option", { value: one.label }))), set),
      h("button", { type: "button", class: "secondary", disabled: [...before.values()].every((one) => one === null),
        onclick: () => this.act(() => this.label(before, null)) }, "Remove labels"),
      h("button", { type: "button", class: "secondary", onclick: () => this.act(() => this.remove(ids)) }, "Delete"),
      h("button", { type: "button", class: "secondary", onclick: () => this.pickAll() }, "Select all shown"),
      h("button", { type: "button", class: "plain", onclick: () => this.clear() }, "Clear"));
  }

  pickAll() {
    for (const box of this.grid.querySelectorAll(".pick")) if (!box.checked) box.click();
  }

  clear() {
    this.chosen.clear();
    for (const box of this.grid.querySelectorAll(".pick")) box.checked = false;
    this.select();
  }

  async act(action) {
    try {
      await action();
      this.clear();
      await this.refresh();
      await this.load();
    } catch (error) {
      notify(explained(error), { bad: true });
    }
  }

  /** before: the label of each shape until now, by id, so that it can be given back. */
  async label(before, label) {
    const give = (shapes, given) => post(`${this.address}/bulk/label`, { shapes, label: given });
    const { labelled } = await give([...before.keys()], label);
    notify(`${count(labelled, "shape")} ${label === null ? "without label now" : `labelled ${label}`}.`, { action: "Undo", seconds: 30, onaction: () => this.act(async () => {
      for (const old of new Set(before.values())) await give([...before.keys()].filter((id) => before.get(id) === old), old);
    }) });
  }

  async remove(ids) {
    const { deleted } = await post(`${this.address}/bulk/delete`, { shapes: ids });
    notify(`${count(deleted.length, "shape")} deleted.`, { action: "Undo", seconds: 30, onaction: () => this.act(async () => {
      const { refused } = await post(`${this.address}/bulk/restore`, { shapes: deleted });
      if (refused.length > 0) notify(refused[0].detail, { bad: true });
    }) });
  }
}

/** Not at every letter, but when the typing rests. */
function typed(action) {
  let timer = null;
  return (event) => { clearTimeout(timer); timer = setTimeout(() => action(event), 250); };
}

