// Elements without a framework: h("p", { class: "quiet" }, "text", child).

import { brief, moment } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";

function filled(element, properties, children) {
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "value" || name === "checked" || name === "disabled" || name === "hidden" || name === "open")
      element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** An element with attributes, listeners (`onclick`) and children; what is null, undefined or false is left out. */
export function h(name, properties = {}, ...children) {
  return filled(document.createElement(name), properties, children);
}

/** The same for SVG. */
export function svg(name, properties = {}, ...children) {
  return filled(document.createElementNS(SVG, name), properties, children);
}

/** A labelled field: the label's text above what is filled in. */
export function field(text, control, hint) {
  return h("label", { class: "field" }, h("span", {}, text), control, hint && h("small", { class: "quiet" }, hint));
}

/** A select from [value, text] pairs. */
export function select(options, chosen, properties = {}) {
  const made = h("select", properties, options.map(([value, text]) => h("option", { value }, text)));
  if (options.some(([value]) => value === chosen)) made.value = chosen;
  return made;
}

/** A table from columns [{ title, number, cell(row) }]; a caption says what it shows. */
export function table(caption, columns, rows, properties = {}) {
  const kind = (column) => (column.number ? "number" : null);
  return h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption }, h("table", properties,
    h("caption", {}, caption),
    h("thead", {}, h("tr", {}, columns.map((column) => h("th", { scope: "col", class: kind(column) }, column.title)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, columns.map((column, i) =>
      h(i === 0 ? "th" : "td", { class: kind(column), scope: i === 0 ? "row" : null }, column.cell(row))))))));
}

/** A moment in a table: short, the whole of it as its title. */
export function time(text) {
  return h("time", { datetime: text, title: moment(text) }, brief(text));
}

/** What a view shows where there is nothing yet: a title, a sentence, and what to do. */
export function empty(title, text, ...actions) {
  return h("section", { class: "empty" }, h("h2", {}, title), h("p", { class: "quiet" }, text),
    actions.length > 0 && h("div", { class: "bar" }, actions));
}

/** Say something to people who do not see the page change. */
export function announce(text) {
  document.getElementById("announcer").textContent = text;
}

/** A short message at the bottom of the page, with an action (such as undo) where there is one. */
export function notify(text, { action, onaction, bad = false, seconds = 12 } = {}) {
  const close = () => note.remove();
  const note = h("div", { class: bad ? "notice bad" : "notice", role: bad ? "alert" : "status" }, h("span", {}, text),
    action && h("button", { type: "button", class: "plain", onclick: () => { close(); onaction(); } }, action),
    h("button", { type: "button", class: "plain", "aria-label": "Dismiss", onclick: close }, "×"));
  document.getElementById("notices").append(note);
  if (!bad) setTimeout(close, seconds * 1000);
  return close;
}
