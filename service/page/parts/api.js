// The public HTTP API, and nothing else: every request of the page goes through here.

import { askKey, key } from "./key.js";

/** A refusal: what the service said, and what to do about it. */
export class Refused extends Error {
  constructor(problem) {
    super(problem.detail || problem.title || "The request failed.");
    this.code = problem.code ?? "unknown";
    this.status = problem.status;
    this.details = problem.details ?? {};
    this.problem = problem;
  }
}

/** The service does not answer at all. */
export class Unreachable extends Error {
  constructor() {
    super("The service does not answer. Is it still running, and is this computer connected?");
    this.code = "unreachable";
  }
}

function withKey(headers) {
  const made = new Headers(headers);
  if (key()) made.set("Authorization", `Bearer ${key()}`);
  return made;
}

/** The refusal in a response, whatever its body is. */
async function refusal(response) {
  const problem = await response.json().catch(() => ({}));
  return new Refused({ status: response.status, detail: `The service answered ${response.status}.`, ...problem });
}

/** Send a request, with the key; when the service wants one, ask for it and send again. */
export async function request(path, options = {}) {
  for (;;) {
    let response;
    try {
      response = await fetch(path, { ...options, headers: withKey(options.headers) });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Unreachable();
    }
    if (response.ok) return response;
    const refused = await refusal(response);
    if (response.status !== 401) throw refused;
    await askKey(refused.message);
  }
}

export async function get(path, signal) {
  return (await request(path, { signal })).json();
}

export async function send(method, path, value, signal) {
  const options = { method, signal };
  if (value !== undefined) {
    options.headers = { "Content-Type": "application/json" };
    options.body = JSON.stringify(value);
  }
  const response = await request(path, options);
  return response.status === 204 ? null : response.json();
}

export const post = (path, value, signal) => send("POST", path, value, signal);

export async function bytes(path, signal) {
  return (await request(path, { signal })).arrayBuffer();
}

/** What is not there yet is null; every other refusal is thrown. */
export async function getIfThere(path, signal) {
  try {
    return await get(path, signal);
  } catch (error) {
    if (error.status === 404) return null;
    throw error;
  }
}

/** All items of a list, page after page, at most so many. */
export async function all(path, most = 1000, signal) {
  const items = [];
  let cursor = null;
  do {
    const page = await get(`${path}${path.includes("?") ? "&" : "?"}limit=100${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`, signal);
    items.push(...page.items);
    cursor = page.next;
  } while (cursor && items.length < most);
  return items;
}

/** POST a form and tell how much of it is sent: fetch cannot. Resolves to { status, body }. */
export async function upload(path, form, tell, signal) {
  for (;;) {
    const answer = await sendForm(path, form, tell, signal);
    if (answer.status < 400) return answer;
    const refused = new Refused({ status: answer.status, detail: `The service answered ${answer.status}.`, ...answer.body });
    if (answer.status !== 401) throw refused;
    await askKey(refused.message);
  }
}

function sendForm(path, form, tell, signal) {
  return new Promise((done, failed) => {
    const sender = new XMLHttpRequest();
    sender.open("POST", path);
    if (key()) sender.setRequestHeader("Authorization", `Bearer ${key()}`);
    sender.responseType = "json";
    sender.upload.onprogress = (event) => event.lengthComputable && tell(event.loaded / event.total);
    sender.onload = () => done({ status: sender.status, body: sender.response ?? {} });
    sender.onerror = () => failed(new Unreachable());
    sender.onabort = () => failed(new DOMException("stopped", "AbortError"));
    signal?.addEventListener("abort", () => sender.abort());
    sender.send(form);
  });
}

/** Server-sent events of an address as [name, data] pairs, by fetch: EventSource sends no key. */
export async function* events(path, signal) {
  const response = await request(path, { signal, headers: { Accept: "text/event-stream" } });
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let kept = "";
  try {
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      const parts = (kept + value).split(/\r?\n\r?\n/);
      kept = parts.pop();
      for (const part of parts) {
        const lines = part.split(/\r?\n/);
        const named = lines.find((line) => line.startsWith("event:"));
        const data = lines.filter((line) => line.startsWith("data:")).map((line) => line.slice(5).trimStart()).join("\n");
        if (data) yield [named ? named.slice(6).trim() : "message", JSON.parse(data)];
      }
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

/** Save what an address gives as a file. With a key it must be fetched first: a link cannot send one. */
export async function download(path, name) {
  let href = path;
  if (key()) href = URL.createObjectURL(await (await request(path)).blob());
  const link = document.createElement("a");
  link.href = href;
  link.download = name;
  link.click();
  if (href !== path) setTimeout(() => URL.revokeObjectURL(href), 60_000);
}
