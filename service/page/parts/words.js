// Words for what the API says in codes and numbers.

const STAGES = {
  read: "reading the file", clean: "checking and repairing", denoise: "smoothing noise away", operator: "setting up the operator",
  eigenpairs: "solving for the eigenfunctions", skeleton: "drawing the skeleton", features: "measuring the endpoints",
  descriptors: "measuring the surface", distances: "comparing all pairs", measures: "scoring the rankings",
};

const STATES = {
  queued: "waiting", running: "running", succeeded: "done", failed: "failed", cancelled: "cancelled", indexed: "ready",
};

const FLAGS = {
  several_components: "several parts", joined_components: "parts joined", largest_component_only: "largest part only",
  small_components_left_out: "smallest parts left out", open_surface: "open surface", non_manifold: "non-manifold edges",
  near_degenerate_eigenvalues: "nearly symmetric", no_endpoints: "no endpoints", single_node: "no skeleton",
  no_path_lengths: "no path lengths", tufted_operator: "tufted operator",
};

const ADVICE = {
  truncated_file: "The file ends too early. Export or download it again.",
  unknown_format: "Save it as PLY, OBJ, OFF, STL, GLB or 3MF and try again.",
  too_many_bytes: "Decimate the mesh, or ask whoever runs the service for a larger limit.",
  too_many_vertices: "Decimate the mesh, or ask whoever runs the service for a larger limit.",
  too_many_faces: "Decimate the mesh, or ask whoever runs the service for a larger limit.",
  no_faces: "The file holds points only. Reebase needs a surface: export it as triangles.",
  empty_file: "Export it again.",
  quota_exceeded: "Delete shapes that you no longer need, or ask for a larger quota.",
  rate_limited: "Wait a moment, then try again.",
  forbidden_scope: "Use a key with more rights: close this tab, open the page again and enter it.",
  unreachable: "Check that the service runs, then try again.",
  worker_died: "Try again; if it happens again, the mesh is too large for the worker's memory.",
  out_of_memory: "Decimate the mesh and try again.",
  timed_out: "Decimate the mesh and try again.",
};

const UNREACHED = 1000;

const named = (words, name) => words[name] ?? String(name ?? "").replaceAll("_", " ");

export const stageWords = (stage) => named(STAGES, stage);
export const stateWords = (state) => named(STATES, state);
export const flagWords = (flag) => named(FLAGS, flag);

/** What went wrong, and what to do, in one text. error: { code, detail } of the API, or an Error. */
export function explained(error) {
  const told = error.detail ?? error.message;
  const advice = ADVICE[error.code];
  return advice ? `${told} ${advice}` : told;
}

/** A task in words: "solving for the eigenfunctions, 40 %". */
export function taskWords(task) {
  if (task.state !== "running") return stateWords(task.state);
  const { stage, fraction } = task.progress;
  return stage ? `${stageWords(stage)}, ${Math.round(fraction * 100)} %` : "starting";
}

export const count = (number, one, many = `${one}s`) => `${number.toLocaleString("en")} ${number === 1 ? one : many}`;

/** A number with so many significant digits, never in exponents that people do not read. */
export function digits(value, significant = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e7)) {
    const [mantissa, exponent] = value.toExponential(significant - 1).split("e");
    return `${mantissa} × 10${[...String(Number(exponent))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`;
  }
  return Number(value.toPrecision(significant)).toLocaleString("en", { maximumSignificantDigits: significant });
}

export const percent = (share) => `${(share * 100).toFixed(share < 0.1 ? 1 : 0)} %`;

export function size(bytes) {
  const units = ["B", "kB", "MB", "GB"];
  let at = 0;
  let value = bytes;
  while (value >= 1000 && at < units.length - 1) { value /= 1000; at += 1; }
  return `${value < 10 && at > 0 ? value.toFixed(1) : Math.round(value)} ${units[at]}`;
}

export const seconds = (value) => (value < 1 ? `${Math.round(value * 1000)} ms` : `${value.toFixed(1)} s`);

/** The time where it is of today, else the day: short enough for a column on a phone. */
export function brief(text) {
  const at = new Date(text);
  return at.toDateString() === new Date().toDateString() ? at.toLocaleTimeString("en", { timeStyle: "short" })
    : at.toLocaleDateString("en", { day: "numeric", month: "short" });
}

export const moment = (text) => new Date(text).toLocaleString("en", { dateStyle: "medium", timeStyle: "short" });

/** Whether the walk over neighbours by which hits are re-ranked leads to this one; if not, its number says nothing. */
export const reached = (query, { dissimilarity }) => !query.rerank || dissimilarity < UNREACHED;

/** What ranks a hit, in words. */
export function distanceWords(query, hit) {
  if (!reached(query, hit)) return "not connected";
  const { dissimilarity } = hit;
  return `${query.descriptor === "srg" ? "D =" : "distance"} ${digits(dissimilarity, 3)}`;
}
