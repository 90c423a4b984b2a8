// What a question or an evaluation may name, as the API offers it.

import { get } from "./api.js";
import { path } from "./router.js";

let offered = null;

/** { descriptors: [{ name, description, measures, rerank, kept, parts, explained }], descriptor (the default), measureWords, of(name) }. */
export async function choices(signal) {
  offered ??= ask(signal).catch((error) => { offered = null; throw error; });
  return offered;
}

async function ask(signal) {
  const [measures, descriptors] = await Promise.all([get("/v1/measures", signal), get("/v1/descriptors", signal)]);
  return {
    descriptors: descriptors.items,
    descriptor: descriptors.default,
    of: (name) => descriptors.items.find((one) => one.name === name) ?? { name, description: "", measures: [], rerank: false, parts: [name] },
    /** Of a measure of D, what it is. */
    measureWords: (name) => measures.items.find((one) => one.name === name)?.description ?? "",
  };
}

/** What can rank a collection: what the service keeps, what its shapes were given on demand, and what is chosen. */
export async function rankable(collection, chosen, signal) {
  const [offered, { items }] = await Promise.all([choices(signal), get(path`/v1/collections/${collection}/descriptors`, signal)]);
  const given = new Set(items.filter((one) => one.shapes > 0).map((one) => one.name));
  return offered.descriptors.filter((one) => one.kept || one.name === chosen || one.parts.every((part) => given.has(part)));
}
