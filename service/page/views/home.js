// The first view: the collections, and where to begin when there is none.

import { all, get } from "../parts/api.js";
import { field, h, notify } from "../parts/dom.js";
import { keep, picker } from "../parts/drop.js";
import { loadSynthetic, SAMPLES } from "../parts/synthetic.js";
import { go, path, withQuery } from "../parts/router.js";
import { ensureCollection } from "../parts/uploads.js";
import { count, explained, size } from "../parts/words.js";
import { thumbnail } from "../parts/pictures.js";

export async function show(view) {
  const [collections, formats, limits] = await Promise.all([
    all("/v1/collections", 500, view.signal), get("/v1/formats", view.signal), get("/v1/limits", view.signal),
  ]);
  view.title("Shapes");
  view.root.append(
    h("section", { class: "hero" },
      h("div", {}, h("h1", {}, "Which shapes are like this one, and why?"),
        h("p", { class: "lead quiet" }, "Each mesh is cleaned, smoothed and reduced to its skeleton. Then Reebase finds the shapes whose ends ",
          "lie alike, however they are bent, and shows which end was matched with which.")),
      h("div", { class: "here" }, h("img", { src: "/page/icon.svg", alt: "", width: 44, height: 44 }),
        h("strong", {}, "Drop meshes anywhere on this page"),
        h("div", { class: "bar" }, picker("Add meshes", (files) => keep(files)),
          h("button", { type: "button", class: collections.some((one) => one.counts.shapes > 0) ? "plain" : "secondary", onclick: loadSynthetic }, `Try ${SAMPLES}`)),
        h("p", { class: "quiet small" }, `${formats.items.map((one) => one.name.toUpperCase()).join(", ")}; up to `,
          `${size(limits.max_upload_bytes)} and ${limits.max_vertices.toLocaleString("en")} vertices each.`))),
    ...(collections.length > 0 ? [h("section", {}, h("h2", {}, "Collections"), h("ul", { class: "cards wide" }, collections.map(card)), creation())] : []));
  await Promise.all(collections.map((one) => decorate(one, view)));
}

function card(one) {
  const { shapes, states } = one.counts;
  const busy = (states.queued ?? 0) + (states.running ?? 0);
  return h("li", {}, h("a", { class: "card", href: path`/collections/${one.name}`, "data-collection": one.name },
    h("span", { class: "strip", "aria-hidden": "true" }),
    h("strong", {}, one.name),
    h("span", { class: "quiet small" }, [one.description, shapes === 0 ? "empty" : count(shapes, "shape"),
      busy > 0 && `${busy} on the way`, states.failed && `${states.failed} failed`].filter(Boolean).join(" · "))));
}

/** A few of its shapes on the card of a collection, of different labels where it has labels. */
async function decorate(one, view) {
  if (one.counts.shapes === 0) return;
  const address = path`/v1/collections/${one.name}/shapes`;
  const labels = (await get(path`/v1/collections/${one.name}/labels`, view.signal)).items.filter(({ label }) => label !== null).slice(0, 4);
  const asked = labels.length > 1 ? labels.map(({ label }) => ({ label, limit: 1 })) : [{ limit: 4 }];
  const found = await Promise.all(asked.map((filter) => get(withQuery(address, { state: "indexed", ...filter }), view.signal)));
  view.root.querySelector(`[data-collection="${CSS.escape(one.name)}"] .strip`)
    ?.append(...found.flatMap(({ items }) => items).map((shape) => thumbnail(shape.thumbnail)));
}

function creation() {
  const name = h("input", { required: true, maxlength: 63, pattern: "[a-z0-9][a-z0-9._\\-]{0,62}", placeholder: "animals", autocomplete: "off",
    title: "Lower-case letters, digits, dots, dashes and underscores" });
  return h("details", { class: "new" }, h("summary", {}, "New collection"),
    h("form", { class: "bar end", onsubmit: async (event) => {
      event.preventDefault();
      try {
        await ensureCollection(name.value);
        go(path`/collections/${name.value}`);
      } catch (error) {
        notify(explained(error), { bad: true });
      }
    } }, field("Name", name), h("button", {}, "Create")));
}
