// What a question or an evaluation may name, as the API offers it.

import { get } from "./api.js";

let offered = null;

/** { descriptors: [{ name, description, measures, rerank, kept, explained }], descriptor (the default), measureWords, of(name) }. */
export async function choices(signal) {
  offered ??= ask(signal).catch((error) => { offered = null; throw error; });
  return offered;
}

async function ask(signal) {
  const [measures, descriptors] = await Promise.all([get("/v1/measures", signal), get("/v1/descriptors", signal)]);
  return {
    descriptors: descriptors.items,
    descriptor: descriptors.default,
    of: (name) => descriptors.items.find((one) => one.name === name) ?? { name, description: "", measures: [], rerank: false },
    /** Of a measure of D, what it is. */
    measureWords: (name) => measures.items.find((one) => one.name === name)?.description ?? "",
  };
}
