// The canvas: one renderer for the whole page, handed from view to view; it draws when something changed.

import { PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "../vendor/three.module.min.js";
import { OrbitControls } from "../vendor/OrbitControls.js";
import { h } from "../parts/dom.js";
import { Overlay } from "./overlay.js";

const ANGLE = 26;
const ROOM = 1.12;
const SLOW = 45;
const COARSEST = 0.4;
let renderer = null;

/** The page's renderer, made when the first canvas is shown. Throws where the browser has no WebGL. */
export function sharedRenderer() {
  renderer ??= new WebGLRenderer({ antialias: true, alpha: true, powerPreference: "high-performance" });
  return renderer;
}

const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** A place where shapes are drawn: in one pane, or in two that turn together. */
export class Stage {
  /** label: what is seen, in words; describedBy: id of the text summary; panes: 1 or 2; signal: ends the stage. */
  constructor({ label, describedBy, panes = 1, signal }) {
    this.canvas = sharedRenderer().domElement;
    this.overlay = new Overlay();
    this.host = h("div", {
      class: "stage", tabindex: "0", role: "application", "aria-label": label, "aria-describedby": describedBy,
      "aria-roledescription": "3D view", onkeydown: (event) => this.#pressed(event),
    }, this.canvas, this.overlay.element);
    this.scenes = Array.from({ length: panes }, () => new Scene());
    this.surfaces = [];
    this.wipe = null;
    this.camera = new PerspectiveCamera(ANGLE, 1, 0.1, 100);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = !still();
    this.controls.dampingFactor = 0.12;
    this.controls.zoomToCursor = true;
    this.controls.minDistance = 0.3;
    this.controls.maxDistance = 30;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => this.canvas.classList.add("held"));
    this.controls.addEventListener("end", () => this.canvas.classList.remove("held"));
    this.fineness = 1;
    this.lightened = false;
    this.watcher = new ResizeObserver(() => this.#resized());
    this.watcher.observe(this.host);
    this.fit();
    signal.addEventListener("abort", () => this.close());
  }

  add(surface, pane = 0) {
    this.surfaces.push(surface);
    this.scenes[pane].add(surface.group);
    this.draw();
    return surface;
  }

  remove(surface) {
    this.surfaces = this.surfaces.filter((one) => one !== surface);
    surface.dispose();
    this.draw();
  }

  /** See all of it, from the front. */
  fit() {
    const [, , width, height] = this.#panes()[0];
    const slope = Math.tan((ANGLE * Math.PI) / 360);
    const far = this.surfaces.map((surface) => surface.halves()).map(([x, y, z]) =>
      z + Math.max(y / slope, (x * height) / (slope * width)) * ROOM);
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0, 0, Math.max(1.5, ...far));
    this.camera.up.set(0, 1, 0);
    this.controls.update();
    this.draw();
  }

  turn(sideways, upwards) {
    const place = this.camera.position.clone().sub(this.controls.target);
    const right = new Vector3().crossVectors(this.camera.up, place).normalize();
    const tilted = place.clone().applyAxisAngle(right, upwards);
    if (Math.abs(tilted.clone().normalize().dot(this.camera.up)) < 0.995) place.copy(tilted);
    place.applyAxisAngle(this.camera.up, sideways);
    this.camera.position.copy(place.add(this.controls.target));
    this.controls.update();
    this.draw();
  }

  zoom(factor) {
    const place = this.camera.position.clone().sub(this.controls.target);
    place.setLength(Math.min(this.controls.maxDistance, Math.max(this.controls.minDistance, place.length() * factor)));
    this.camera.position.copy(place.add(this.controls.target));
    this.controls.update();
    this.draw();
  }

  /** Draw soon: many changes are one picture. */
  draw() {
    this.frame ??= requestAnimationFrame((now) => {
      this.frame = null;
      if (this.closed) return;
      this.#keepPace(now);
      if (this.controls.enableDamping) this.controls.update();
      this.#paint();
    });
  }

  close() {
    if (this.closed) return;
    this.closed = true;
    cancelAnimationFrame(this.frame);
    clearTimeout(this.settling);
    this.watcher.disconnect();
    this.controls.dispose();
    for (const surface of this.surfaces) surface.dispose();
    this.surfaces = [];
    renderer.renderLists.dispose();
    this.host.remove();
  }

  /** [left, top, width, height] of each pane, in CSS pixels: side by side, or one above the other where it is narrow. */
  #panes() {
    const width = this.host.clientWidth || 300;
    const height = this.host.clientHeight || 300;
    if (this.scenes.length === 1) return [[0, 0, width, height]];
    if (width >= height) return [[0, 0, width / 2, height], [width / 2, 0, width / 2, height]];
    return [[0, 0, width, height / 2], [0, height / 2, width, height / 2]];
  }

  #resized() {
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * this.fineness);
    renderer.setSize(this.host.clientWidth, this.host.clientHeight, false);
    this.#paint();
  }

  /** Fewer faces and then fewer pixels while it moves, when pictures come too slowly; all of it again once it rests. */
  #keepPace(now) {
    const since = now - (this.drawn ?? -Infinity);
    this.drawn = now;
    if (since < 500) {
      this.pace = 0.7 * (this.pace ?? 16) + 0.3 * since;
      if (this.pace > SLOW && !this.lightened) this.#lighten(true);
      else if (this.pace > SLOW && this.fineness > COARSEST) this.#refine(Math.max(COARSEST, this.fineness * 0.7));
    }
    clearTimeout(this.settling);
    if (this.fineness < 1 || this.lightened) this.settling = setTimeout(() => { this.#lighten(false); this.#refine(1); this.#paint(); }, 250);
  }

  #lighten(on) {
    this.lightened = on;
    this.pace = 16;
    for (const surface of this.surfaces) surface.light(on);
  }

  #refine(fineness) {
    this.fineness = fineness;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * fineness);
    renderer.setSize(this.host.clientWidth, this.host.clientHeight, false);
  }

  #paint() {
    const panes = this.#panes();
    const height = this.host.clientHeight;
    renderer.setScissorTest(true);
    renderer.autoClear = true;
    renderer.info.autoReset = false;
    renderer.info.reset();
    this.camera.aspect = panes[0][2] / panes[0][3];
    this.camera.updateProjectionMatrix();
    panes.forEach(([left, top, width, high], i) => {
      renderer.setViewport(left, height - top - high, width, high);
      if (this.wipe) this.#paintWiped(left, height - top - high, width, high);
      else {
        renderer.setScissor(left, height - top - high, width, high);
        renderer.render(this.scenes[i], this.camera);
      }
    });
    this.overlay.place(this.camera, panes, this.host);
  }

  /** Left of the slider one surface, right of it the other. wipe: { at, before, after }. */
  #paintWiped(left, bottom, width, high) {
    const { at, before, after } = this.wipe;
    const cut = Math.round(width * at);
    for (const [first, wide, shown] of [[0, cut, before], [cut, width - cut, after]]) {
      before.group.visible = shown === before;
      after.group.visible = shown === after;
      renderer.setScissor(left + first, bottom, wide, high);
      renderer.render(this.scenes[0], this.camera);
    }
    before.group.visible = after.group.visible = true;
  }

  #pressed(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const acts = {
      ArrowLeft: () => this.turn(-0.12, 0), ArrowRight: () => this.turn(0.12, 0), ArrowUp: () => this.turn(0, -0.12),
      ArrowDown: () => this.turn(0, 0.12), "+": () => this.zoom(0.88), "=": () => this.zoom(0.88), "-": () => this.zoom(1.14),
      f: () => this.fit(), F: () => this.fit(), Home: () => this.fit(),
    };
    if (!acts[event.key]) return;
    acts[event.key]();
    event.preventDefault();
  }
}
