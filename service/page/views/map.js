// A picture of the collection's neighbourhoods: shapes that are alike lie near each other.

import { get, post } from "../parts/api.js";
import { empty, h, notify, svg, table } from "../parts/dom.js";
import { follow } from "../parts/follow.js";
import { thumbnail } from "../parts/pictures.js";
import { go, path, reload } from "../parts/router.js";
import { count, digits, explained, moment, taskWords } from "../parts/words.js";
import { PALETTE } from "../three/colours.js";

const SIDE = 1000;

export async function show(view) {
  const { collection } = view.params;
  const address = path`/v1/collections/${collection}`;
  const map = await get(`${address}/map`, view.signal);
  view.title(`Map of ${collection}`);
  const status = h("p", { class: "quiet", role: "status" });
  view.root.append(h("header", { class: "heading" },
    h("p", { class: "crumbs" }, h("a", { href: path`/collections/${collection}` }, collection), " /"), h("h1", {}, "Map"),
    h("p", { class: "quiet" }, "Shapes that are alike lie near each other. Distances between far groups mean little.")), status);
  if (map.task) watch(view, map.task, status);
  else if (map.state !== "current") make(view, address, status);
  if (map.points.length === 0) {
    if (map.state === "current") view.root.append(empty("Nothing to draw yet", "A map needs at least three shapes that are ready.",
      h("a", { class: "button", href: path`/collections/${collection}` }, "To the shapes")));
    return;
  }
  view.root.append(...drawn(view, map, address));
}

async function make(view, address, status) {
  try {
    const { task } = await post(`${address}/map`, undefined, view.signal);
    if (task) watch(view, task, status);
  } catch (error) {
    if (!view.signal.aborted) notify(explained(error), { bad: true });
  }
}

function watch(view, task, status) {
  const tell = (now) => { status.textContent = `A new map is being drawn: ${taskWords(now)}`; };
  tell(task);
  follow(task.id, tell, view.signal).then((end) => {
    if (end.state === "succeeded") reload();
    else status.textContent = end.error ? explained(end.error) : "Drawing the map was cancelled.";
  }, () => {});
}

function drawn(view, map, address) {
  const labels = [...new Set(map.points.map((point) => point.label))].filter((label) => label !== null).sort();
  const colour = (label) => (label === null ? "#8a929b" : PALETTE[labels.indexOf(label) % PALETTE.length]);
  const card = h("div", { class: "map-card", hidden: true });
  const at = (value, up) => SIDE / 2 + (up ? -value : value) * SIDE * 0.46;
  const look = (point) => {
    card.hidden = false;
    card.replaceChildren(thumbnail(`${address}/shapes/${point.shape}/thumbnail`), h("strong", {}, point.name), h("span", { class: "quiet small" }, point.label ?? "no label"));
  };
  const dots = map.points.map((point) => svg("a", { href: path`/collections/${view.params.collection}/shapes/${point.shape}`, "aria-label": `${point.name}${point.label ? `, ${point.label}` : ""}`,
    onpointerenter: () => look(point), onfocus: () => look(point), onclick: (event) => { event.preventDefault(); go(event.currentTarget.getAttribute("href")); } },
  svg("circle", { cx: at(point.x).toFixed(1), cy: at(point.y, true).toFixed(1), r: 11, fill: colour(point.label) })));
  const chart = svg("svg", { class: "map", viewBox: `0 0 ${SIDE} ${SIDE}`, role: "group", "aria-label": `${count(map.points.length, "shape")} by how alike they are` }, dots);
  const only = (label) => () => map.points.forEach((point, i) => dots[i].classList.toggle("dim", label !== undefined && point.label !== label));
  const key = h("ul", { class: "legend-list" }, labels.map((label, i) => h("li", { onpointerenter: only(label), onpointerleave: only() },
    h("span", { class: `dot small c${i % PALETTE.length}` }), label)));
  return [h("div", { class: "map-place" }, chart, card), key,
    h("p", { class: "quiet small" }, `${count(map.points.length, "shape")}, drawn ${moment(map.made_at)}. Stress ${digits(map.stress, 2)}: how far the picture bends the distances, 0 would be exact.`),
    h("details", {}, h("summary", {}, "As a table"), table("Where each shape lies", [
      { title: "Shape", cell: (point) => h("a", { href: path`/collections/${view.params.collection}/shapes/${point.shape}` }, point.name) },
      { title: "Label", cell: (point) => point.label ?? "" },
      { title: "x", number: true, cell: (point) => digits(point.x, 3) }, { title: "y", number: true, cell: (point) => digits(point.y, 3) },
    ], map.points))];
}
