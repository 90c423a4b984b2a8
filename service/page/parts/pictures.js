// Pictures that the service makes. An <img> sends no key, so they are fetched, and shown once they are near the screen.

import { request } from "./api.js";
import { h } from "./dom.js";

const kept = new Map();
const MOST = 600;

function dataUrl(blob) {
  return new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result);
    reader.onerror = () => failed(reader.error);
    reader.readAsDataURL(blob);
  });
}

async function fetched(path) {
  if (!kept.has(path)) {
    const made = request(path).then((response) => response.blob()).then(dataUrl);
    kept.set(path, made);
    made.catch(() => kept.delete(path));
    if (kept.size > MOST) kept.delete(kept.keys().next().value);
  }
  return kept.get(path);
}

const near = new IntersectionObserver((seen) => {
  for (const { isIntersecting, target } of seen) {
    if (!isIntersecting) continue;
    near.unobserve(target);
    fetched(target.dataset.path).then(
      (url) => { target.src = url; target.hidden = false; },
      () => { target.closest(".thumbnail, .plot")?.classList.add("missing"); },
    );
  }
}, { rootMargin: "200px" });

function picture(path, alt, properties) {
  const image = h("img", { alt, "data-path": path, decoding: "async", ...properties });
  near.observe(image);
  return image;
}

/** The thumbnail of a shape, or a quiet square where there is none. */
export function thumbnail(path, alt = "") {
  return h("span", { class: "thumbnail" }, picture(path, alt, { width: 192, height: 192 }));
}

/** A plot that the service draws, in the theme that the page has. */
export function plot(path, alt) {
  const theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  return h("figure", { class: "plot" }, picture(`${path}${path.includes("?") ? "&" : "?"}theme=${theme}`, alt, {}));
}
