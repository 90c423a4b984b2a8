// What a question or an evaluation may name, as the API offers it.

import { get, getIfThere } from "./api.js";

let offered = null;

/** { descriptors, descriptor (the default), measures, measuresOf(descriptor), rerank }. */
export async function choices(signal) {
  offered ??= ask(signal).catch((error) => { offered = null; throw error; });
  return offered;
}

async function ask(signal) {
  const [measures, descriptors] = await Promise.all([get("/v1/measures", signal), getIfThere("/v1/descriptors", signal)]);
  const items = descriptors?.items ?? [{ name: "srg", description: "" }];
  return {
    descriptors: items,
    descriptor: descriptors?.default ?? "srg",
    measures: measures.items,
    measuresOf(name) {
      const allowed = items.find((one) => one.name === name)?.measures;
      return allowed ? measures.items.filter((one) => allowed.includes(one.name)) : name === "srg" ? measures.items : [];
    },
    rerank: Boolean(descriptors?.rerank),
  };
}
