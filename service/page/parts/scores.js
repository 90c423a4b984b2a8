// Scores of retrieval by name: what they are called, and what they mean.

import { digits } from "./words.js";

export const SCORES = {
  nn: ["Nearest neighbour", "share of queries whose first hit is of their class"],
  first_tier: ["First tier", "share of a class found among as many hits as it has members"],
  second_tier: ["Second tier", "the same among twice as many"],
  e_measure: ["E-measure", "precision and recall of the first 32 hits in one number"],
  dcg: ["DCG", "how early the members come, normalised"],
  map: ["MAP", "mean of the precision at each member found"],
};

/** "0.912, 0.89 to 0.93": a score with its 95 % interval where there is one. */
export function withInterval(value, interval) {
  return interval ? `${digits(value, 3)} (${digits(interval[0], 3)} to ${digits(interval[1], 3)})` : digits(value, 3);
}

/** What was evaluated, in words: "synthetic set, 25 of each class; srg, matching". */
export function evaluationName({ request }) {
  const of = request.collection ?? (request.synthetic ? `synthetic set, ${request.synthetic.per_class ?? 25} of each class` : "evaluation");
  return `${of}: ${[request.descriptor, request.measure, request.rerank && "re-ranked"].filter(Boolean).join(", ").replaceAll("_", " ")}`;
}
