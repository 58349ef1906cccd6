// How the run scores against its truth as it is corrected now, and where the two part.

import { ask } from "./api.js";
import { chip, words } from "./chips.js";
import { byId, h, put } from "./dom.js";
import * as repair from "./repair.js";
import { on, set, state } from "./store.js";

const SHARES = new Set(["HOTA", "DetA", "AssA", "MOTA", "IDF1", "IDP", "IDR"]);
const LOWER_IS_BETTER = new Set(["IDSW", "Frag", "FP", "FN"]);
const ABOUT = { IDSW: "identity switches", Frag: "fragmentations", FP: "false rows", FN: "missed rows", IDP: "identity precision", IDR: "identity recall" };
const SHORT = 25; // frames: so long a fault may be mended in its own frames alone
let player = null, kind = "identity", first = null, wrong = "", chosen = null;

export function begin(thePlayer) {
  player = thePlayer;
  on("tab events run", () => state.tab === "score" && load());
  on("score", () => state.tab === "score" && draw());
  on("run", () => (first = null));
}

async function load() {
  if (!state.about.truth) return;
  const run = state.run;
  if (!state.score) draw();
  try {
    const told = await ask(`runs/${run}/truth/score`);
    if (run !== state.run) return;
    first ??= told.figures;
    wrong = "";
    set({ score: told });
  } catch (error) {
    wrong = error.message;
  }
  if (state.tab === "score") draw();
}

const listed = () => (state.score?.mistakes ?? []).filter((one) => kind === "all" || (kind === "identity" ? one.kind === "exchange" || one.kind === "switch" || one.kind === "resolution" : one.kind === kind));

// What may mend a fault: [words, action]. Of an exchange the page cannot know which part is right; who looks can.
function mendings(fault) {
  const { ids, kind: what, begin: from, cost } = fault;
  if (ids.length === 2 && (what === "exchange" || what === "switch")) {
    const swap = (when) => () => repair.swap(ids[0], ids[1], when, {});
    const both = ["Swap ", chip(ids[0], { inert: true }), " ", chip(ids[1], { inert: true })];
    const offers = [[[both, ` from ${from}`], swap({ begin: from })], [`before ${from}`, swap({ begin: 0, end: from - 1 })]];
    if (cost <= SHORT) offers.push([cost === 1 ? `only in ${from}` : `only ${from}–${from + cost - 1}`, swap({ begin: from, end: from + cost - 1 })]);
    return offers;
  }
  if (what === "invented") return [[["Delete ", chip(ids[0], { inert: true })], () => repair.remove(ids[0], {}, {})]];
  return [];
}

export function draw() {
  const { score } = state;
  if (!score) return void put(byId("panel"), h("div", { class: "empty" }, wrong || "Scoring…"));
  const figures = Object.entries(score.figures).map(([name, value]) => {
    const before = first?.[name] ?? value, gain = value - before, better = LOWER_IS_BETTER.has(name) ? gain < 0 : gain > 0;
    const shown = SHARES.has(name) ? (100 * value).toFixed(1) : String(value);
    const change = SHARES.has(name) ? (100 * gain).toFixed(1) : String(gain);
    return h("div", { title: ABOUT[name] ?? "" }, h("dt", {}, name), h("dd", {}, shown, Math.abs(gain) > (SHARES.has(name) ? 0.0005 : 0) && h("small", { class: better ? "up" : "down" }, `${gain > 0 ? "+" : ""}${change}`)));
  });
  const kinds = [["identity", "Identity"], ...Object.keys(score.counts).map((one) => [one, words(one)]), ["all", "All"]];
  const choice = h("select", { "aria-label": "Which mistakes", onchange: (event) => { kind = event.target.value; draw(); } },
    kinds.map(([name, label]) => h("option", { value: name, selected: name === kind }, label)));
  const faults = listed();
  put(byId("panel"),
    h("dl", { class: "scores", style: { margin: 0 } }, figures),
    h("div", { class: "toolbar" }, choice, h("span", { class: "spring" }), h("span", { class: "quiet" }, `${faults.length}, worst first`)),
    faults.length ? h("ul", { class: "list" }, faults.map((one) => h("li", {}, item(one)))) : h("div", { class: "empty" }, h("b", {}, "No mistakes of this kind"), `against ${state.about.truth}`));
}

function item(fault) {
  const current = chosen?.text === fault.text && chosen.begin === fault.begin, offers = current && state.session.writable ? mendings(fault) : [];
  const look = () => {
    chosen = fault;
    set({ selected: fault.ids[0] ?? 0, partner: fault.ids[1] ?? 0, playing: false, doubt: null });
    player.seekFrame(fault.begin);
    draw();
    byId("panel").querySelector(".mending")?.scrollIntoView({ block: "nearest" });
  };
  return [
    h("button", { class: "item", "aria-current": current ? "true" : null, onclick: look },
      h("span", { class: "head" }, h("span", { class: "kind" }, words(fault.kind)), fault.ids.map((id) => chip(id, { inert: true })), h("span", { class: "when" }, `frame ${fault.begin} · ${fault.cost} rows`)),
      h("span", { class: "why" }, fault.text)),
    offers.length > 0 && h("div", { class: "actions mending" }, offers.map(([label, run], k) => h("button", { class: k ? "mend" : "mend primary", onclick: run }, label))),
  ];
}
