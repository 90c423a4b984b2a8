// One evaluation: watched while it runs; then its scores, plots, classes, and the queries that went worst.

import { download, get, post, send } from "../parts/api.js";
import { empty, h, notify, table } from "../parts/dom.js";
import { follow, ended } from "../parts/follow.js";
import { plot, thumbnail } from "../parts/pictures.js";
import { go, path, reload, withQuery } from "../parts/router.js";
import { evaluationName, SCORES } from "../parts/scores.js";
import { count, digits, explained, moment, taskWords } from "../parts/words.js";

export async function show(view) {
  const address = path`/v1/evaluations/${view.params.evaluation}`;
  const found = await get(address, view.signal);
  const name = evaluationName(found);
  view.title(name);
  view.root.append(h("header", { class: "heading" }, h("p", { class: "crumbs" }, h("a", { href: "/evaluations" }, "Evaluations")),
    h("div", { class: "spread" }, h("h1", {}, name), h("div", { class: "bar" }, actions(found, address))), h("p", { class: "quiet" }, moment(found.created_at))));
  if (!found.report) return view.root.append(ended(found.task) ? stopped(found) : running(view, found));
  view.root.append(overall(found.report), await plots(address, found.report), classes(found.report));
  const worst = (await get(`${address}/worst?limit=10&top=10`, view.signal)).items.filter((item) => item.average_precision < 1);
  view.root.append(worst.length > 0 ? queries(found, worst) : h("p", { class: "good" }, "Every query found its whole class before anything else."));
}

function actions(found, address) {
  const save = (text, from, name) => h("button", { type: "button", class: "secondary", onclick: () =>
    download(from, name).catch((error) => notify(explained(error), { bad: true })) }, text);
  return [found.report && save("Report, JSON", address, `evaluation-${found.id}.json`),
    found.report && save("Matrix, JSON", `${address}/matrix`, `matrix-${found.id}.json`),
    h("button", { type: "button", class: "secondary", onclick: async () => {
      try {
        await send("DELETE", address);
        go("/evaluations");
      } catch (error) {
        notify(explained(error), { bad: true });
      }
    } }, "Delete")];
}

function running(view, found) {
  const bar = h("progress", { max: 1, value: 0, "aria-label": "Progress" });
  const text = h("p", { class: "quiet", role: "status" }, taskWords(found.task));
  follow(found.task.id, (task) => { bar.value = task.progress.fraction; text.textContent = taskWords(task); }, view.signal).then(reload, () => {});
  return h("section", { class: "empty" }, h("h2", {}, "Under way"), bar, text,
    h("button", { type: "button", class: "secondary", onclick: () => post(path`/v1/tasks/${found.task.id}/cancel`).catch((error) => notify(explained(error), { bad: true })) }, "Cancel"));
}

function stopped(found) {
  return empty(found.task.state === "failed" ? "This evaluation failed" : "This evaluation was cancelled", found.task.error ? explained(found.task.error) : "It can be started again.",
    h("button", { type: "button", onclick: () => post(path`/v1/tasks/${found.task.id}/retry`).then(reload, (error) => notify(explained(error), { bad: true })) }, "Try again"));
}

function overall(report) {
  const left = report.left_out.unlabelled + report.left_out.classes_of_one;
  return h("section", {}, h("p", { class: "quiet" }, `${count(report.queries, "query", "queries")} in ${count(report.classes, "class", "classes")}`,
    left > 0 && `; ${count(left, "shape")} left out (${report.left_out.unlabelled} without label, ${report.left_out.classes_of_one} alone in their class)`, "."),
  h("dl", { class: "scores" }, Object.entries(SCORES).filter(([score]) => score in report.overall).map(([score, [title, meaning]]) =>
    h("div", { title: meaning }, h("dt", {}, title), h("dd", {}, digits(report.overall[score], 3)),
      report.intervals[score] && h("dd", { class: "quiet small" }, `95 %: ${digits(report.intervals[score][0], 3)} to ${digits(report.intervals[score][1], 3)}`)))));
}

async function plots(address, report) {
  const ranks = report.descriptor === "fused" || report.rerank;
  const one = (name, title, told) => h("div", { class: "plot-card" }, h("h2", {}, title), plot(`${address}/plots/${name}.svg`, told),
    h("p", { class: "quiet small" }, told, " ", h("button", { type: "button", class: "plain", onclick: () =>
      download(`${address}/plots/${name}.svg?theme=light`, `${name}.svg`).catch((error) => notify(explained(error), { bad: true })) }, "SVG")));
  return h("section", { class: "plots" },
    one("precision_recall", "Precision and recall", "How precise the hits are when so much of the class is found: higher is better."),
    one("matrix", "Dissimilarities", `${ranks ? "The rank of D among all pairs" : "D of all pairs"}, class by class: dark blocks on the diagonal are classes that hold together.`),
    one("confusion", "Confusion", "Of which class the nearest neighbour is: all on the diagonal would be perfect."));
}

function classes(report) {
  const rows = Object.entries(report.per_class).map(([label, scores]) => ({ label, ...scores })).sort((a, b) => a.map - b.map);
  return h("section", {}, h("h2", {}, "Classes"), table("Scores of each class, the hardest first", [
    { title: "Class", cell: (row) => row.label }, { title: "Shapes", number: true, cell: (row) => String(row.count) },
    ...Object.entries(SCORES).map(([score, [title]]) => ({ title, number: true, cell: (row) => digits(row[score], 3) })),
  ], rows));
}

/** The queries that found their class worst, each with its first hits. */
function queries(found, items) {
  const { collection } = found.request;
  const picture = (id, alt) => (collection ? thumbnail(path`/v1/collections/${collection}/shapes/${id}/thumbnail`, alt) : h("span", { class: "thumbnail missing" }));
  const card = (shape, told, kind) => h("li", { class: kind }, collection
    ? h("a", { class: "card", href: path`/collections/${collection}/shapes/${shape.shape}` }, picture(shape.shape, ""), h("span", { class: "small" }, shape.name), h("span", { class: "quiet small" }, told))
    : h("span", { class: "card" }, h("span", { class: "small" }, shape.name), h("span", { class: "quiet small" }, told)));
  return h("section", {}, h("h2", {}, "Worst queries"), h("p", { class: "quiet" }, "Each with its first hits; those of another class are marked."),
    items.map((item) => h("div", { class: "worst" },
      h("div", { class: "spread" }, h("h3", {}, item.name, h("span", { class: "chip" }, item.label)),
        collection && h("a", { href: withQuery(path`/collections/${collection}/query`, { shape: item.shape }) }, "Ask it anew")),
      h("p", { class: "quiet small" }, `Average precision ${digits(item.average_precision, 3)}`),
      h("ol", { class: "cards strip-cards" }, card(item, "the query", "asked"),
        item.hits.map((hit) => card(hit, `${hit.relevant ? "" : "✗ "}${hit.label}, ${digits(hit.dissimilarity, 3)}`, hit.relevant ? "right" : "wrong"))))));
}

