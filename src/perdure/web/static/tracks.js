// The list of ids: how long each was there, and how well it was seen.

import { chip } from "./chips.js";
import { colourOf, css, dimmer } from "./colours.js";
import { byId, h, put } from "./dom.js";
import { LOST, OCCLUDED } from "./rows.js";
import { clock, on, set, state, timeOf } from "./store.js";

let layer = () => null, player = null, order = "first", sought = "";

export function begin(theLayer, thePlayer) {
  layer = theLayer;
  player = thePlayer;
  on("selected tab frames", () => state.tab === "tracks" && draw());
}

export function draw() {
  const tracks = layer().order.map((id) => layer().tracks.get(id)).filter((one) => !one.group);
  const shown = tracks.filter((one) => !sought || String(one.id).startsWith(sought) || one.name.includes(sought));
  const by = { first: (a, b) => a.first - b.first, id: (a, b) => a.id - b.id, long: (a, b) => b.last - b.first - (a.last - a.first), short: (a, b) => a.last - a.first - (b.last - b.first) };
  shown.sort(by[order]);
  const field = h("input", { type: "text", placeholder: "Id or class", "aria-label": "Find an id or class", value: sought, size: 10 });
  field.addEventListener("input", () => {
    sought = field.value.trim();
    draw();
    const again = byId("panel").querySelector("input");
    again.focus();
    again.setSelectionRange(sought.length, sought.length);
  });
  const sorting = h("select", { "aria-label": "Order", onchange: (event) => { order = event.target.value; draw(); } },
    [["first", "By beginning"], ["id", "By id"], ["long", "Longest first"], ["short", "Shortest first"]].map(([name, label]) =>
      h("option", { value: name, selected: name === order }, label)));
  const scrolled = byId("panel").scrollTop;
  put(byId("panel"), h("div", { class: "toolbar" }, field, sorting, h("span", { class: "spring" }), h("span", { class: "quiet" }, `${shown.length} ids`)),
    shown.length ? h("ul", { class: "list" }, shown.slice(0, 1000).map((one) => h("li", {}, item(one)))) : h("div", { class: "empty" }, tracks.length ? "No id is like that." : "There is no track yet."));
  byId("panel").scrollTop = scrolled;
}

function item(track) {
  const spark = h("canvas", { class: "spark", width: 220, height: 10, "aria-hidden": "true" });
  paint(spark, track);
  const choose = () => {
    set({ selected: track.id, partner: 0 });
    if (state.frames[state.at] < track.first || state.frames[state.at] > track.last) player.seekFrame(track.first);
  };
  return h("button", { class: "item track", "aria-current": track.id === state.selected ? "true" : null, onclick: choose, "aria-label": `Id ${track.id}, frames ${track.first} to ${track.last}` },
    chip(track.id, { inert: true }), spark,
    h("span", { class: "when" }, `${clock(timeOf(track.first))} – ${clock(timeOf(track.last))}`));
}

function paint(canvas, track) {
  const ctx = canvas.getContext("2d"), begin = state.frames[0] ?? 0, whole = Math.max(1, (state.frames.at(-1) ?? 1) - begin);
  for (const { begin: from, end, status } of track.spans) {
    const unseen = status === LOST || status === OCCLUDED;
    ctx.fillStyle = css(unseen ? dimmer(colourOf(track.id)) : colourOf(track.id), unseen ? 0.7 : 1);
    const x = (220 * (from - begin)) / whole, wide = Math.max(1, (220 * (end + 1 - from)) / whole);
    ctx.fillRect(x, unseen ? 4 : 1, wide, unseen ? 2 : 8);
  }
}
