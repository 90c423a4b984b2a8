// The plain page: everything that it does goes through the public HTTP API.

const at = (id) => document.getElementById(id);
let next = null;

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function say(text) {
  at("message").textContent = text;
  at("message").hidden = !text;
}

class Refused extends Error {
  constructor(problem) {
    super(problem.detail || problem.title || "The request failed.");
    this.problem = problem;
  }
}

async function call(path, options = {}) {
  const headers = new Headers(options.headers);
  const key = sessionStorage.getItem("key");
  if (key) headers.set("Authorization", `Bearer ${key}`);
  const answer = await fetch(path, { ...options, headers });
  const body = answer.status === 204 ? null : await answer.json();
  if (answer.ok) return body;
  if (answer.status === 401) {
    at("key-form").hidden = false;
    at("key").focus();
  }
  throw new Refused(body);
}

const send = (path, value) =>
  call(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(value) });

const here = () => `/v1/collections/${encodeURIComponent(at("collection").value)}`;

function on(id, event, action) {
  at(id).addEventListener(event, async (happening) => {
    happening.preventDefault();
    say("");
    const button = at(id).querySelector?.("button:not([type=button])") ?? at(id);
    button.disabled = true;
    try {
      await action();
    } catch (error) {
      say(error.message);
    } finally {
      button.disabled = false;
    }
  });
}

async function showCollections(chosen) {
  const items = [];
  let cursor = "";
  do {
    const page = await call(`/v1/collections?limit=100${cursor && `&cursor=${encodeURIComponent(cursor)}`}`);
    items.push(...page.items);
    cursor = page.next;
  } while (cursor);
  const keep = chosen ?? at("collection").value;
  at("collection").replaceChildren(...items.map((one) => element("option", { value: one.name }, one.name)));
  if (items.some((one) => one.name === keep)) at("collection").value = keep;
  for (const id of ["upload", "search"]) at(id).querySelector("button").disabled = items.length === 0;
  if (items.length === 0) {
    at("counts").textContent = "There is no collection yet: create one.";
    at("shapes").replaceChildren();
    return;
  }
  await showShapes();
}

async function showCounts() {
  const { counts } = await call(here());
  const states = Object.entries(counts.states).map(([state, count]) => `${count} ${state}`);
  at("counts").textContent = states.length ? states.join(", ") : "no shapes yet";
}

async function showShapes() {
  at("shapes").replaceChildren();
  next = null;
  await Promise.all([showCounts(), moreShapes()]);
}

async function moreShapes() {
  const page = await call(`${here()}/shapes?limit=50${next ? `&cursor=${encodeURIComponent(next)}` : ""}`);
  at("shapes").append(...page.items.map(row));
  next = page.next;
  at("more").hidden = !next;
}

function row(shape) {
  const actions = element("td");
  const act = (text, action) => {
    const button = element("button", { type: "button", className: "plain" }, text);
    button.setAttribute("aria-label", `${text}: ${shape.name}`);
    button.addEventListener("click", () => action().catch((error) => say(error.message)));
    actions.append(button);
  };
  if (shape.state === "indexed") act("Find similar", () => ask({ shape: shape.id, ...choices() }));
  act("Delete", async () => {
    await call(`${here()}/shapes/${shape.id}`, { method: "DELETE" });
    await showShapes();
  });
  return element("tr", {},
    element("td", {}, shape.name), element("td", {}, shape.label ?? ""),
    element("td", { className: shape.error ? "bad" : "" },
      shape.error ? `failed: ${shape.error.detail}` : shape.state),
    element("td", { className: "number" }, String(shape.endpoint_count ?? "")), actions);
}

function choices() {
  const tolerance = at("tolerance").value;
  return { measure: at("measure").value, k: Number(at("k").value), tolerance: tolerance === "" ? null : Number(tolerance) };
}

async function ask(query) {
  show(await send(`${here()}/query`, query));
}

function show(answer) {
  const body = element("tbody");
  for (const hit of answer.hits) {
    const pairs = element("ul", {}, ...hit.pairs.map((pair) =>
      element("li", {}, `endpoint ${pair.query} with ${pair.hit}: Φ = ${pair.distance.toFixed(4)}`)));
    for (const left of hit.unmatched_query)
      pairs.append(element("li", {}, `endpoint ${left.endpoint} of the query unmatched: ${left.charge.toFixed(4)}`));
    for (const left of hit.unmatched_hit)
      pairs.append(element("li", {}, `endpoint ${left.endpoint} of the hit unmatched: ${left.charge.toFixed(4)}`));
    body.append(element("tr", {},
      element("td", { className: "number" }, String(hit.rank)), element("td", {}, hit.shape.name),
      element("td", {}, hit.shape.label ?? ""),
      element("td", { className: "number" }, hit.dissimilarity.toFixed(5)),
      element("td", { className: "number" }, String(hit.endpoint_count)),
      element("td", {}, element("details", {}, element("summary", {}, `${hit.pairs.length} matched`), pairs))));
  }
  const head = element("tr", {}, ...["Rank", "Name", "Label", "D", "Endpoints", "Why"].map((text) =>
    element("th", { scope: "col", className: ["Rank", "D", "Endpoints"].includes(text) ? "number" : "" }, text)));
  const caption = `${answer.hits.length} of ${answer.considered} shapes compared by ${answer.query.measure}; ` +
    `the query has ${answer.query.endpoint_count} endpoints; ${answer.took_ms.toFixed(1)} ms`;
  at("answer").replaceChildren(element("div", { className: "scroll" },
    element("table", {}, element("caption", {}, caption), element("thead", {}, head), body)));
  at("answer").focus();
}

const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

async function follow(id, tell) {
  for (;;) {
    const task = await call(`/v1/tasks/${id}?wait=10`);
    tell(task);
    if (["succeeded", "failed", "cancelled"].includes(task.state)) return task;
    await pause(200);
  }
}

async function upload(file) {
  const line = element("li", {}, `${file.name}: sending`);
  at("tasks").prepend(line);
  const form = new FormData();
  if (at("label").value) form.append("label", at("label").value);
  form.append("file", file);
  try {
    const { shape, task } = await call(`${here()}/shapes`, { method: "POST", body: form });
    if (!task || shape.state === "indexed") {
      line.textContent = `${file.name}: was there already`;
      return;
    }
    const end = await follow(task.id, ({ state, stage, fraction }) => {
      line.textContent = `${file.name}: ${state}${stage ? `, ${stage} ${Math.round(fraction * 100)} %` : ""}`;
    });
    line.className = end.state === "succeeded" ? "good" : "bad";
    if (end.error) line.textContent = `${file.name}: ${end.error.detail}`;
  } catch (error) {
    line.className = "bad";
    line.textContent = `${file.name}: ${error.message}`;
  }
}

on("new-collection", "submit", async () => {
  const made = await send("/v1/collections", { name: at("collection-name").value });
  at("new-collection").reset();
  await showCollections(made.name);
});

on("upload", "submit", async () => {
  const files = [...at("files").files];
  // Two at a time: the worker sets the pace, and the page stays light.
  const lane = async () => { while (files.length) await upload(files.shift()); };
  await Promise.all([lane(), lane()]);
  await showShapes();
});

on("search", "submit", async () => {
  const form = new FormData();
  for (const [name, value] of Object.entries(choices())) form.append(name, value === null ? "null" : String(value));
  form.append("file", at("query-file").files[0]);
  const answer = await call(`${here()}/query?wait=30`, { method: "POST", body: form });
  if (answer.hits) return show(answer);
  at("answer").textContent = "Still working …";
  const task = await follow(answer.task.id, ({ state, stage }) => { at("answer").textContent = `${state} ${stage ?? ""}`; });
  if (task.result) show(task.result);
  else throw new Error(task.error?.detail ?? `The task was ${task.state}.`);
});

on("collection", "change", showShapes);
on("more", "click", moreShapes);
on("key-form", "submit", async () => {
  sessionStorage.setItem("key", at("key").value.trim());
  at("key-form").reset();
  at("key-form").hidden = true;
  await start();
});

async function start() {
  const [formats, measures, limits] = await Promise.all(["/v1/formats", "/v1/measures", "/v1/limits"].map((path) => call(path)));
  at("formats").textContent = `Formats: ${formats.items.map((one) => one.name).join(", ")}. ` +
    `At most ${Math.round(limits.max_upload_bytes / 2 ** 20)} MiB and ${limits.max_vertices.toLocaleString()} vertices.`;
  at("measure").replaceChildren(...measures.items.map((one) => element("option", { value: one.name }, one.name)));
  at("measure").value = measures.default;
  at("k").max = limits.max_k;
  await showCollections();
}

start().catch((error) => say(error.message));
