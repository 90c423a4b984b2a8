// A query and one of its hits side by side: they turn together, matched endpoints are joined, and D is taken apart.

import { h, table } from "../parts/dom.js";
import { get, getIfThere } from "../parts/api.js";
import { path, withQuery } from "../parts/router.js";
import { count, digits, distanceWords, percent, reached } from "../parts/words.js";
import { matchings } from "../parts/matchings.js";
import { endpointColour, ink } from "../three/colours.js";
import { after, rotationOnto } from "../three/frame.js";
import { loadDisplay } from "../three/load.js";
import { helpText, noWebGl } from "../three/overlay.js";
import { Stage } from "../three/stage.js";
import { Surface } from "../three/surface.js";

const ALONE = "#8a929b";

/** What a dissimilarity is made of: matched pairs and endpoints that stay alone, the largest first. */
function shares(match) {
  const rows = [
    ...match.pairs.map((pair) => ({ query: pair.query, hit: pair.hit, amount: pair.distance })),
    ...match.unmatched_query.map((one) => ({ query: one.endpoint, hit: null, amount: one.charge })),
    ...match.unmatched_hit.map((one) => ({ query: null, hit: one.endpoint, amount: one.charge })),
  ];
  const power = squared(rows, match.dissimilarity) ? 2 : 1;
  const total = rows.reduce((sum, row) => sum + row.amount ** power, 0) || 1;
  return rows.map((row) => ({ ...row, share: row.amount ** power / total })).sort((a, b) => b.amount - a.amount);
}

/** Whether the squares of the amounts add up to the dissimilarity's, as the notes of some descriptors say. */
function squared(rows, dissimilarity) {
  const sum = (power) => rows.reduce((total, row) => total + row.amount ** power, 0);
  return Math.abs(Math.sqrt(sum(2)) - dissimilarity) < 1e-6 * dissimilarity && Math.abs(sum(1) - dissimilarity) > 1e-6 * dissimilarity;
}

export async function showPair({ place, answer, hit, source, collection, signal, close, steps }) {
  const found = path`/v1/collections/${collection}/shapes/${hit.shape.id}`;
  const name = source.shape?.name ?? "your mesh";
  const ways = matchings(answer.query, hit);
  const stageAt = h("div", { class: "look" }, h("div", { class: "stage waiting" }));
  const told = h("p", { id: "pair-summary" });
  const rowsAt = h("div", { class: "facts" });
  let scene = null;
  const show = (way) => {
    const rows = shares(way);
    told.textContent = summary(name, hit.shape.name, way, rows, answer.query);
    rowsAt.replaceChildren(pairs(rows, way), way.note ? h("p", { class: "quiet small" }, way.note) : "");
    scene?.match(way, rows);
  };
  place.replaceChildren(
    h("header", { class: "spread" }, h("h2", { tabindex: "-1" }, `Why ${hit.shape.name}?`),
      h("div", { class: "bar" }, steps,
        h("a", { class: "button secondary", href: path`/collections/${collection}/shapes/${hit.shape.id}` }, "Open it"),
        h("a", { class: "button secondary", href: withQuery(path`/collections/${collection}/query`, { shape: hit.shape.id }) }, "Find similar to it"),
        h("button", { type: "button", class: "secondary", onclick: close }, "Close"))),
    h("div", { class: "halves wide" }, stageAt, h("div", { class: "facts" }, ways.length > 1 && chooser(ways, show), ranked(answer.query, hit), told, rowsAt, parts(hit))));
  show(ways[0]);
  place.querySelector("h2").focus({ preventScroll: true });
  const [query, other] = await Promise.all([drawable(source.address, signal), drawable(found, signal)]);
  if (signal.aborted) return;
  if (!query || !other) {
    stageAt.replaceChildren(h("div", { class: "stage waiting" }, h("p", { class: "quiet" }, "Your mesh was not kept, so it cannot be drawn again. Add it to the collection to see both side by side.")));
    return;
  }
  try {
    scene = new Pair(query, other, [name, hit.shape.name], signal);
  } catch {
    stageAt.replaceChildren(noWebGl());
    return;
  }
  stageAt.replaceChildren(...scene.elements());
  const chosen = place.querySelector("[name=way]:checked")?.value ?? ways[0].name;
  show(ways.find((way) => way.name === chosen));
}

/** Where several descriptors matched endpoints of their own: which of them are shown. */
function chooser(ways, show) {
  return h("fieldset", { class: "segments" }, h("legend", { class: "unseen" }, "Endpoints of"), ways.map((way, i) =>
    h("label", {}, h("input", { type: "radio", name: "way", value: way.name, checked: i === 0, onchange: () => show(way) }), h("span", {}, way.title))));
}

async function drawable(address, signal) {
  const skeleton = await getIfThere(`${address}/skeleton`, signal);
  if (!skeleton) return null;
  const [limbs, mesh] = await Promise.all([getIfThere(`${address}/skeleton?of=extended`, signal), loadDisplay(address, signal)]);
  return { skeletons: { srg: skeleton, extended: limbs }, mesh };
}

/** The number on the hit's card, where it is another than those that the matchings give. */
function ranked(query, hit) {
  if (matchings(query, hit)[0].name === query.descriptor) return null;
  if (!reached(query, hit)) return h("p", { class: "quiet" }, "Re-ranking does not reach it: no chain of shapes that are alike leads here. Such hits come last.");
  const by = `${query.descriptor.replaceAll("_", " ")}${query.rerank ? ", re-ranked by neighbours" : ""}`;
  return h("p", { class: "quiet" }, `Ranked by ${by}: ${distanceWords(query, hit)}.`);
}

function summary(name, other, way, rows, query) {
  const of = (pairs, alone) => `${pairs.length} of ${count(pairs.length + alone.length, ...way.units)}`;
  const most = rows[0];
  const number = `${way.name === "srg" ? "D" : "distance"} = ${digits(way.dissimilarity)}`;
  const told = [way.name === query.descriptor ? `${number}.` : `By ${way.name === "srg" ? "the skeleton" : `${way.units[1]} (${way.name})`} alone, ${number}.`,
    `Matched: ${of(way.pairs, way.unmatched_query)} of ${name}, ${of(way.pairs, way.unmatched_hit)} of ${other}.`];
  if (most && most.share > 0)
    told.push(most.query === null || most.hit === null ? `One without a partner counts most: ${percent(most.share)} of it.`
      : `The pair ${most.query} differs most: ${percent(most.share)} of it.`);
  return told.join(" ");
}

function pairs(rows, way) {
  const dot = (number, colour) => (number === null ? h("span", { class: "quiet" }, "alone") : h("span", { class: `dot ${colour}` }, String(number)));
  const colour = (row) => (row.query === null || row.hit === null ? "alone" : `c${row.query % 10}`);
  return table(`Matched ${way.units[1]}, and what each adds to the distance`, [
    { title: "Query", cell: (row) => dot(row.query, colour(row)) },
    { title: "Hit", cell: (row) => dot(row.hit === null ? null : row.query ?? row.hit, colour(row)) },
    { title: "Φ", number: true, cell: (row) => digits(row.amount, 3) },
    { title: "Share", number: true, cell: (row) => h("span", { class: "share" }, h("meter", { min: 0, max: 1, value: row.share, "aria-hidden": "true" }), percent(row.share)) },
  ], rows, { id: "pairs" });
}

/** Where several descriptors made up the ranking: how much of the similarity is each one's. */
function parts(hit) {
  if (hit.parts.length < 2) return null;
  return table("What each descriptor says, and its share in the ranking", [
    { title: "Descriptor", cell: (part) => part.descriptor.replaceAll("_", " ") },
    { title: "Distance", number: true, cell: (part) => digits(part.dissimilarity, 3) },
    { title: "Share", number: true, cell: (part) => h("span", { class: "share" }, h("meter", { min: 0, max: 1, value: part.share, "aria-hidden": "true" }), percent(part.share)) },
  ], hit.parts);
}

/** Both shapes on one stage, with the marks of the matching that is shown. */
class Pair {
  constructor(query, other, names, signal) {
    Object.assign(this, { query, other, names });
    this.stage = new Stage({ label: `${names[0]} and ${names[1]} side by side in 3D`, describedBy: "pair-summary", panes: 2, signal });
    [this.left, this.right] = [query, other].map(({ mesh }, pane) => this.stage.add(new Surface(mesh), pane));
    this.upright = this.right.frame;
    for (const surface of [this.left, this.right]) surface.glass(true);
  }

  elements() {
    this.stage.host.append(...["left", "right"].map((side, i) => h("p", { class: `pane-name ${side}` }, this.names[i])));
    return [this.stage.host, h("div", { class: "controls" }, h("button", { type: "button", class: "secondary", onclick: () => this.stage.fit() }, "Fit"),
      h("span", { class: "quiet small" }, "Matched ends have the number and colour of the query's; hollow ones have no partner.")), helpText()];
  }

  /** Mark the endpoints of a matching and join those that went together. */
  match(way, rows) {
    const own = ({ skeletons: { srg } }) => srg.endpoints.map((endpoint) => srg.nodes[endpoint.node].position);
    const places = way.positions ?? { query: own(this.query), hit: own(this.other) };
    this.#turnAlike(places, way.pairs);
    for (const [surface, { skeletons }] of [[this.left, this.query], [this.right, this.other]]) {
      const skeleton = skeletons[way.name] ?? null;
      surface.addSkeleton(skeleton ?? skeletons.srg, ink());
      surface.bones.visible = skeleton !== null;
    }
    const marks = [];
    const links = [];
    for (const row of rows) {
      const both = row.query !== null && row.hit !== null;
      const colour = both ? endpointColour(row.query) : ALONE;
      if (row.query !== null) marks.push({ row, pane: 0, point: this.left.at(places.query[row.query]), text: String(row.query), colour, alone: !both });
      if (row.hit !== null) marks.push({ row, pane: 1, point: this.right.at(places.hit[row.hit]), text: String(both ? row.query : row.hit), colour, alone: !both });
      if (both) links.push({ from: marks.length - 2, to: marks.length - 1, colour });
    }
    this.stage.overlay.show(marks, links);
    document.querySelectorAll("#pairs tbody tr").forEach((line, i) => {
      line.addEventListener("pointerenter", () => this.stage.overlay.point(marks.findIndex((mark) => mark.row === rows[i])));
      line.addEventListener("pointerleave", () => this.stage.overlay.point(null));
    });
    this.stage.fit();
  }

  /** Turn the hit so that its matched endpoints lie as the query's do: then both are seen from the same side. */
  #turnAlike(places, matched) {
    if (matched.length < 3) return this.right.place(this.upright);
    const seen = (frame, place) => frame.map((row) => row[0] * place[0] + row[1] * place[1] + row[2] * place[2]);
    const from = matched.map((pair) => seen(this.upright, places.hit[pair.hit]));
    const to = matched.map((pair) => seen(this.left.frame, places.query[pair.query]));
    return this.right.place(after(rotationOnto(from, to), this.upright));
  }
}
