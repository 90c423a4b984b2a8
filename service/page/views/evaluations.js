// Evaluations: start one, see which there are, choose some to compare.

import { all, get, post } from "../parts/api.js";
import { choices } from "../parts/choices.js";
import { empty, field, h, notify, select, table, time } from "../parts/dom.js";
import { evaluationName } from "../parts/scores.js";
import { go, path } from "../parts/router.js";
import { explained, taskWords } from "../parts/words.js";

const SYNTHETIC = "\u0000synthetic";

export async function show(view) {
  view.title("Evaluations");
  const [collections, offered, page] = await Promise.all([all("/v1/collections", 500, view.signal), choices(view.signal), get("/v1/evaluations?limit=50", view.signal)]);
  view.root.append(h("header", { class: "heading" }, h("h1", {}, "Evaluations"),
    h("p", { class: "quiet" }, "How well are shapes of the same label found? Each shape asks once, and never finds itself.")),
  form(view, collections, offered),
  page.items.length === 0 ? empty("No evaluation yet", "Start one above. The synthetic set needs no shapes of yours: the service makes them.") : list(page.items));
}

function form(view, collections, offered) {
  const usable = collections.filter((one) => one.counts.shapes > 2).map((one) => [one.name, `${one.name} (${one.counts.shapes})`]);
  const of = select([...usable, [SYNTHETIC, "the synthetic set"]], view.query.collection ?? usable[0]?.[0] ?? SYNTHETIC);
  const perClass = h("input", { type: "number", min: 2, max: 200, value: 10 });
  const noise = h("input", { type: "number", min: 0, max: 5, step: 0.05, value: 0 });
  const synthetic = h("div", { class: "bar end" }, field("Shapes of each class", perClass), field("Noise, in edge lengths", noise));
  const descriptor = select(offered.descriptors.map((one) => [one.name, one.name.replaceAll("_", " ")]), offered.descriptor);
  const measureAt = h("span", {});
  const about = h("p", { class: "quiet small" });
  let measure = null;
  let again = null;
  const shown = () => {
    synthetic.hidden = of.value !== SYNTHETIC;
    const { measures, rerank } = offered.of(descriptor.value);
    measure = measures.length > 1 ? select(measures.map((name) => [name, name.replaceAll("_", " ")]), measures[0], { onchange: tell }) : null;
    again = rerank ? h("input", { type: "checkbox", checked: true }) : null;
    measureAt.replaceChildren(...(measure ? [field("Measure", measure)] : []), ...(again ? [h("label", { class: "check" }, again, "re-rank by neighbours")] : []));
    tell();
  };
  const tell = () => { about.textContent = [offered.of(descriptor.value).description, measure && offered.measureWords(measure.value)].filter(Boolean).join(" · "); };
  of.addEventListener("change", shown);
  descriptor.addEventListener("change", shown);
  shown();
  return h("form", { class: "panel", onsubmit: async (event) => {
    event.preventDefault();
    const asked = of.value === SYNTHETIC ? { synthetic: { per_class: Number(perClass.value), noise: Number(noise.value) } } : { collection: of.value };
    try {
      const made = await post("/v1/evaluations", { ...asked, descriptor: descriptor.value, ...(measure && { measure: measure.value }), ...(again && { rerank: again.checked }) });
      go(path`/evaluations/${made.id}`);
    } catch (error) {
      notify(explained(error), { bad: true });
    }
  } }, h("h2", {}, "New evaluation"), h("div", { class: "bar end" }, field("Of", of), field("Compare by", descriptor), measureAt, synthetic,
    h("button", {}, "Evaluate")), about);
}

function list(items) {
  const chosen = new Set();
  const compare = h("button", { type: "button", class: "secondary", disabled: true, onclick: () => go(`/evaluations/compare?${[...chosen].map((id) => `id=${encodeURIComponent(id)}`).join("&")}`) }, "Compare");
  const box = (one) => h("input", { type: "checkbox", "aria-label": `Compare ${evaluationName(one)}`, disabled: one.task.state !== "succeeded", onchange: (event) => {
    if (event.target.checked) chosen.add(one.id); else chosen.delete(one.id);
    compare.disabled = chosen.size < 2;
  } });
  return h("section", {}, table("The newest first; tick two or more to compare them", [
    { title: "Evaluation", cell: (one) => h("a", { href: path`/evaluations/${one.id}` }, evaluationName(one)) },
    { title: "State", cell: (one) => h("span", { class: one.task.error ? "bad" : one.task.state === "running" ? null : "state" }, one.task.error ? explained(one.task.error) : taskWords(one.task)) },
    { title: "Started", cell: (one) => time(one.created_at) },
    { title: "Compare", cell: box },
  ], items), h("div", { class: "bar" }, compare));
}
