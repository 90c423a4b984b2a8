// Asking with a mesh that is not kept: it is sent, described in the background, and its task holds the answer.

import { upload } from "./api.js";
import { notify } from "./dom.js";
import { go, path, withQuery } from "./router.js";
import { explained } from "./words.js";

/** How many hits are shown when nobody says otherwise. */
export const HITS = 12;

const files = new Map();

/** The file behind a task, while this page is open: with it the question can be asked anew in other terms. */
export const fileOf = (task) => files.get(task);

/** Send the mesh and go to where its answer will be. terms: k, measure and so on; what is left out has its default. */
export async function askByFile(collection, file, terms = {}, replace = false) {
  const form = new FormData();
  for (const [name, value] of Object.entries({ k: HITS, ...terms })) if (value !== undefined && value !== "") form.append(name, value ?? "null");
  form.append("file", file);
  const close = notify(`Sending ${file.name} …`, { seconds: 600 });
  try {
    const { body } = await upload(path`/v1/collections/${collection}/query?wait=0`, form, () => {});
    const task = body.task.id;
    files.set(task, file);
    close();
    go(withQuery(path`/collections/${collection}/query`, { task, name: file.name }), { replace });
  } catch (error) {
    notify(`${file.name}: ${explained(error)}`, { bad: true });
  } finally {
    close();
  }
}
