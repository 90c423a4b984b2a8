// What a task does, as it does it: live by server-sent events, by asking where these do not come.

import { events, get } from "./api.js";

const ENDED = new Set(["succeeded", "failed", "cancelled"]);
const ASK_AFTER = 400;

export const ended = (task) => ENDED.has(task.state);

const pause = (milliseconds, signal) => new Promise((done, stopped) => {
  const timer = setTimeout(done, milliseconds);
  signal?.addEventListener("abort", () => { clearTimeout(timer); stopped(new DOMException("left", "AbortError")); });
});

/** Tell each new state of the task; resolves to the task once it has ended. */
export async function follow(id, tell, signal) {
  const address = `/v1/tasks/${encodeURIComponent(id)}`;
  const own = new AbortController();
  signal?.addEventListener("abort", () => own.abort());
  try {
    for await (const task of states(id, own.signal)) {
      tell(task);
      if (ended(task)) break;
    }
  } catch (error) {
    if (signal?.aborted) throw error;
  } finally {
    own.abort();
  }
  for (;;) {
    const task = await get(address, signal);
    tell(task);
    if (ended(task)) return task;
    await pause(ASK_AFTER, signal);
  }
}

async function* states(id, signal) {
  for await (const [name, data] of events(`/v1/events?task=${encodeURIComponent(id)}`, signal)) {
    if (name === "snapshot") {
      const known = data.tasks.filter((task) => task.id === id);
      if (known.length === 0) return; // it waits behind many others, or has ended: ask
      yield* known;
    }
    if (name === "task" && data.id === id) yield data;
    if (name === "bye" || name === "reset") return;
  }
}
