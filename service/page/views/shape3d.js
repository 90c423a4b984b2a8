// The 3D half of a shape's view: what is drawn, and the controls below it.

import { h, select } from "../parts/dom.js";
import { remember } from "../parts/router.js";
import { digits } from "../parts/words.js";
import { endpointColour, ink, legend } from "../three/colours.js";
import { loadDisplay } from "../three/load.js";
import { helpText, noWebGl } from "../three/overlay.js";
import { Stage } from "../three/stage.js";
import { Surface } from "../three/surface.js";

const MODES = [["skeleton", "Skeleton"], ["colours", "Colours"], ["denoising", "Before / after"]];

/** Fill `place` with a stage of the shape. */
export async function showShape(view, place, { address, shape, skeleton }) {
  let mesh;
  try {
    mesh = await loadDisplay(address, view.signal);
  } catch (error) {
    if (view.signal.aborted) return;
    place.replaceChildren(h("div", { class: "stage waiting" }, h("p", { class: "quiet" }, `The mesh cannot be shown: ${error.message}`)));
    return;
  }
  let stage;
  try {
    stage = new Stage({ label: `${shape.name} in 3D`, describedBy: "summary", signal: view.signal });
  } catch {
    place.append(noWebGl());
    return;
  }
  const shown = new Shown(stage, mesh, skeleton);
  place.replaceChildren(stage.host, shown.controls(view.query), helpText());
  const drawn = mesh.faces.length / 3;
  if (mesh.facesOfAll > drawn) place.append(h("p", { class: "quiet small" }, `Shown with ${drawn.toLocaleString("en")} of ${mesh.facesOfAll.toLocaleString("en")} faces.`));
  linkRows(document.getElementById("endpoints"), stage.overlay);
  stage.fit();
  shown.show();
}

/** A row of the table of endpoints makes its mark stand out. */
function linkRows(rows, overlay) {
  rows?.querySelectorAll("tbody tr").forEach((row, i) => {
    row.addEventListener("pointerenter", () => overlay.point(i));
    row.addEventListener("pointerleave", () => overlay.point(null));
  });
}

class Shown {
  constructor(stage, mesh, skeleton) {
    Object.assign(this, { stage, mesh, skeleton, fields: mesh.fields });
    const surface = (this.surface = stage.add(new Surface(mesh)));
    surface.addSkeleton(skeleton, ink());
    this.marks = skeleton.endpoints.map((endpoint, i) => ({
      point: surface.at(skeleton.nodes[endpoint.node].position), text: String(i), colour: endpointColour(i),
    }));
  }

  controls(query) {
    this.mode = MODES.some(([mode]) => mode === query.show) ? query.show : "skeleton";
    this.field = this.fields.some((one) => one.name === query.field) ? query.field : this.fields[0].name;
    const change = (values) => { Object.assign(this, values); remember({ show: this.mode === "skeleton" ? null : this.mode,
      field: this.mode === "colours" && this.field !== this.fields[0].name ? this.field : null }); this.show(); };
    const modes = h("fieldset", { class: "segments" }, h("legend", { class: "unseen" }, "What is shown"), MODES.map(([mode, text]) =>
      h("label", {}, h("input", { type: "radio", name: "mode", value: mode, checked: this.mode === mode, onchange: () => change({ mode }) }), h("span", {}, text))));
    this.picked = select(this.fields.map((one) => [one.name, one.title]), this.field,
      { "aria-label": "Colour by", onchange: (event) => change({ field: event.target.value }) });
    this.levels = h("input", { type: "checkbox", checked: true, onchange: () => this.show() });
    this.wires = h("input", { type: "checkbox", onchange: () => { this.surface.wireframe(this.wires.checked); this.stage.draw(); } });
    this.slider = h("input", { type: "range", class: "wipe", min: 0, max: 100, value: 50, "aria-label": "Before on the left, after on the right",
      oninput: () => this.#wipe() });
    this.levelsLabel = h("label", { class: "check" }, this.levels, "level sets");
    this.key = h("div", { class: "key", role: "status" });
    return h("div", { class: "controls" }, modes, this.picked, this.levelsLabel, h("label", { class: "check" }, this.wires, "wireframe"),
      h("button", { type: "button", class: "secondary", onclick: () => this.stage.fit() }, "Fit"), this.slider, this.key);
  }

  show() {
    const { mode } = this;
    this.picked.hidden = this.levelsLabel.hidden = mode !== "colours";
    this.slider.hidden = mode !== "denoising";
    this.surface.glass(mode === "skeleton");
    this.surface.bones.visible = mode === "skeleton";
    this.stage.overlay.show(mode === "skeleton" ? this.marks : []);
    this.stage.wipe = null;
    if (this.before) this.before.group.visible = mode === "denoising";
    this.key.replaceChildren();
    if (mode === "skeleton") this.surface.colour(null);
    if (mode === "colours") this.#colour(this.field, this.surface, this.levels.checked);
    if (mode === "denoising") this.#compare();
    this.stage.draw();
  }

  #colour(name, surface, levels) {
    const field = this.fields.find((one) => one.name === name);
    const [low, high] = surface.colour(field.values, field.scale, levels);
    this.key.replaceChildren(legend(field.title, field.scale, digits(low, 3), digits(high, 3)), h("span", { class: "quiet small" }, field.description));
  }

  #compare() {
    if (!this.before) {
      this.before = this.stage.add(new Surface({ ...this.mesh, positions: this.mesh.before }));
      this.before.place(this.surface.frame, this.surface);
    }
    this.before.group.visible = true;
    const displacement = this.fields.find((one) => one.name === "displacement");
    if (displacement) this.#colour("displacement", this.surface, false);
    else this.surface.colour(null);
    this.key.prepend(h("span", { class: "quiet small" }, "Left: as it came, cleaned. Right: smoothed, coloured by how far each point moved."));
    this.#wipe();
  }

  #wipe() {
    this.stage.wipe = { at: this.slider.value / 100, before: this.before, after: this.surface };
    this.stage.draw();
  }
}
