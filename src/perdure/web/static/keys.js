// The keyboard: what each key does, and the page that tells it.

import { byId, h, put } from "./dom.js";

// [section, [key names, what it does, (event) => acts]]
export function listen(sections) {
  const acts = new Map();
  for (const [, keys] of sections) for (const [names, , run, more = names] of keys) for (const name of [].concat(more)) acts.set(name, run);
  addEventListener("keydown", (event) => {
    if (event.target.matches("input, select, textarea") || byId("keys").open) return;
    const onButton = event.target.matches("button, [role=separator]");
    if (onButton && (event.key === "Enter" || event.key === " ")) return;
    const plain = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const name = `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.shiftKey && (event.key.length > 1 || /[a-z]/i.test(event.key)) ? "Shift+" : ""}${plain === " " ? "Space" : plain}`;
    const run = acts.get(name);
    if (!run || event.altKey) return;
    event.preventDefault();
    run(event);
  });
  byId("help").addEventListener("click", () => show(sections));
}

export function show(sections) {
  const place = byId("keys"), shown = (name) => name.split(" / ").map((one, k) => [k ? " " : "", h("kbd", {}, one)]);
  put(place, h("h2", {}, "Keyboard", h("button", { class: "icon", "aria-label": "Close", onclick: () => place.close() }, "×")),
    h("div", { class: "keys" }, sections.map(([title, keys]) => h("section", {}, h("h3", {}, title),
      keys.map(([names, what]) => h("div", {}, h("span", {}, what), h("span", {}, shown(Array.isArray(names) ? names[0] : names))))))),
    h("p", { class: "quiet" }, "Click a person to select, Shift-click a second one to swap or join. The wheel zooms into the film, a double click shows the whole. On the timeline Ctrl and the wheel zoom, Shift and the wheel move."));
  if (!place.open) place.showModal();
}
