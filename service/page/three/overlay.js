// Numbers on endpoints and lines between matched ones, drawn over the canvas as sharp text.

import { h, svg } from "../parts/dom.js";

/** Marks that stay on points of the scene while it turns. */
export class Overlay {
  constructor() {
    this.lines = svg("g", {});
    this.discs = svg("g", {});
    this.element = svg("svg", { class: "overlay", "aria-hidden": "true" }, this.lines, this.discs);
    this.marks = [];
    this.links = [];
  }

  /**
   * marks: [{ point: Vector3 in the scene, pane, text, colour, alone }]; alone: it has no partner, shown hollow.
   * links: [{ from, to, colour }], by their indices among the marks.
   */
  show(marks, links = []) {
    this.marks = marks.map((mark) => ({ ...mark, element: disc(mark) }));
    this.links = links.map((link) => ({ ...link, element: svg("line", { stroke: link.colour, class: "link" }) }));
    this.discs.replaceChildren(...this.marks.map((mark) => mark.element));
    this.lines.replaceChildren(...this.links.map((link) => link.element));
  }

  /** Make one mark and its link stand out; null for none. */
  point(index) {
    this.marks.forEach((mark, i) => mark.element.classList.toggle("dim", index !== null && !this.#beside(index, i)));
    this.links.forEach((link) => link.element.classList.toggle("dim", index !== null && link.from !== index && link.to !== index));
  }

  #beside(index, other) {
    return index === other || this.links.some(({ from, to }) => (from === index && to === other) || (to === index && from === other));
  }

  /** Put everything where the camera sees it. panes: [left, top, width, height] of each. */
  place(camera, panes, host) {
    this.element.setAttribute("viewBox", `0 0 ${host.clientWidth} ${host.clientHeight}`);
    const at = this.marks.map((mark) => {
      const [left, top, width, height] = panes[mark.pane ?? 0];
      const seen = mark.point.clone().project(camera);
      const place = [left + ((seen.x + 1) / 2) * width, top + ((1 - seen.y) / 2) * height];
      mark.element.setAttribute("transform", `translate(${place[0].toFixed(1)} ${place[1].toFixed(1)})`);
      return place;
    });
    for (const { from, to, element } of this.links) {
      const [[x1, y1], [x2, y2]] = [at[from], at[to]];
      for (const [name, value] of Object.entries({ x1, y1, x2, y2 })) element.setAttribute(name, value.toFixed(1));
    }
  }
}

function disc({ text, colour, alone }) {
  return svg("g", { class: alone ? "mark alone" : "mark" },
    svg("circle", { r: 10, fill: alone ? "none" : colour, stroke: alone ? colour : "#fff" }),
    alone && svg("circle", { r: 9, class: "inside" }),
    svg("text", { y: 4 }, text));
}

/** What is said where nothing can be drawn in 3D. */
export const noWebGl = () => h("p", { class: "quiet" },
  "This browser has no WebGL, so there is no 3D view; the pictures, the numbers and the downloads are all here.");

/** The bar under a stage that says, for people who see and people who do not, how it is moved. */
export const helpText = () => h("p", { class: "quiet small" },
  "Drag to turn, scroll or pinch to zoom. With the keyboard: arrow keys turn, + and − zoom, F fits.");
