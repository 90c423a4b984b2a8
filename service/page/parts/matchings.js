// By which endpoints a hit can be explained: those of the skeleton, and those of each descriptor that has its own.

const WORDS = { extended: { title: "Limbs", units: ["limb", "limbs"] } };

/**
 * [{ name, title, units: [one, many], dissimilarity, pairs, unmatched_query, unmatched_hit, note, positions: { query, hit } }], what ranked first.
 * positions are null for the skeleton's endpoints, which the skeleton itself places.
 */
export function matchings(query, hit) {
  const graph = { name: "srg", title: "Skeleton", units: ["endpoint", "endpoints"], dissimilarity: hit.graph_dissimilarity, pairs: hit.pairs,
    unmatched_query: hit.unmatched_query, unmatched_hit: hit.unmatched_hit, note: hit.note, positions: null };
  const others = hit.parts.filter((part) => part.matched?.positions && query.positions[part.descriptor]).map((part) => ({
    name: part.descriptor, ...(WORDS[part.descriptor] ?? { title: part.descriptor.replaceAll("_", " "), units: ["endpoint", "endpoints"] }), dissimilarity: part.dissimilarity, ...part.matched,
    positions: { query: query.positions[part.descriptor], hit: part.matched.positions },
  }));
  return query.descriptor === "srg" ? [graph, ...others] : [...others, graph];
}
