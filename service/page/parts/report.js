// A health report and a skeleton in plain words.

import { count, digits, percent } from "./words.js";

const REPAIRS = {
  merged_vertices: (n) => `${count(n, "vertex", "vertices")} at the same place merged`,
  removed_degenerate_faces: (n) => `${count(n, "face")} without area removed`,
  removed_duplicate_faces: (n) => `${count(n, "double face")} removed`,
  removed_unused_vertices: (n) => `${count(n, "unused vertex", "unused vertices")} removed`,
  flipped_faces: (n) => `${count(n, "face")} turned to agree with their neighbours`,
};

/** What cleaning found and did, one sentence each. */
export function healthWords(report) {
  const kind = report.closed ? "Closed" : `Open, with ${count(report.boundary_loops, "boundary loop")}`;
  const told = [`${kind}, ${report.components === 1 ? "one part" : `${report.components} parts`}${
    report.components > 1 ? `, the largest with ${percent(report.largest_component_share)} of the area` : ""}${
    report.oriented ? "" : ", faces not turned consistently"}.`];
  if (report.non_manifold_edges > 0) told.push(`${count(report.non_manifold_edges, "edge")} with more than two faces.`);
  const repairs = Object.entries(report.repairs).filter(([, n]) => n > 0);
  told.push(repairs.length === 0 ? "Nothing had to be repaired." : `Repaired: ${repairs.map(([name, n]) =>
    REPAIRS[name]?.(n) ?? `${name.replaceAll("_", " ")} (${n.toLocaleString("en")})`).join(", ")}.`);
  return told;
}

/** What is to be seen, for people who do not see it. */
export function summaryOf(shape, skeleton, report) {
  const cycles = skeleton.cycles > 0 ? ` and ${count(skeleton.cycles, "loop")}` : "";
  const ends = skeleton.endpoints.length;
  const area = Math.max(0, ...skeleton.endpoints.map((one) => one.omega?.[0] ?? 0));
  const share = ends > 0 && skeleton.endpoints[0].omega ? `; the largest end holds ${digits(area * 100, 2)} % of the area` : "";
  return `A ${report.closed ? "closed" : "open"} surface whose skeleton has ${count(ends, "endpoint")}${cycles}${share}.`;
}
