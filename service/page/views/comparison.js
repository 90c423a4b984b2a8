// Several evaluations beside each other: their curves in one plot, their scores in one table.

import { download, get, post } from "../parts/api.js";
import { empty, h, notify, table } from "../parts/dom.js";
import { follow } from "../parts/follow.js";
import { plot } from "../parts/pictures.js";
import { path } from "../parts/router.js";
import { evaluationName, SCORES, withInterval } from "../parts/scores.js";
import { explained, taskWords } from "../parts/words.js";

const MOST = 12;

export async function show(view) {
  const ids = new URLSearchParams(location.search).getAll("id").slice(0, MOST);
  view.title("Comparison");
  view.root.append(h("header", { class: "heading" }, h("p", { class: "crumbs" }, h("a", { href: "/evaluations" }, "Evaluations")), h("h1", {}, "Comparison")));
  const found = (await Promise.all(ids.map((id) => get(path`/v1/evaluations/${id}`, view.signal)))).filter((one) => one.report);
  if (found.length < 2) {
    view.root.append(empty("Nothing to compare", "Choose two or more evaluations that are done.", h("a", { class: "button", href: "/evaluations" }, "To the evaluations")));
    return;
  }
  view.root.querySelector(".heading").append(h("div", { class: "bar" }, report(view, found.map((one) => one.id))));
  const best = Object.fromEntries(Object.keys(SCORES).map((score) => [score, Math.max(...found.map((one) => one.report.overall[score]))]));
  const asked = found.map((one) => `evaluation=${encodeURIComponent(one.id)}`).join("&");
  view.root.append(h("section", { class: "plots" }, h("div", { class: "plot-card" }, h("h2", {}, "Precision and recall"),
    plot(`/v1/plots/precision_recall.svg?${asked}`, `Curves of ${found.map(evaluationName).join("; ")}. The same in numbers below.`))),
  table("Scores with their 95 % intervals; the best of each in bold. Compare only what asks the same shapes", [
    { title: "Evaluation", cell: (one) => h("a", { href: path`/evaluations/${one.id}` }, evaluationName(one)) },
    { title: "Queries", number: true, cell: (one) => String(one.report.queries) },
    ...Object.entries(SCORES).map(([score, [title]]) => ({ title, number: true, cell: (one) =>
      h(one.report.overall[score] === best[score] ? "strong" : "span", {}, withInterval(one.report.overall[score], one.report.intervals[score])) })),
  ], found));
}

/** A page of its own with all of it, to keep or to send: made in the background, then saved. */
function report(view, ids) {
  const told = h("span", { class: "quiet", role: "status" });
  const button = h("button", { type: "button", class: "secondary", onclick: async () => {
    button.disabled = true;
    try {
      const task = await post("/v1/reports", { evaluations: ids });
      const end = await follow(task.id, (now) => { told.textContent = taskWords(now); }, view.signal);
      told.textContent = "";
      if (end.state === "succeeded") await download(path`/v1/reports/${end.id}`, "comparison.html");
      else notify(end.error ? explained(end.error) : "The report was cancelled.", { bad: true });
    } catch (error) {
      if (!view.signal.aborted) notify(explained(error), { bad: true });
    } finally {
      button.disabled = false;
    }
  } }, "Save as a report");
  return [button, told];
}
