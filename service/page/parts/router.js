// Every view has an address; back, forward and reload lead where they should.

import { Refused, Unreachable } from "./api.js";
import { announce, empty, h } from "./dom.js";

const routes = [];
let leaving = null;
let shown = null;

const here = () => location.pathname + location.search;

/** pattern: "/collections/:collection"; load: () => import of a module with `show(view)`; section: in the navigation. */
export function route(pattern, section, load) {
  const names = [...pattern.matchAll(/:(\w+)/g)].map((found) => found[1]);
  routes.push({ matcher: new RegExp(`^${pattern.replace(/:\w+/g, "([^/]+)")}/?$`), names, section, load });
}

/** An address inside the page, its parts escaped: path`/collections/${name}`. */
export function path(strings, ...values) {
  return String.raw({ raw: strings }, ...values.map((value) => encodeURIComponent(value)));
}

/** An address with a query; what is null, undefined or "" is left out. */
export function withQuery(address, values) {
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(values))
    if (value !== null && value !== undefined && value !== "") query.set(name, value);
  return query.size ? `${address}?${query}` : address;
}

export function go(address, { replace = false } = {}) {
  if (replace) history.replaceState(null, "", address);
  else history.pushState(null, "", address);
  return render({ moved: true });
}

/** Change the query of the present address without leaving the view. */
export function remember(values) {
  const query = Object.fromEntries(new URLSearchParams(location.search));
  history.replaceState(null, "", withQuery(location.pathname, { ...query, ...values }));
  shown = here();
}

/** The same as a step of its own, which "back" undoes. */
export function step(values) {
  history.pushState(null, "", here());
  remember(values);
}

export const reload = () => render({ moved: false });

async function render({ moved }) {
  leaving?.abort();
  const left = (leaving = new AbortController());
  shown = here();
  const main = document.getElementById("main");
  const found = routes.map((one) => [one, one.matcher.exec(location.pathname)]).find(([, match]) => match);
  for (const link of document.querySelectorAll("nav a[data-view]"))
    link.toggleAttribute("aria-current", link.dataset.view === found?.[0].section);
  if (!found) {
    main.replaceChildren(empty("There is nothing at this address", "The link may be old or mistyped.",
      h("a", { class: "button", href: "/" }, "To the shapes")));
    return;
  }
  const [one, match] = found;
  const view = {
    root: h("div", { class: "view" }),
    params: Object.fromEntries(one.names.map((name, i) => [name, decodeURIComponent(match[i + 1])])),
    query: Object.fromEntries(new URLSearchParams(location.search)),
    signal: left.signal,
    title(text) {
      document.title = `${text} · Reebase`;
      announce(text);
    },
  };
  main.setAttribute("aria-busy", "true");
  try {
    const module = await one.load().catch(() => { throw new Unreachable(); });
    if (left.signal.aborted) return;
    if (moved) scrollTo(0, 0);
    main.replaceChildren(view.root);
    await module.show(view);
    if (moved && !left.signal.aborted && !main.contains(document.activeElement)) main.focus({ preventScroll: true });
  } catch (error) {
    if (left.signal.aborted || error.name === "AbortError") return;
    view.root.replaceChildren(failure(error));
    main.replaceChildren(view.root);
  } finally {
    if (!left.signal.aborted) main.removeAttribute("aria-busy");
  }
}

/** The way to what is there, from something that is not: a shape's collection, the list of evaluations, or the start. */
function above(code) {
  const collection = code === "shape_not_found" && /^\/collections\/([^/]+)/.exec(location.pathname)?.[1];
  const [text, href] = code === "evaluation_not_found" ? ["To the evaluations", "/evaluations"]
    : collection ? [`To ${decodeURIComponent(collection)}`, `/collections/${collection}`] : ["To the shapes", "/"];
  return h("a", { class: "button", href }, text);
}

/** What is shown in place of a view that cannot be. */
export function failure(error) {
  if (!(error instanceof Refused) && error.code !== "unreachable") console.error(error);
  const gone = error.status === 404;
  return empty(gone ? "This is not here" : "This could not be shown", error.message,
    gone ? above(error.code)
      : h("button", { type: "button", onclick: reload }, "Try again"));
}

/** Follow links inside the page without loading it anew. */
export function start() {
  history.scrollRestoration = "auto";
  addEventListener("popstate", () => {
    // A link to a place in the page, as the one that skips to the content, leaves the view as it is.
    if (here() !== shown) render({ moved: false });
  });
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("a[href]");
    if (!link || event.defaultPrevented || event.button !== 0) return;
    if (event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
    if (link.origin !== location.origin || link.hasAttribute("download") || link.hasAttribute("data-outside")) return;
    if (link.getAttribute("href").startsWith("#")) return;
    event.preventDefault();
    go(link.href);
  });
  return render({ moved: false });
}
