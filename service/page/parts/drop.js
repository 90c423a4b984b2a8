// Files dropped anywhere on the page: keep them in the collection, or only ask what is like one of them.

import { get } from "./api.js";
import { h, notify } from "./dom.js";
import { askByFile } from "./asking.js";
import { go, path } from "./router.js";
import { addFiles, ensureCollection } from "./uploads.js";
import { explained } from "./words.js";

export const FIRST = "shapes";

/** The collection that the page is in, or the first one, or null. */
async function present() {
  const found = /^\/collections\/([^/]+)/.exec(location.pathname);
  if (found) return decodeURIComponent(found[1]);
  const { items } = await get("/v1/collections?limit=1");
  return items[0]?.name ?? null;
}

const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");

/** Keep files; where the page is in no collection, in the first or a new one. */
export async function keep(files, collection, label) {
  try {
    const into = collection ?? (await present()) ?? (await ensureCollection(FIRST));
    addFiles(into, files, label);
    const address = path`/collections/${into}`;
    if (!location.pathname.startsWith(address)) go(address);
  } catch (error) {
    notify(explained(error), { bad: true });
  }
}

/** A button that picks files, and what is done with them. */
export function picker(text, onfiles, { multiple = true, plain = false, id } = {}) {
  const input = h("input", { type: "file", multiple, hidden: true, id, tabindex: "-1", "aria-label": text,
    onchange: () => { const files = [...input.files]; input.value = ""; if (files.length) onfiles(files); } });
  return h("span", { class: "picker" }, input,
    h("button", { type: "button", class: plain ? "secondary" : null, onclick: () => input.click() }, text));
}

/** Show two places to drop on whenever files are dragged over the window. */
export function welcomeFiles() {
  let shown = null;
  const hide = () => { shown?.remove(); shown = null; };
  addEventListener("dragenter", (event) => {
    if (!hasFiles(event) || shown) return;
    shown = targets(hide);
    document.body.append(shown);
  });
  addEventListener("dragover", (event) => { if (hasFiles(event)) event.preventDefault(); });
  addEventListener("dragleave", (event) => { if (!event.relatedTarget) hide(); });
  addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    const files = [...event.dataTransfer.files];
    const ask = event.target.closest?.("[data-ask]");
    hide();
    if (files.length === 0) return;
    if (ask) askWith(files[0]);
    else keep(files);
  });
}

export async function askWith(file) {
  const collection = await present().catch(() => null);
  if (!collection) notify("There is nothing to compare with yet: add shapes first.", { bad: true });
  else askByFile(collection, file);
}

function targets(hide) {
  return h("div", { class: "drop", onclick: hide },
    h("div", { class: "target" }, h("strong", {}, "Add"), h("span", {}, "keep these shapes in the collection")),
    h("div", { class: "target", "data-ask": true }, h("strong", {}, "Find similar"), h("span", {}, "ask with one mesh, which is not kept")));
}
