// What is selected: a doubt with what can be done about it, an id with its repairs, and why its row is its own.

import { ask } from "./api.js";
import { chip, words } from "./chips.js";
import { byId, h, put } from "./dom.js";
import { STATUS } from "./rows.js";
import * as repair from "./repair.js";
import { clock, frameNow, on, set, state, timeOf } from "./store.js";

let layer = () => null, player = null, doubtsNext = () => {}, reasons = null, asking = 0;

export function begin(theLayer, thePlayer, next) {
  layer = theLayer;
  player = thePlayer;
  doubtsNext = next;
  on("selected partner doubt events standing tab", draw);
  on("at selected playing standing", () => later());
}

// The reason is asked for when one has come to rest on a frame.
let timer = 0;
function later() {
  clearTimeout(timer);
  reasons = null;
  if (!state.selected || state.playing) return drawReasons();
  timer = setTimeout(explain, 180);
  return drawReasons();
}

async function explain() {
  const mine = ++asking, id = state.selected, frame = frameNow();
  try {
    const told = await ask(`runs/${state.run}/explain?id=${id}&frame=${frame}`);
    if (mine === asking) reasons = told;
  } catch (error) {
    if (mine === asking) reasons = { missing: error.message };
  }
  if (mine === asking) drawReasons();
}

export function draw() {
  const hidden = state.tab === "zones" || state.tab === "ground";
  const parts = hidden ? [] : [state.doubt && state.tab !== "score" && doubtBlock(state.doubt), state.selected > 0 && trackBlock(state.selected), h("div", { id: "reasons" })];
  put(byId("card"), parts);
  if (!hidden) drawReasons();
  if (!(state.doubt && state.tab !== "score") && !state.selected) put(byId("card"));
}

const only = (text) => (state.session?.writable ? text : "Open the address that `perdure view` printed to correct");

function action(label, key, run, options = {}) {
  const { title = "", cls = "", children = [] } = options;
  return h("button", { class: cls, disabled: !state.session?.writable || state.standing?.live, title: only(title), onclick: run }, label, children, key && h("kbd", {}, key));
}

function doubtBlock(one) {
  const alone = one.ids[0], others = [...new Set([...(one.partners ?? []), ...one.ids.slice(1)])].filter((id) => id !== alone && layer().tracks.has(id));
  const loose = one.kind === "appeared" || one.kind === "lost";
  const fixes = others.slice(0, 3).map((other, k) => {
    if (loose) {
      const [later, earlier] = one.kind === "appeared" ? [alone, other] : [other, alone];
      return action("Join ", k ? "" : "J", () => repair.join(later, earlier, { event: one.key }), { title: `${later} is ${earlier}: all rows of ${later} become those of ${earlier}`, children: [chip(later, { inert: true }), " into ", chip(earlier, { inert: true })] });
    }
    return action("Swap ", k ? "" : "S", () => repair.swap(alone, other, { begin: one.begin }, { event: one.key }), { title: `From frame ${one.begin} on each has the other's id`, children: [chip(alone, { inert: true }), " ", chip(other, { inert: true })] });
  });
  const next = async () => {
    if (one.key && !one.looked && one.doubt !== undefined) await repair.confirm(one);
    doubtsNext(1);
  };
  return h("div", { class: "block doubt-block" },
    h("h2", {}, words(one.kind), [...new Set([alone, ...one.ids.slice(1)])].filter(Boolean).slice(0, 6).map((id) => chip(id)),
      one.looked && h("span", { class: `mark ${one.looked}` }, one.looked),
      h("span", { class: "when" }, one.begin === one.end ? `frame ${one.begin}` : `frames ${one.begin}–${one.end}`)),
    h("p", {}, one.why || "The tracker gave no reason.", one.doubt !== undefined && h("span", { class: "faint" }, ` · doubt ${one.doubt.toFixed(2)}`)),
    h("div", { class: "actions" },
      one.doubt !== undefined && action("It is right", "A", next, { cls: "primary", title: "Mark as right and go to the next" }),
      fixes,
      h("button", { onclick: () => player.around(one.begin, one.end), title: "Play from 1.5 s before to 1.5 s after" }, "Replay", h("kbd", {}, "R"))));
}

function trackBlock(id) {
  const track = layer().tracks.get(id);
  if (!track) return h("div", { class: "block" }, h("h2", {}, chip(id, { inert: true }), "is not in the results"));
  const partner = state.partner && layer().tracks.has(state.partner) ? state.partner : 0;
  const others = [...layer().order].filter((one) => one !== id && !layer().tracks.get(one).group).sort((a, b) => a - b);
  const choice = h("select", { "aria-label": "The other id", onchange: (event) => set({ partner: Number(event.target.value) }) },
    h("option", { value: 0 }, "…"), others.map((one) => h("option", { value: one, selected: one === partner }, String(one))));
  const here = frameNow();
  return h("div", { class: "block" },
    h("h2", {}, chip(id, { inert: true }), track.name || "", h("span", { class: "when" }, `frames ${track.first}–${track.last} · ${(timeOf(track.last) - timeOf(track.first)).toFixed(1)} s`)),
    h("div", { class: "actions" },
      h("button", { onclick: () => player.seekFrame(track.first), title: "Go to its first frame" }, "First"),
      h("button", { onclick: () => player.seekFrame(track.last), title: "Go to its last frame" }, "Last"),
      h("button", { "aria-pressed": String(state.follow), onclick: () => set({ follow: !state.follow }) }, "Follow", h("kbd", {}, "F")),
      action("Cut here", "C", () => repair.cut(id), { title: "From this frame on it gets a new id" }),
      action("Delete all", "Del", () => repair.remove(id), { cls: "danger", title: "Delete all its rows" }),
      action("Delete from here", "", () => repair.remove(id, { begin: here }), { cls: "danger", title: "Delete its rows from this frame on" })),
    h("div", { class: "actions" },
      h("span", { class: "quiet", style: { alignSelf: "center" } }, "With"), choice,
      action("Swap from here", "S", () => repair.swap(id, partner), { title: partner ? `From this frame on ${id} and ${partner} have each other's id` : "Choose the other id: Shift-click it" }),
      action("up to here", "", () => repair.swap(id, partner, { begin: 0, end: here }), { title: partner ? `Up to this frame ${id} and ${partner} have each other's id` : "Choose the other id: Shift-click it" }),
      action("Join into", "J", () => repair.join(id, partner), { title: partner ? `All rows of ${id} become those of ${partner}` : "Choose the other id: Shift-click it" })));
}

function drawReasons() {
  const place = byId("reasons");
  if (!place) return;
  if (!state.selected || !reasons) return void put(place);
  if (reasons.missing) return void put(place, h("div", { class: "block" }, h("p", {}, reasons.missing)));
  const { link, events } = reasons;
  put(place, h("div", { class: "block" },
    h("h2", {}, "Why", chip(reasons.id, { inert: true }), h("span", { class: "when" }, `frame ${reasons.frame}`)),
    h("p", {}, `${STATUS.includes(reasons.status.replace("_", " ")) ? reasons.status.replace("_", " ") : reasons.status}, confidence ${reasons.confidence.toFixed(2)}${reasons.inferred ? ", filled in: rests on nothing seen" : ""}`),
    link && linkTable(link),
    !link && reasons.explains && h("p", {}, "This row has no scored link."),
    events.length > 0 && h("table", { class: "figures" }, h("tbody", {}, events.slice(0, 6).map((one) => h("tr", {},
      h("td", {}, h("b", {}, words(one.kind)), one.why ? `: ${one.why}` : ""), h("td", { class: "faint" }, String(one.begin))))))));
}

function linkTable(link) {
  const most = Math.max(...Object.values(link.features).map((one) => one.counts), 1e-6);
  const row = ([name, one]) => h("tr", {}, h("td", {}, name.replaceAll("_", " ")), h("td", {}, one.link.toFixed(2)), h("td", {}, one.global.toFixed(2)), h("td", {}, one.weight.toFixed(2)),
    h("td", {}, one.counts.toFixed(2)), h("td", { class: "share" }, h("i", { style: { width: `${(60 * one.counts) / most}px` } })));
  const rival = link.runner_up && `runner-up ${link.runner_up.id}: ${link.runner_up.score.toFixed(2)}`;
  const other = link.other_region && `other region: ${link.other_region.score.toFixed(2)}`;
  return [
    h("table", { class: "figures" },
      h("thead", {}, h("tr", {}, ["feature", "link", "global", "weight", "counts", ""].map((one) => h("th", { scope: "col" }, one)))),
      h("tbody", {}, Object.entries(link.features).map(row),
        Math.abs(link.waned) >= 0.005 && h("tr", {}, h("td", {}, "unseen for a while"), h("td"), h("td"), h("td"), h("td", {}, (-link.waned).toFixed(2)), h("td")),
        h("tr", { class: "sum" }, h("td", {}, "score"), h("td"), h("td"), h("td"), h("td", {}, link.score.toFixed(2)), h("td")))),
    h("p", {}, [rival ?? "no runner-up", other, link.margin !== null && `margin ${link.margin >= 0 ? "+" : ""}${link.margin.toFixed(2)}`].filter(Boolean).join(" · ")),
  ];
}

export const clockOf = (frame) => clock(timeOf(frame));
