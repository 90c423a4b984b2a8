// A picture of the collection's neighbourhoods: shapes that are alike lie near each other.

import { get, post } from "../parts/api.js";
import { rankable } from "../parts/choices.js";
import { empty, field, h, select, svg, table } from "../parts/dom.js";
import { ended, follow } from "../parts/follow.js";
import { thumbnail } from "../parts/pictures.js";
import { go, path, reload, withQuery } from "../parts/router.js";
import { count, digits, explained, moment, percent, taskWords } from "../parts/words.js";
import { PALETTE } from "../three/colours.js";

const FORMS = ["M-9 0a9 9 0 1 0 18 0a9 9 0 1 0-18 0z", "M-8-8h16v16h-16z", "M0-11l11 11l-11 11l-11-11z", "M0-10l10 18h-20z"];
const [SIDE, EDGE, LEAST, FLATTEST] = [1000, 40, 300, 0.8];

export async function show(view) {
  const { collection } = view.params;
  const address = path`/v1/collections/${collection}`;
  const map = await get(withQuery(`${address}/map`, { descriptor: view.query.descriptor }), view.signal);
  const offered = await rankable(collection, map.descriptor, view.signal);
  view.title(`Map of ${collection}`);
  const status = h("p", { class: "quiet", role: "status" });
  const state = h("div", { class: "bar" }, status);
  const by = select(offered.map((one) => [one.name, one.name.replaceAll("_", " ")]), map.descriptor,
    { onchange: () => go(withQuery(location.pathname, { descriptor: by.value }), { replace: true }) });
  view.root.append(h("header", { class: "heading" },
    h("p", { class: "crumbs" }, h("a", { href: path`/collections/${collection}` }, collection)),
    h("div", { class: "spread" }, h("h1", {}, "Map"), field("Alike by", by)),
    h("p", { class: "quiet" }, "Shapes that are alike lie near each other. Distances between far groups mean little.")), state);
  if (map.state !== "current") renew(view, address, map, status, state);
  if (map.points.length > 0) view.root.append(...drawn(view, map, address));
  else if (map.state === "current")
    view.root.append(empty("Nothing to draw yet", "A map shows the shapes that are ready; there is none.", h("a", { class: "button", href: path`/collections/${collection}` }, "To the shapes")));
}

/**
 * The first map is drawn unasked, any other on demand: shapes that arrive outdate each as soon as it is there, and the
 * worker would draw for ever.
 */
function renew(view, address, map, status, state) {
  const underway = map.task && !ended(map.task);
  if (underway || (map.state === "none" && !map.task)) {
    make(view, address, map, status, underway);
    return;
  }
  status.textContent = map.task ? outcome(map.task) : "Shapes came or went since this was drawn.";
  const again = h("button", { type: "button", class: "secondary", onclick: () => { again.remove(); make(view, address, map, status); } },
    map.state === "none" ? "Draw it" : "Draw anew");
  state.append(again);
}

const outcome = (task) => (task.error ? explained(task.error) : "Drawing the map was cancelled.");

/** Have it drawn, or wait for the task that draws it, and show it. */
async function make(view, address, map, status, underway) {
  const tell = (now) => { status.textContent = `A map is being drawn: ${taskWords(now)}`; };
  try {
    const task = underway || await post(`${address}/map`, { descriptor: map.descriptor }, view.signal);
    const end = await follow(task.id, tell, view.signal);
    if (end.state === "succeeded") reload();
    else status.textContent = outcome(end);
  } catch (error) {
    if (view.signal.aborted) return;
    status.textContent = error.code === "forbidden_scope"
      ? `${map.state === "none" ? "No map was drawn yet" : "This map is not of today's shapes"}, and the API key of this tab may read only. Whoever may write can have one drawn here.`
      : explained(error);
  }
}

/** Where values begin, and how far they reach. */
function range(values) {
  const least = Math.min(...values);
  return [least, Math.max(...values) - least || 1];
}

/** Of the label at a place in their list: labels that share a colour differ in form; without a label it is hollow. */
function mark(place, x, y) {
  const at = `translate(${x.toFixed(1)} ${y.toFixed(1)})`;
  const form = FORMS[Math.floor(Math.max(place, 0) / PALETTE.length) % FORMS.length];
  return svg("path", { d: form, transform: at, class: place < 0 ? "hollow" : null, fill: place < 0 ? "none" : PALETTE[place % PALETTE.length] });
}

function drawn(view, map, address) {
  const labels = [...new Set(map.points.map((point) => point.label))].filter((label) => label !== null).sort();
  const card = h("div", { class: "map-card", hidden: true });
  const [left, wide] = range(map.points.map((point) => point.x));
  const [low, high] = range(map.points.map((point) => point.y));
  const scale = (SIDE - 2 * EDGE) / Math.max(wide, high / FLATTEST);
  const height = Math.max(LEAST, high * scale + 2 * EDGE);
  const across = (x) => SIDE / 2 + (x - left - wide / 2) * scale;
  const down = (y) => height / 2 - (y - low - high / 2) * scale;
  const look = (point) => {
    card.hidden = false;
    card.replaceChildren(thumbnail(`${address}/shapes/${point.shape}/thumbnail`), h("strong", {}, point.name), h("span", { class: "quiet small" }, point.label ?? "no label"));
  };
  const dots = map.points.map((point) => svg("a", { href: path`/collections/${view.params.collection}/shapes/${point.shape}`, "aria-label": `${point.name}${point.label ? `, ${point.label}` : ""}`,
    onpointerenter: () => look(point), onfocus: () => look(point), onclick: (event) => { event.preventDefault(); go(event.currentTarget.getAttribute("href")); } },
  mark(labels.indexOf(point.label), across(point.x), down(point.y))));
  const chart = svg("svg", { class: "map", viewBox: `0 0 ${SIDE} ${height.toFixed(0)}`, role: "group", "aria-label": `${count(map.points.length, "shape")} by how alike they are` }, dots);
  const only = (label) => () => map.points.forEach((point, i) => dots[i].classList.toggle("dim", label !== undefined && point.label !== label));
  const named = map.points.some((point) => point.label === null) ? [...labels, null] : labels;
  const key = h("ul", { class: "legend-list" }, named.map((label) => h("li", { onpointerenter: only(label), onpointerleave: only() },
    svg("svg", { class: "map-key", viewBox: "-11 -11 22 22", "aria-hidden": "true" }, [mark(labels.indexOf(label), 0, 0)]), label ?? "no label")));
  return [h("div", { class: "map-place" }, chart, card), key,
    h("p", { class: "quiet small" }, `${count(map.points.length, "shape")}, drawn ${moment(map.made_at)}. `
      + (map.neighbours_kept === null ? "" : `Of the ten shapes most like each, ${percent(map.neighbours_kept)} are among the ten nearest here. `)
      + (map.left_out > 0 ? `${count(map.left_out, "shape")} left out.` : "")),
    h("details", {}, h("summary", {}, "As a table"), table("Where each shape lies", [
      { title: "Shape", cell: (point) => h("a", { href: path`/collections/${view.params.collection}/shapes/${point.shape}` }, point.name) },
      { title: "Label", cell: (point) => point.label ?? "" },
      { title: "x", number: true, cell: (point) => digits(point.x, 3) }, { title: "y", number: true, cell: (point) => digits(point.y, 3) },
    ], map.points))];
}
