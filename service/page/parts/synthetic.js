// The synthetic set by one click: ten classes of shapes made by the service itself.

import { post } from "./api.js";
import { notify } from "./dom.js";
import { go, path } from "./router.js";
import { ensureCollection } from "./uploads.js";
import { explained } from "./words.js";

const PER_CLASS = 5;

export const SAMPLES = `${10 * PER_CLASS} sample shapes`;

/** Fill a collection of its own, and go there. */
export async function loadSynthetic() {
  try {
    const collection = await ensureCollection("synthetic");
    await post(path`/v1/collections/${collection}/synthetic`, { per_class: PER_CLASS, seed: 0 });
    await go(path`/collections/${collection}`);
  } catch (error) {
    notify(explained(error), { bad: true });
  }
}
