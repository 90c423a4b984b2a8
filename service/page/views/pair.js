// A query and one of its hits side by side: they turn together, matched endpoints are joined, and D is taken apart.

import { h, table } from "../parts/dom.js";
import { get, getIfThere } from "../parts/api.js";
import { path, withQuery } from "../parts/router.js";
import { count, digits, percent } from "../parts/words.js";
import { endpointColour, ink } from "../three/colours.js";
import { after, rotationOnto } from "../three/frame.js";
import { loadDisplay } from "../three/load.js";
import { helpText } from "../three/overlay.js";
import { Stage } from "../three/stage.js";
import { Surface } from "../three/surface.js";

const ALONE = "#8a929b";

/** What D is made of: matched pairs and endpoints that stay alone, the largest first. */
function shares(hit) {
  const rows = [
    ...hit.pairs.map((pair) => ({ query: pair.query, hit: pair.hit, amount: pair.distance })),
    ...hit.unmatched_query.map((one) => ({ query: one.endpoint, hit: null, amount: one.charge })),
    ...hit.unmatched_hit.map((one) => ({ query: null, hit: one.endpoint, amount: one.charge })),
  ];
  const total = rows.reduce((sum, row) => sum + row.amount, 0) || 1;
  return rows.map((row) => ({ ...row, share: row.amount / total })).sort((a, b) => b.amount - a.amount);
}

export async function showPair({ place, answer, hit, source, collection, signal, close, steps }) {
  const found = path`/v1/collections/${collection}/shapes/${hit.shape.id}`;
  const name = source.shape?.name ?? "your mesh";
  const rows = shares(hit);
  const stageAt = h("div", { class: "look" }, h("div", { class: "stage waiting" }));
  place.replaceChildren(
    h("header", { class: "spread" }, h("h2", { tabindex: "-1" }, `Why ${hit.shape.name}?`),
      h("div", { class: "bar" }, steps,
        h("a", { class: "button secondary", href: path`/collections/${collection}/shapes/${hit.shape.id}` }, "Open it"),
        h("a", { class: "button secondary", href: withQuery(path`/collections/${collection}/query`, { shape: hit.shape.id }) }, "Find similar to it"),
        h("button", { type: "button", class: "secondary", onclick: close }, "Close"))),
    h("div", { class: "halves wide" }, stageAt, h("div", { class: "facts" },
      h("p", { id: "pair-summary" }, summary(name, hit, rows)),
      pairs(rows), hit.note && h("p", { class: "quiet small" }, hit.note), parts(hit))));
  place.querySelector("h2").focus({ preventScroll: true });
  const [query, other] = await Promise.all([drawable(source.address, signal), drawable(found, signal)]);
  if (signal.aborted) return;
  if (!query || !other) {
    stageAt.replaceChildren(h("div", { class: "stage waiting" }, h("p", { class: "quiet" }, "Your mesh was not kept, so it cannot be drawn again. Add it to the collection to see both side by side.")));
    return;
  }
  stageAt.replaceChildren(...draw(stageAt, query, other, hit, name, rows, signal));
}

async function drawable(address, signal) {
  const skeleton = await getIfThere(`${address}/skeleton`, signal);
  if (!skeleton) return null;
  return { skeleton, mesh: await loadDisplay(address, signal) };
}

function summary(name, hit, rows) {
  const alone = rows.filter((row) => row.query === null || row.hit === null);
  const most = rows[0];
  const told = [`D = ${digits(hit.dissimilarity)}.`, `${count(hit.pairs.length, "endpoint")} of ${name} ${hit.pairs.length === 1 ? "has" : "have"} a partner`
    + (alone.length > 0 ? `, ${count(alone.length, "endpoint")} ${alone.length === 1 ? "stays" : "stay"} alone.` : ", and none stays alone.")];
  if (most && most.share > 0)
    told.push(most.query === null || most.hit === null ? `An endpoint without a partner counts most: ${percent(most.share)} of it.`
      : `The pair that differs most is ${most.query} with ${most.hit}: ${percent(most.share)} of it.`);
  return told.join(" ");
}

function pairs(rows) {
  const dot = (number, colour) => (number === null ? h("span", { class: "quiet" }, "alone") : h("span", { class: `dot ${colour}` }, String(number)));
  const colour = (row) => (row.query === null || row.hit === null ? "alone" : `c${row.query % 10}`);
  return table("Matched endpoints, what each adds to D", [
    { title: "Query", cell: (row) => dot(row.query, colour(row)) },
    { title: "Hit", cell: (row) => dot(row.hit, colour(row)) },
    { title: "Φ", number: true, cell: (row) => digits(row.amount, 3) },
    { title: "Share", number: true, cell: (row) => h("span", { class: "share" }, h("meter", { min: 0, max: 1, value: row.share, "aria-hidden": "true" }), percent(row.share)) },
  ], rows, { id: "pairs" });
}

/** Where several descriptors made up the ranking: how much of D each has. */
function parts(hit) {
  if (!hit.parts?.length) return null;
  return table("Descriptors, what each adds", [
    { title: "Descriptor", cell: (part) => part.name },
    { title: "D of it", number: true, cell: (part) => digits(part.dissimilarity, 3) },
    { title: "Share", number: true, cell: (part) => percent(part.share) },
  ], hit.parts);
}

function draw(place, query, other, hit, name, rows, signal) {
  const stage = new Stage({ label: `${name} and ${hit.shape.name} side by side in 3D`, describedBy: "pair-summary", panes: 2, signal });
  const [left, right] = [query, other].map(({ mesh }, pane) => stage.add(new Surface(mesh), pane));
  turnAlike(left, right, query.skeleton, other.skeleton, hit.pairs);
  for (const [surface, { skeleton }] of [[left, query], [right, other]]) {
    surface.addSkeleton(skeleton, ink());
    surface.glass(true);
  }
  const at = (surface, skeleton, number) => surface.at(skeleton.nodes[skeleton.endpoints[number].node].position);
  const marks = [];
  const links = [];
  rows.forEach((row) => {
    const both = row.query !== null && row.hit !== null;
    const colour = both ? endpointColour(row.query) : ALONE;
    if (row.query !== null) marks.push({ row, pane: 0, point: at(left, query.skeleton, row.query), text: String(row.query), colour, alone: !both });
    if (row.hit !== null) marks.push({ row, pane: 1, point: at(right, other.skeleton, row.hit), text: String(both ? row.query : row.hit), colour, alone: !both });
    if (both) links.push({ from: marks.length - 2, to: marks.length - 1, colour });
  });
  stage.overlay.show(marks, links);
  document.querySelectorAll("#pairs tbody tr").forEach((line, i) => {
    line.addEventListener("pointerenter", () => stage.overlay.point(marks.findIndex((mark) => mark.row === rows[i])));
    line.addEventListener("pointerleave", () => stage.overlay.point(null));
  });
  stage.host.append(h("p", { class: "pane-name left" }, name), h("p", { class: "pane-name right" }, hit.shape.name));
  requestAnimationFrame(() => stage.fit());
  return [stage.host, h("div", { class: "controls" }, h("button", { type: "button", class: "secondary", onclick: () => stage.fit() }, "Fit"),
    h("span", { class: "quiet small" }, "Matched ends have the number and colour of the query's; hollow ones have no partner.")), helpText()];
}

/** Turn the hit so that its matched endpoints lie as the query's do: then both are seen from the same side. */
function turnAlike(left, right, skeleton, other, matched) {
  if (matched.length < 3) return;
  const seen = (frame, graph, number) => {
    const place = graph.nodes[graph.endpoints[number].node].position;
    return frame.map((row) => row[0] * place[0] + row[1] * place[1] + row[2] * place[2]);
  };
  const [from, to] = [matched.map((pair) => seen(right.frame, other, pair.hit)), matched.map((pair) => seen(left.frame, skeleton, pair.query))];
  right.place(after(rotationOnto(from, to), right.frame));
}
