// The list of what may be wrong, the most doubtful first; and of all events, in their order.

import { chip, words } from "./chips.js";
import { byId, h, put } from "./dom.js";
import { clock, on, set, state, timeOf } from "./store.js";

let wanted = "open"; // "open", "doubtful", "all", "events"
let player = null;

export function begin(thePlayer) {
  player = thePlayer;
  on("events doubt tab", () => state.tab === "doubts" && draw());
}

const listed = () => {
  const { doubts = [], events = [] } = state.events ?? {};
  if (wanted === "events") return events;
  if (wanted === "all") return doubts;
  return doubts.filter((one) => one.doubtful && (wanted === "doubtful" || !one.looked || one === state.doubt));
};

export function choose(one) {
  set({ doubt: one, selected: one.ids[0] ?? 0, partner: one.partners?.[0] ?? one.ids[1] ?? 0, playing: false });
  player.seekFrame(one.begin);
}

// The next or previous doubt that nobody has looked at; round the corner at the ends.
export function step(by) {
  const open = (state.events?.doubts ?? []).filter((one) => one.doubtful && (!one.looked || one === state.doubt));
  if (!open.some((one) => !one.looked)) return set({ doubt: null });
  const place = open.indexOf(state.doubt);
  return choose(open[place < 0 ? (by > 0 ? 0 : open.length - 1) : (place + by + open.length) % open.length]);
}

// The next or previous event of any kind, from the playhead.
export function stepEvent(by, frame) {
  const events = state.events?.events ?? [];
  const found = by > 0 ? events.find((one) => one.begin > frame) : events.findLast((one) => one.begin < frame);
  if (found) player.seekFrame(found.begin);
}

export function draw() {
  const items = listed(), { doubts = [], events = [] } = state.events ?? {};
  const counts = {
    open: doubts.filter((one) => one.doubtful && !one.looked).length, doubtful: doubts.filter((one) => one.doubtful).length,
    all: doubts.length, events: events.length,
  };
  const choice = h("select", { "aria-label": "Which events", onchange: (event) => { wanted = event.target.value; draw(); } },
    [["open", "To look at"], ["doubtful", "All doubtful"], ["all", "All decisions"], ["events", "All events"]].map(([name, label]) =>
      h("option", { value: name, selected: name === wanted }, `${label} (${counts[name]})`)));
  const scrolled = byId("panel").scrollTop;
  put(byId("panel"),
    h("div", { class: "toolbar" }, choice, h("span", { class: "spring" }),
      wanted !== "events" && [
        h("button", { onclick: () => step(-1), title: "Previous doubt (P)" }, "Previous"),
        h("button", { onclick: () => step(1), title: "Next doubt (N)" }, "Next"),
      ]),
    items.length ? h("ul", { class: "list" }, items.slice(0, 600).map((one) => h("li", {}, item(one)))) : nothing(counts));
  byId("panel").scrollTop = scrolled;
  byId("panel").querySelector('[aria-current="true"]')?.scrollIntoView({ block: "nearest" });
}

function nothing(counts) {
  if (!state.events) return h("div", { class: "empty" }, "Reading the events…");
  if (wanted === "open" && counts.doubtful) return h("div", { class: "empty" }, h("b", {}, "All doubts have been looked at"), `${counts.doubtful} of them. The results hold what you corrected.`);
  if (wanted === "open") return h("div", { class: "empty" }, h("b", {}, "Nothing is doubtful"), "The tracker was sure of every identity that it decided. “All decisions” lists them.");
  return h("div", { class: "empty" }, "There are none in this run.");
}

function item(one) {
  const current = state.doubt?.key?.join() === one.key?.join();
  const ids = [...new Set([...one.ids, ...(one.partners ?? []).slice(0, 1)])];
  return h("button", { class: `item${one.looked ? " looked" : ""}`, "aria-current": current ? "true" : null, onclick: () => choose(one), "data-key": one.key.join() },
    h("span", { class: "head" },
      h("span", { class: "kind" }, words(one.kind)),
      ids.slice(0, 5).map((id) => chip(id, { inert: true })),
      one.looked && h("span", { class: `mark ${one.looked}` }, one.looked),
      h("span", { class: "when" }, `${clock(timeOf(one.begin))} · ${one.begin}`)),
    h("span", { class: "head" },
      one.doubt !== undefined && h("span", { class: "doubt", title: `doubt ${one.doubt.toFixed(2)}` }, h("i", { style: { width: `${100 * one.doubt}%` } })),
      h("span", { class: "why" }, one.why || (one.zone ? `zone ${one.zone}` : ""))));
}
