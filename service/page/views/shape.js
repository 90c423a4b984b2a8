// One shape: in 3D with its skeleton and scalars, and what was learnt of it in words and numbers.

import { download, get, post, send } from "../parts/api.js";
import { empty, field, h, notify, table } from "../parts/dom.js";
import { follow } from "../parts/follow.js";
import { thumbnail } from "../parts/pictures.js";
import { go, path, reload, withQuery } from "../parts/router.js";
import { healthWords, summaryOf } from "../parts/report.js";
import { count, digits, explained, flagWords, seconds, size, stateWords, taskWords } from "../parts/words.js";

export async function show(view) {
  const { collection, shape: id } = view.params;
  const address = path`/v1/collections/${collection}/shapes/${id}`;
  const shape = await get(address, view.signal);
  view.title(shape.name);
  view.root.append(heading(collection, shape, address));
  if (shape.state === "indexed") return showIndexed(view, address, shape);
  view.root.append(shape.state === "failed" || shape.state === "cancelled" ? stopped(shape, address) : await underway(view, shape));
}

function heading(collection, shape, address) {
  return h("header", { class: "heading" },
    h("p", { class: "crumbs" }, h("a", { href: path`/collections/${collection}` }, collection)),
    h("div", { class: "spread" }, h("h1", {}, shape.name, shape.label && h("span", { class: "chip" }, shape.label)),
      h("div", { class: "bar" },
        shape.state === "indexed" && h("a", { class: "button", href: withQuery(path`/collections/${collection}/query`, { shape: shape.id }) }, "Find similar"),
        h("button", { type: "button", class: "secondary", onclick: () => remove(collection, shape, address) }, "Delete"))));
}

async function remove(collection, shape, address) {
  try {
    await send("DELETE", address);
    await go(path`/collections/${collection}`);
    notify(`${shape.name} is deleted.`, { action: "Undo", onaction: async () => {
      try {
        await post(`${address}/restore`);
        go(path`/collections/${collection}/shapes/${shape.id}`);
      } catch (error) {
        notify(explained(error), { bad: true });
      }
    } });
  } catch (error) {
    notify(explained(error), { bad: true });
  }
}

function stopped(shape, address) {
  const again = async () => {
    try {
      await post(path`/v1/tasks/${shape.task}/retry`);
      reload();
    } catch (error) {
      notify(explained(error), { bad: true });
    }
  };
  return empty(shape.state === "failed" ? "This mesh could not be described" : "This was cancelled",
    shape.error ? explained(shape.error) : "It is stored, but not compared with others.",
    h("button", { type: "button", onclick: again }, "Try again"),
    h("button", { type: "button", class: "secondary", onclick: () => download(`${address}/original`, shape.filename ?? shape.name) }, "Download the original"));
}

async function underway(view, shape) {
  const bar = h("progress", { max: 1, value: 0, "aria-label": "Progress" });
  const text = h("p", { class: "quiet", role: "status" }, stateWords(shape.state));
  follow(shape.task, (task) => { bar.value = task.progress.fraction; text.textContent = taskWords(task); }, view.signal)
    .then(reload, () => {});
  return h("section", { class: "empty" }, h("h2", {}, "This shape is being described"), bar, text);
}

async function showIndexed(view, address, shape) {
  const [skeleton, health] = await Promise.all([get(`${address}/skeleton`, view.signal), get(`${address}/health`, view.signal)]);
  const place = h("div", { class: "look" }, h("div", { class: "stage waiting" }, thumbnail(`${address}/thumbnail`)));
  view.root.append(h("div", { class: "halves" }, place, h("div", { class: "facts" },
    facts(shape, skeleton, health), endpoints(skeleton), report(health), downloads(shape, address, skeleton), naming(shape, address))));
  const { showShape } = await import("./shape3d.js");
  if (!view.signal.aborted) await showShape(view, place, { address, shape, skeleton, health });
}

function facts(shape, skeleton, health) {
  const [, second, third] = skeleton.eigenvalues;
  const { report } = health;
  const rows = [
    ["Endpoints", String(skeleton.endpoints.length)],
    ["λ₂", digits(second), "of the Laplace–Beltrami operator at unit area"],
    ["λ₃ / λ₂", third ? digits(third / second) : "–", "near 1, the shape is nearly symmetric and its skeleton less steady"],
    ["Mesh", `${count(report.vertices, "vertex", "vertices")}, ${count(report.faces, "face")}`],
    ["Genus", report.genus === null ? "not defined" : String(report.genus)],
    ["File", `${shape.format.toUpperCase()}, ${size(shape.bytes)}`],
  ];
  return h("section", { "aria-labelledby": "facts" }, h("h2", { id: "facts" }, "Facts"),
    h("p", { id: "summary", class: "quiet" }, summaryOf(shape, skeleton, report)),
    h("dl", { class: "facts-list" }, rows.map(([name, value, note]) => h("div", {}, h("dt", { title: note }, name), h("dd", {}, value)))));
}

function endpoints(skeleton) {
  if (skeleton.endpoints.length === 0) return null;
  const columns = [
    { title: "Endpoint", cell: ({ i }) => h("span", { class: `dot c${i % 10}` }, String(i)) },
    { title: "area a", number: true, cell: ({ omega }) => digits(omega?.[0]) },
    { title: "paths dv", number: true, cell: ({ omega }) => digits(omega?.[1]) },
    { title: "to root dc", number: true, cell: ({ omega }) => digits(omega?.[2]) },
  ];
  return h("section", {}, h("h2", {}, "Endpoints"), table("ω of each endpoint of the skeleton: what is compared", columns,
    skeleton.endpoints.map((endpoint, i) => ({ i, ...endpoint })), { id: "endpoints" }));
}

function report({ report, seconds: stages }) {
  const total = Object.values(stages).reduce((sum, one) => sum + one, 0);
  return h("section", {}, h("h2", {}, "Health"),
    h("ul", { class: "plainlist" }, healthWords(report).map((text) => h("li", {}, text))),
    report.flags.map((flag) => h("p", { class: "flag" }, h("strong", {}, `${flagWords(flag)}. `), report.explanations[flag])),
    h("details", {}, h("summary", {}, `Described in ${seconds(total)}`),
      h("dl", { class: "facts-list" }, Object.entries(stages).map(([stage, took]) =>
        h("div", {}, h("dt", {}, stage), h("dd", {}, seconds(took)))))));
}

function downloads(shape, address, skeleton) {
  const save = (text, from, name) => h("button", { type: "button", class: "secondary", onclick: () =>
    download(from, name).catch((error) => notify(explained(error), { bad: true })) }, text);
  const stem = shape.name.replace(/\.\w+$/, "");
  return h("section", {}, h("h2", {}, "Download"), h("div", { class: "bar" },
    save("Original", `${address}/original`, shape.filename ?? shape.name),
    save("Cleaned", `${address}/mesh?stage=cleaned&format=ply`, `${stem}-cleaned.ply`),
    save("Smoothed", `${address}/mesh?stage=denoised&format=ply`, `${stem}-denoised.ply`),
    h("button", { type: "button", class: "secondary", onclick: () => saveJson(skeleton, `${stem}-skeleton.json`) }, "Skeleton")));
}

function saveJson(value, name) {
  const link = h("a", { href: `data:application/json,${encodeURIComponent(JSON.stringify(value))}`, download: name });
  link.click();
}

function naming(shape, address) {
  const name = h("input", { value: shape.name, required: true, maxlength: 200 });
  const label = h("input", { value: shape.label ?? "", maxlength: 200, placeholder: "none" });
  return h("details", {}, h("summary", {}, "Rename or label"),
    h("form", { class: "bar end", onsubmit: async (event) => {
      event.preventDefault();
      try {
        await send("PATCH", address, { name: name.value, label: label.value.trim() || null });
        reload();
      } catch (error) {
        notify(explained(error), { bad: true });
      }
    } }, field("Name", name), field("Label", label), h("button", {}, "Save")));
}

