// Which shapes are like this one: the terms of the question, the hits as thumbnails, and why each matched.

import { get, post } from "../parts/api.js";
import { askByFile, fileOf, HITS } from "../parts/asking.js";
import { empty, field, h, notify, select } from "../parts/dom.js";
import { picker } from "../parts/drop.js";
import { follow } from "../parts/follow.js";
import { thumbnail } from "../parts/pictures.js";
import { failure, go, path, remember, step, withQuery } from "../parts/router.js";
import { choices, rankable } from "../parts/choices.js";
import { matchings } from "../parts/matchings.js";
import { count, digits, distanceWords, explained, flagWords, reached, taskWords } from "../parts/words.js";

const spaced = (name) => name.replaceAll("_", " ");
const TERMS = ["descriptor", "rerank", "measure", "tolerance", "k", "label"];

export async function show(view) {
  const { collection } = view.params;
  const { shape, task } = view.query;
  const results = h("div", { class: "results" });
  if (!shape && !task) {
    view.title("Find similar");
    view.root.append(heading(collection, "Find similar"), empty("Which mesh shall others be like?", "Drop a mesh here; it is not kept. Or open a shape and choose “Find similar”.",
      picker("Pick a mesh", ([file]) => askByFile(collection, file), { multiple: false })));
    return;
  }
  const asked = await (shape ? byShape(view, shape) : byTask(view, task, results)).catch((error) => {
    if (!error.details?.descriptors) throw error;
    view.title("Find similar");
    view.root.append(heading(collection, "Find similar"), lacking(view, error));
  });
  if (!asked || view.signal.aborted) return;
  const { answer, name, source } = asked;
  view.title(`Like ${name}`);
  view.root.replaceChildren(heading(collection, `Like ${name}`, source), await terms(view, answer, shape, task), compare(), results);
  fill(view, results, answer, source, await choices(view.signal));
}

function heading(collection, title, source) {
  return h("header", { class: "heading" },
    h("p", { class: "crumbs" }, h("a", { href: path`/collections/${collection}` }, collection),
      source?.shape && [" / ", h("a", { href: path`/collections/${collection}/shapes/${source.shape.id}` }, source.shape.name)]),
    h("div", { class: "asked" }, source && thumbnail(`${source.address}/thumbnail`), h("h1", {}, title)));
}

const compare = () => h("section", { id: "compare", "aria-label": "Why it matched", hidden: true });

/** What the address says of the question; what it leaves out has the service's default. */
function termsOf(query) {
  const given = Object.fromEntries(TERMS.filter((name) => query[name] !== undefined).map((name) => [name, query[name]]));
  for (const name of ["k", "tolerance"]) if (given[name] !== undefined) given[name] = given[name] === "any" ? null : Number(given[name]);
  if (given.rerank !== undefined) given.rerank = given.rerank === "true";
  return given;
}

async function byShape(view, id) {
  const address = path`/v1/collections/${view.params.collection}`;
  const [answer, shape] = await Promise.all([
    post(`${address}/query`, { k: HITS, ...termsOf(view.query), shape: id }, view.signal),
    get(`${address}/shapes/${encodeURIComponent(id)}`, view.signal),
  ]);
  return { answer, name: shape.name, source: { address: `${address}/shapes/${encodeURIComponent(id)}`, shape } };
}

/** A mesh that is not kept: its task holds the answer, and shows how far it is until then. */
async function byTask(view, id, results) {
  const name = view.query.name ?? "this mesh";
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const text = h("p", { class: "quiet", role: "status" }, "waiting");
  view.title(`Like ${name}`);
  view.root.append(heading(view.params.collection, `Like ${name}`), h("section", { class: "empty" }, h("h2", {}, "Looking for shapes like it"), bar, text));
  const task = await follow(id, (now) => { bar.value = now.progress.fraction; text.textContent = taskWords(now); }, view.signal);
  if (task.state === "succeeded") return { answer: task.result, name, source: { address: path`/v1/tasks/${id}`, task: id } };
  const error = task.error ?? { detail: `The task was ${task.state}.` };
  view.root.replaceChildren(heading(view.params.collection, `Like ${name}`),
    empty("This mesh could not be compared", explained(error), picker("Pick another mesh", ([file]) => askByFile(view.params.collection, file), { multiple: false })));
  results.remove();
  return null;
}

/** Ask the same in other terms. A file is sent again. */
function askAnew(view, values) {
  const next = { ...view.query, hit: undefined, ...values };
  if (view.query.shape) return go(withQuery(location.pathname, next), { replace: true });
  return askByFile(view.params.collection, fileOf(view.query.task), termsOf(next), true);
}

/** The pickers; what they offer is what the API offers. */
async function terms(view, answer, shape, task) {
  const { query } = answer;
  const [offered, ranking] = await Promise.all([choices(view.signal), rankable(view.params.collection, query.descriptor, view.signal)]);
  const file = task && fileOf(task);
  const ask = (values) => askAnew(view, values);
  const on = (name) => (event) => ask({ [name]: event.target.value });
  const tolerances = [["0", "the same number"], ["1", "one more or less"], ["2", "two more or less"], ["3", "three more or less"], ["any", "any number"]];
  const chosen = offered.of(query.descriptor);
  return h("fieldset", { class: "terms", disabled: Boolean(task && !file) }, h("legend", { class: "unseen" }, "Terms of the question"),
    field("Compare by", select(ranking.map((one) => [one.name, spaced(one.name)]), chosen.name,
      { onchange: (event) => ask({ descriptor: event.target.value, measure: undefined, rerank: undefined }), title: chosen.description })),
    chosen.measures.length > 1 && field("Measure", select(chosen.measures.map((name) => [name, spaced(name)]), query.measure,
      { onchange: on("measure"), title: offered.measureWords(query.measure) })),
    field("Endpoints", select(tolerances, query.tolerance === null ? "any" : String(query.tolerance), { onchange: on("tolerance") })),
    field("Hits", select([["6", "6"], ["12", "12"], ["24", "24"], ["48", "48"]].concat(["6", "12", "24", "48"].includes(String(query.k)) ? [] : [[String(query.k), String(query.k)]]), String(query.k), { onchange: on("k") })),
    field("Only the label", h("input", { value: view.query.label ?? "", placeholder: "any", onchange: on("label") })),
    chosen.rerank && h("label", { class: "check" }, h("input", { type: "checkbox", checked: Boolean(query.rerank),
      onchange: (event) => ask({ rerank: String(event.target.checked) }) }), "re-rank by neighbours"),
    h("p", { class: "quiet small" }, task && !file ? "The mesh was not kept: drop it again to ask in other terms." : chosen.description));
}

function fill(view, results, answer, source, offered) {
  const { hits, query } = answer;
  const address = path`/v1/collections/${view.params.collection}/shapes`;
  const most = Math.max(...hits.filter((hit) => reached(query, hit)).map((hit) => hit.dissimilarity), 1e-12);
  const chosen = hits.find((hit) => hit.shape.id === view.query.hit);
  const told = `${hits.length === 0 ? "No hit" : count(hits.length, "hit")} among ${count(answer.considered, "shape")} that were compared; this mesh has ${count(query.endpoint_count, "endpoint")}. `
    + (query.tolerance === null ? "" : `Shapes ${query.tolerance === 0 ? "with another number" : `whose number differs by more than ${query.tolerance}`} were not. `)
    + `${digits(answer.took_ms, 2)} ms.`;
  results.append(h("p", { class: "quiet", role: "status" }, told),
    ...(query.flags.length === 0 ? [] : [h("p", { class: "quiet" }, "Unusual about this mesh: ", query.flags.map((flag) => h("span", { class: "chip" }, flagWords(flag))))]),
    ...(view.query.hit && !chosen ? [h("p", { class: "flag" }, "The hit of this address is not among these. With other terms, or more hits, it may be.")] : []),
    ...answer.left_out.map((left) => leftOut(view, left, offered.of(query.descriptor).parts)),
    hits.length === 0 ? nothing(view, answer)
      : h("ol", { class: "cards hits" }, hits.map((hit) => card(query, hit, address, most, source.shape?.label, (event) => {
        event.preventDefault();
        step({ hit: hit.shape.id });
        explain(view, answer, hit, source);
      }))));
  if (chosen) explain(view, answer, chosen, source);
}

function nothing(view, { query }) {
  const { label, task } = view.query;
  const narrow = query.tolerance !== null;
  if (!narrow && !label) return empty("Nothing to compare with", "No other shape of this collection is ready.");
  const offer = (text, values) => !(task && !fileOf(task)) && h("button", { type: "button", onclick: () => askAnew(view, values) }, text);
  return empty(narrow ? "No shape is close in its number of endpoints" : `No shape to compare with has the label ${label}`,
    narrow ? `This one has ${query.endpoint_count}. Let the number differ by more${label ? `, or look beyond the label ${label}` : ""}.` : "Labels are compared letter by letter.",
    narrow && offer("Allow any number", { tolerance: "any" }), label && offer("Any label", { label: undefined }));
}

/** The shape that asks lacks what ranks: it was described before this was kept. */
function lacking(view, error) {
  return empty("This shape was described before this comparison existed", error.message,
    h("button", { type: "button", onclick: () => describeAgain(view, error.details.descriptors) }, "Describe such shapes again"),
    h("button", { type: "button", class: "secondary", onclick: () =>
      go(withQuery(location.pathname, { shape: view.query.shape, descriptor: "srg" }), { replace: true }) }, "Compare by the skeleton alone"));
}

/** Of all shapes that lack one of these descriptors. */
async function describeAgain(view, descriptors) {
  try {
    const { queued } = await post(path`/v1/collections/${view.params.collection}/reindex`, { descriptors });
    notify(queued === 0 ? "Every shape that could be was described so already, or waits for it." : `${count(queued, "shape")} will be described again.`);
  } catch (error) {
    notify(explained(error), { bad: true });
  }
}

/** Shapes that lack what ranks: why, and how they get it. */
function leftOut(view, left, parts) {
  return h("p", { class: "flag" }, `${count(left.shapes, "shape")} left out. ${left.detail} `, left.code === "without_descriptor"
    && h("button", { type: "button", class: "plain", onclick: () => describeAgain(view, parts) }, "Describe them again"));
}

function card(query, hit, address, most, label, onclick) {
  const href = withQuery(location.pathname, { ...Object.fromEntries(new URLSearchParams(location.search)), hit: hit.shape.id });
  const same = label && hit.shape.label === label;
  return h("li", { "data-hit": hit.shape.id }, h("a", { class: "card", href, onclick },
    thumbnail(`${address}/${hit.shape.id}/thumbnail`),
    h("strong", { title: hit.shape.name }, `${hit.rank}. ${hit.shape.name}`),
    hit.shape.label && h("span", { class: "quiet small" }, hit.shape.label, same && h("span", { class: "good" }, " ✓ same label")),
    h("span", { class: "measured small" }, h("span", { class: "number" }, distanceWords(query, hit)),
      h("meter", { min: 0, max: most, value: hit.dissimilarity, "aria-hidden": "true" })),
    h("span", { class: "quiet small" }, matchedWords(matchings(query, hit)[0]))));
}

const matchedWords = ({ pairs, unmatched_query: query, unmatched_hit: found }) => (query.length + found.length === 0
  ? `all ${count(pairs.length, "end")} matched` : `${count(pairs.length, "end")} matched, ${query.length + found.length} alone`);

let open = null;

/** Show one hit beside the query, above the others. */
async function explain(view, answer, hit, source) {
  open?.abort();
  const mine = (open = new AbortController());
  view.signal.addEventListener("abort", () => mine.abort());
  for (const item of view.root.querySelectorAll("[data-hit]")) item.toggleAttribute("data-chosen", item.dataset.hit === hit.shape.id);
  const place = view.root.querySelector("#compare");
  place.hidden = false;
  const close = () => { mine.abort(); place.hidden = true; place.replaceChildren(); remember({ hit: null });
    for (const item of view.root.querySelectorAll("[data-chosen]")) { item.removeAttribute("data-chosen"); item.querySelector("a").focus(); } };
  const beside = (by) => {
    const next = answer.hits[hit.rank - 1 + by];
    return h("button", { type: "button", class: "secondary", disabled: !next, "aria-label": by < 0 ? "The hit before" : "The next hit", onclick: () => {
      remember({ hit: next.shape.id });
      explain(view, answer, next, source);
    } }, by < 0 ? "←" : "→");
  };
  addEventListener("keydown", (event) => { if (event.key === "Escape" && !document.querySelector("dialog[open]")) close(); }, { signal: mine.signal });
  try {
    const { showPair } = await import("./pair.js");
    await showPair({ place, answer, hit, source, collection: view.params.collection, signal: mine.signal, close, steps: [beside(-1), beside(1)] });
    if (!mine.signal.aborted) place.scrollIntoView({ block: "start", behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth" });
  } catch (error) {
    if (!mine.signal.aborted) place.replaceChildren(failure(error));
  }
}
