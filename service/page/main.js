// The page starts here: which address is which view. Views are loaded when they are first shown.

import { welcomeFiles } from "./parts/drop.js";
import { route, start } from "./parts/router.js";

route("/", "collections", () => import("./views/home.js"));
route("/collections/:collection", "collections", () => import("./views/collection.js"));
route("/collections/:collection/map", "collections", () => import("./views/map.js"));
route("/collections/:collection/query", "collections", () => import("./views/query.js"));
route("/collections/:collection/shapes/:shape", "collections", () => import("./views/shape.js"));
route("/evaluations", "evaluations", () => import("./views/evaluations.js"));
route("/evaluations/compare", "evaluations", () => import("./views/comparison.js"));
route("/evaluations/:evaluation", "evaluations", () => import("./views/evaluation.js"));
route("/tasks", "tasks", () => import("./views/tasks.js"));

welcomeFiles();
start();
