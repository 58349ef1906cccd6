// Drawing zones: points round them, a kind, a name; saved in the file that `perdure track --zones` reads.

import { ask, send } from "./api.js";
import { css } from "./colours.js";
import { byId, h, put, toast } from "./dom.js";
import { ZONE_COLOURS } from "./draw.js";
import { on, set, state, touch } from "./store.js";

const KIND_WORDS = {
  entry: "people come in", exit: "people leave", occlusion: "hides people", "low-contrast": "hard to see",
  noise: "seen, but nobody", ignore: "does not count", ground: "people can stand",
};
let stage = null, problem = "", saved = "";

export function begin(theStage) {
  stage = theStage;
  on("tab", () => {
    if (state.tab === "zones") {
      stage.tool = tool;
      draw();
      if (!state.zones) load();
    } else if (stage.tool === tool) stage.tool = null;
  });
  on("zones", () => state.tab === "zones" && draw());
  on("run", () => set({ zones: null }));
}

async function load() {
  const told = await ask(`runs/${state.run}/zones`);
  problem = told.note;
  set({ zones: { list: told.zones.features.flatMap(ofFeature), rules: told.zones.rules ?? [], chosen: null, drawing: null, file: told.file, dirty: false } });
}

// A zone of several polygons is shown as one with several rings; it is written as it came unless it was drawn here.
function ofFeature(feature) {
  const { kind, name, ...settings } = feature.properties, { type, coordinates } = feature.geometry;
  const rings = (type === "MultiPolygon" ? coordinates.flat() : coordinates).map((ring) => ring.slice(0, -1).map(([x, y]) => [x, y]));
  return [{ kind, name, settings, rings, shape: type === "MultiPolygon" ? coordinates.map((polygon) => polygon.length) : null }];
}

function toFeature(zone) {
  const rings = zone.rings.map((ring) => [...ring, ring[0]].map(([x, y]) => [Math.round(10 * x) / 10, Math.round(10 * y) / 10]));
  let geometry = { type: "Polygon", coordinates: rings };
  if (zone.shape) {
    let place = 0;
    geometry = { type: "MultiPolygon", coordinates: zone.shape.map((count) => rings.slice(place, (place += count))) };
  }
  const settings = Object.fromEntries(Object.entries(zone.settings).filter(([name]) => name in state.session.zone_kinds[zone.kind]));
  return { type: "Feature", properties: { kind: zone.kind, name: zone.name, ...settings }, geometry };
}

function changed() {
  state.zones.dirty = true;
  saved = "";
  touch("zones");
}

// While somebody types the form stays as it is: a button that is replaced under the pointer is not clicked.
function typed() {
  state.zones.dirty = true;
  byId("save-zones").disabled = !mayBeSaved();
  stage.redraw();
}

const mayBeSaved = () => state.zones.dirty && state.session.writable && !state.zones.drawing && state.zones.list.length > 0;

const within = ({ x, y }) => [Math.min(state.about.width, Math.max(0, x)), Math.min(state.about.height, Math.max(0, y))];
let held = null;
const tool = {
  get cursor() { return state.zones?.drawing ? "crosshair" : "default"; },
  press(point) {
    const { zones } = state;
    if (!zones) return false;
    if (zones.drawing) {
      const ring = zones.drawing.rings[0], [x, y] = within(point);
      if (ring.length > 2 && Math.hypot(ring[0][0] - x, ring[0][1] - y) < point.near) return finish(), true;
      ring.push([x, y]);
      touch("zones");
      return true;
    }
    if (zones.chosen) {
      for (const ring of zones.chosen.rings) {
        const place = ring.findIndex(([x, y]) => Math.hypot(x - point.x, y - point.y) < point.near);
        if (place >= 0) return (held = { ring, place }), true;
      }
    }
    const found = zones.list.findLast((zone) => inside(zone.rings, point));
    if (found || zones.chosen) {
      zones.chosen = found ?? null;
      touch("zones");
    }
    return Boolean(found);
  },
  drag(point) {
    if (!held) return;
    held.ring[held.place] = within(point);
    changed();
  },
  lift: () => (held = null),
  double: () => state.zones?.drawing && finish(),
};

function inside(rings, { x, y }) {
  let count = 0;
  for (const ring of rings) {
    ring.forEach(([ax, ay], k) => {
      const [bx, by] = ring[(k + 1) % ring.length];
      if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) count += 1;
    });
  }
  return count % 2 === 1;
}

function start() {
  const names = new Set(state.zones.list.map((one) => one.name));
  let number = 1;
  while (names.has(`zone ${number}`)) number += 1;
  state.zones.chosen = null;
  state.zones.drawing = { kind: "entry", name: `zone ${number}`, settings: {}, rings: [[]], shape: null };
  touch("zones");
}

// Ends a drawing: points on one spot, as a double click leaves them, count once.
export function finish() {
  const { zones } = state;
  if (!zones?.drawing) return;
  const ring = zones.drawing.rings[0].filter(([x, y], k, all) => !k || Math.hypot(x - all[k - 1][0], y - all[k - 1][1]) > 1.5);
  const drawn = zones.drawing;
  zones.drawing = null;
  if (ring.length < 3) toast("A zone needs three points at least");
  else {
    drawn.rings = [ring];
    zones.list.push(drawn);
    zones.chosen = drawn;
  }
  changed();
}

export function cancel() {
  if (!state.zones?.drawing) return false;
  state.zones.drawing = null;
  touch("zones");
  return true;
}

async function save() {
  const { zones } = state;
  try {
    const told = await send("PUT", `runs/${state.run}/zones`, { type: "FeatureCollection", features: zones.list.map(toFeature), ...(zones.rules.length ? { rules: zones.rules } : {}) });
    problem = "";
    saved = `Saved in ${told.file}. Track with it: perdure track … --zones ${told.file}`;
    zones.dirty = false;
  } catch (error) {
    problem = error.message;
  }
  draw();
}

export function draw() {
  const { zones } = state;
  if (!zones) return void put(byId("panel"), h("div", { class: "empty" }, "Reading the zones…"));
  const { drawing, chosen } = zones;
  put(byId("panel"),
    h("div", { class: "toolbar" },
      drawing
        ? [h("button", { class: "primary", onclick: finish }, "Close it", h("kbd", {}, "Enter")), h("button", { onclick: cancel }, "Give up", h("kbd", {}, "Esc"))]
        : h("button", { class: "primary", onclick: start }, "Draw a zone"),
      h("span", { class: "spring" }),
      h("button", { id: "save-zones", onclick: save, disabled: !mayBeSaved() }, "Save")),
    h("div", { class: "form" }, h("div", { class: "problem", role: "alert" }, problem), saved && h("p", { class: "saved", role: "status" }, saved),
      drawing && h("p", {}, "Click its corners in the film; click the first one again, or double-click, to close it."),
      !drawing && !zones.list.length && h("p", {}, "Zones tell a tracker where people come in and go out, what hides them, and where nothing counts. Draw the first one.")),
    zones.list.length > 0 && h("ul", { class: "list" }, zones.list.map((zone) => h("li", {}, item(zone, zone === chosen)))),
    chosen && form(chosen));
}

function item(zone, current) {
  return h("button", { class: "item", "aria-current": current ? "true" : null, onclick: () => { state.zones.chosen = zone; touch("zones"); } },
    h("span", { class: "head" }, h("span", { class: "swatch", style: { background: css(ZONE_COLOURS[zone.kind]) } }), h("span", { class: "kind" }, zone.name), h("span", { class: "when" }, zone.kind)));
}

function form(zone) {
  const settings = state.session.zone_kinds[zone.kind];
  const kind = h("select", { id: "zone-kind", onchange: () => { zone.kind = kind.value; changed(); } }, Object.keys(KIND_WORDS).map((one) => h("option", { value: one, selected: one === zone.kind }, `${one}: ${KIND_WORDS[one]}`)));
  const name = h("input", { type: "text", id: "zone-name", value: zone.name, maxlength: 80 });
  name.addEventListener("input", () => {
    const before = zone.name;
    zone.name = name.value.trim();
    for (const rule of state.zones.rules) for (const end of ["lost_in", "found_in"]) if (rule[end] === before) rule[end] = zone.name;
    byId("panel").querySelector('.item[aria-current="true"] .kind').textContent = zone.name;
    typed();
  });
  return h("div", { class: "form" },
    h("div", { class: "field" }, h("label", { for: "zone-name" }, "Name"), name),
    h("div", { class: "field" }, h("label", { for: "zone-kind" }, "Kind"), kind),
    Object.entries(settings).map(([word, about]) => {
      const field = h("input", { type: "number", id: `zone-${word}`, step: "any", min: about.low, max: about.high, placeholder: String(about.default), value: zone.settings[word] ?? "" });
      field.addEventListener("input", () => {
        if (field.value === "") delete zone.settings[word]; else zone.settings[word] = Number(field.value);
        typed();
      });
      return h("div", { class: "field" }, h("label", { for: `zone-${word}` }, word), field, h("span", { class: "hint" }, about.help));
    }),
    h("div", { class: "actions" }, h("button", { class: "danger", onclick: () => { state.zones.list = state.zones.list.filter((one) => one !== zone); state.zones.chosen = null; changed(); } }, "Delete this zone")));
}
