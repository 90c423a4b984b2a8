// The API key: asked for once, where the service wants one, and kept until the tab is closed.

import { h } from "./dom.js";

const NAME = "reebase-key";
let asking = null;

export const key = () => sessionStorage.getItem(NAME);

/** Ask for a key; whoever asks while the question stands waits for the same answer. */
export function askKey(why) {
  asking ??= question(why).finally(() => { asking = null; });
  return asking;
}

function question(why) {
  return new Promise((answered) => {
    const input = h("input", { id: "key", type: "password", autocomplete: "off", spellcheck: "false", required: true });
    const dialog = h("dialog", { "aria-labelledby": "key-title", class: "ask" },
      h("form", { method: "dialog" },
        h("h2", { id: "key-title" }, "This service asks for an API key"),
        h("p", { class: "quiet" }, why),
        h("p", { class: "quiet" }, "Whoever runs it makes one with ", h("code", {}, "reebase keys create"),
          ". It is kept in this tab only, and forgotten when you close it."),
        h("label", { class: "field", for: "key" }, h("span", {}, "API key"), input),
        h("div", { class: "bar" }, h("button", {}, "Use this key"))));
    dialog.addEventListener("cancel", (event) => event.preventDefault());
    dialog.addEventListener("close", () => {
      sessionStorage.setItem(NAME, input.value.trim());
      dialog.remove();
      answered();
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
