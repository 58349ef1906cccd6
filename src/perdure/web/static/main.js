// The page put together.

import { ask } from "./api.js";
import * as card from "./card.js";
import { byId, h, icon, put, toast } from "./dom.js";
import * as doubts from "./doubts.js";
import * as ground from "./ground.js";
import * as keys from "./keys.js";
import { Film } from "./pictures.js";
import { Player } from "./player.js";
import * as repair from "./repair.js";
import { Layer } from "./rows.js";
import * as score from "./score.js";
import { Stage } from "./stage.js";
import { frameNow, on, set, state } from "./store.js";
import { Timeline } from "./timeline.js";
import * as tracks from "./tracks.js";
import * as zones from "./zones.js";

const films = new Map(), layers = new Map();
let stage = null, player = null, timeline = null;

const redraw = () => stage?.redraw();
const film = (run) => made(films, run, () => new Film(run, state.session.runs[run], redraw));
const layer = (run = state.run) => made(layers, run, () => new Layer(`runs/${run}`, { changed: () => { redraw(); if (run === state.run) timeline?.redraw(); } }));
const truth = () => made(layers, `truth ${state.run}`, () => new Layer(`runs/${state.run}/truth`, { shapes: false, changed: redraw }));

function made(kept, key, make) {
  if (!kept.has(key)) kept.set(key, make());
  return kept.get(key);
}

function views() {
  const main = { title: state.about.name, film: film(state.run), layer: layer(), main: true, soon: () => player?.soon() ?? [] };
  if (!state.beside) return [main];
  if (state.beside === "truth") return [main, { title: `truth: ${state.about.truth}`, film: film(state.run), layer: truth(), main: false, soon: main.soon }];
  const other = Number(state.beside), about = state.session.runs[other];
  const same = about.source === state.about.source;
  return [main, { title: about.name, film: film(same ? state.run : other), layer: layer(other), main: false, soon: main.soon }];
}

// Asking how things stand ---------------------------------------------------------------------------------------

let standingTimer = 0, asked = -1;
async function look() {
  clearTimeout(standingTimer);
  let wait = 15000;
  try {
    const standing = await ask(`runs/${state.run}/state`);
    if (standing.edition !== asked) await take(standing);
    set({ standing });
    if (!standing.saved) wait = 700;
    if (standing.live || !standing.complete) wait = 900;
  } catch (error) {
    put(byId("notes"), h("p", { class: "bad" }, error.message));
  }
  standingTimer = setTimeout(look, wait);
}

async function take(standing) {
  const run = state.run, atEnd = state.standing?.live && state.at === state.frames.length - 1 && !state.playing;
  const grown = standing.frames !== state.frames.length || asked < 0;
  asked = standing.edition;
  if (grown) {
    const { frames, times } = await ask(`runs/${run}/frames`); // first: with them the film can be shown
    if (run !== state.run) return;
    set({ frames, times });
  }
  const [told, events] = await Promise.all([ask(`runs/${run}/tracks`), ask(`runs/${run}/events`)]);
  if (run !== state.run) return;
  layer().take(told);
  const doubt = state.doubt && [...events.doubts, ...events.events].find((one) => one.key.join() === state.doubt.key?.join());
  set({ events, doubt: doubt ?? null, ...(atEnd ? { at: state.frames.length - 1 } : {}) });
  if (state.tab === "tracks") tracks.draw();
}

repair.afterwards(async () => {
  asked = -1;
  await look();
});

// The bar above -------------------------------------------------------------------------------------------------

function drawBar() {
  const { runs } = state.session, { about, standing, events } = state;
  put(byId("which"), runs.length > 1
    ? h("select", { "aria-label": "Run", onchange: (event) => show(Number(event.target.value)) }, runs.map((one, k) => h("option", { value: k, selected: k === state.run }, one.name)))
    : h("span", { class: "name", title: about.path }, about.name));
  const words = [about.tracker, `${standing?.frames ?? 0} frames`, `${layer().order.filter((id) => !layer().tracks.get(id).group).length} ids`];
  put(byId("standing"), standing?.live && h("span", { class: "live" }, "● running "), standing && !standing.complete && "reading… ", words.filter(Boolean).join(" · "),
    standing?.corrections ? ` · ${standing.corrections} corrected` : "", standing && !standing.saved ? " · saving…" : "");
  const open = events?.open ?? 0, all = events?.doubtful ?? 0;
  byId("left-to-look").className = `left-to-look ${open ? "open" : "none"}`;
  put(byId("left-to-look"), events ? (open ? `${open} doubtful left` : all ? "all doubts looked at" : "nothing doubtful") : "…",
    all > 0 && h("span", { class: "meter", title: `${all - open} of ${all} looked at` }, h("i", { style: { width: `${(100 * (all - open)) / all}%` } })));
  byId("left-to-look").title = "Go to the next doubt (N)";
  for (const [name, label, key] of [["undo", "Undo", "Ctrl+Z"], ["redo", "Redo", "Ctrl+Shift+Z"]]) {
    byId(name).disabled = !standing?.[name] || !state.session.writable;
    byId(name).title = standing?.[name] ? `${label}: ${standing[name]} (${key})` : label;
  }
  const notes = [...(standing?.notes ?? [])];
  if (!state.session.writable) notes.push("Read only: to correct or to draw, open the address that `perdure view` printed.");
  put(byId("notes"), notes.map((one) => h("p", {}, one)));
}

function drawTabs() {
  const left = state.events?.open;
  const names = [["doubts", "Doubts", left], ["tracks", "Tracks"], ...(state.about.truth ? [["score", "Score"]] : []), ["zones", "Zones"], ["ground", "Ground"]];
  put(byId("tabs"), names.map(([name, label, count], k) => h("button", {
    role: "tab", "aria-selected": String(state.tab === name), title: `${label} (${k + 1})`, onclick: () => set({ tab: name }),
  }, label, count ? h("span", { class: "count" }, count) : null)));
}

const drawPanel = () => ({ doubts, tracks, score, zones, ground })[state.tab].draw();

function drawBeside() {
  const others = state.session.runs.map((one, k) => [String(k), one.name]).filter(([k]) => Number(k) !== state.run);
  const choices = [["", "nothing"], ...(state.about.truth ? [["truth", "the truth"]] : []), ...others];
  put(byId("beside"), choices.map(([value, label]) => h("option", { value, selected: value === state.beside }, label)));
  byId("beside").disabled = choices.length < 2;
}

async function beside(value) {
  set({ beside: value });
  drawBeside();
  stage.rebuild();
  try {
    if (value === "truth") await truth().load();
    else if (value !== "") await layer(Number(value)).load();
  } catch (error) {
    toast(error.message, { bad: true });
  }
  redraw();
}

async function show(run) {
  asked = -1;
  set({ run, about: state.session.runs[run], frames: [], times: [], at: 0, selected: 0, partner: 0, doubt: null, events: null, score: null, standing: null, playing: false, beside: "" });
  drawBeside();
  stage?.rebuild();
  stage?.whole();
  await look();
}

// Light and dark, sizes -----------------------------------------------------------------------------------------

function theme(choice) {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const now = choice ?? localStorage.getItem("perdure-theme") ?? (dark ? "dark" : "light");
  document.documentElement.dataset.theme = now;
  if (choice) localStorage.setItem("perdure-theme", choice);
  timeline?.redraw();
  redraw();
}

function sizing() {
  const handle = byId("handle"), set_ = (high) => {
    const held = Math.min(Math.max(90, high), innerHeight * 0.6);
    document.documentElement.style.setProperty("--timeline", `${held}px`);
    localStorage.setItem("perdure-timeline", held);
  };
  set_(Number(localStorage.getItem("perdure-timeline")) || Math.round(innerHeight * 0.26));
  handle.addEventListener("pointerdown", (event) => handle.setPointerCapture(event.pointerId));
  handle.addEventListener("pointermove", (event) => handle.hasPointerCapture(event.pointerId) && set_(innerHeight - event.clientY));
  handle.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 20, ArrowDown: -20 }[event.key];
    if (by) set_(byId("timeline").clientHeight + by);
    if (by) event.preventDefault();
  });
}

// Keys ----------------------------------------------------------------------------------------------------------

function shortcuts() {
  const flip = (name) => () => set({ [name]: !state[name] });
  const tab = (k) => () => byId("tabs").children[k]?.click();
  const chosen = (run) => () => (state.selected ? run() : toast("Select an id first: click a person, or a lane of the timeline"));
  const both = (run) => chosen(() => (state.partner ? run() : toast("Choose the other id: Shift-click it")));
  const loose = () => ["appeared", "lost"].includes(state.doubt?.kind);
  const joins = () => {
    const [one, other] = [state.selected, state.partner];
    return loose() && state.doubt.kind === "lost" && state.doubt.ids[0] === one ? repair.join(other, one) : repair.join(one, other);
  };
  const right = async () => {
    if (state.doubt && state.doubt.doubt !== undefined && !state.doubt.looked) await repair.confirm(state.doubt);
    doubts.step(1);
  };
  const sections = [
    ["Playing", [
      ["Space", "Play, pause", () => player.toggle()],
      ["← / →", "One frame back, on", (event) => player.step(event.key === "ArrowLeft" ? -1 : 1), ["ArrowLeft", "ArrowRight"]],
      ["Shift+← / Shift+→", "One second back, on", (event) => player.skip(event.key === "ArrowLeft" ? -1 : 1), ["Shift+ArrowLeft", "Shift+ArrowRight"]],
      ["Home / End", "First, last frame", (event) => player.seek(event.key === "Home" ? 0 : 1e12), ["Home", "End"]],
      ["[ / ]", "Slower, faster", (event) => player.faster(event.key === "[" ? -1 : 1), ["[", "]"]],
    ]],
    ["Doubts and events", [
      ["N / P", "Next, previous doubt", (event) => doubts.step(event.key.toLowerCase() === "n" ? 1 : -1), ["n", "p"]],
      ["E / Shift+E", "Next, previous event", (event) => doubts.stepEvent(event.shiftKey ? -1 : 1, frameNow()), ["e", "Shift+e"]],
      ["A", "It is right; next doubt", right, "a"],
      ["R", "Play around the doubt", () => state.doubt && player.around(state.doubt.begin, state.doubt.end), "r"],
    ]],
    ["Repair", [
      ["S", "Swap the two ids from here on", both(() => repair.swap(state.selected, state.partner)), "s"],
      ["Shift+S", "Swap them up to here", both(() => repair.swap(state.selected, state.partner, { begin: 0, end: frameNow() })), "Shift+s"],
      ["J", "Join the id into the other", both(joins), "j"],
      ["C", "Cut: a new id from here on", chosen(() => repair.cut(state.selected)), "c"],
      ["Del", "Delete the id", chosen(() => repair.remove(state.selected)), ["Delete", "d"]],
      ["Shift+Del", "Delete it from here on", chosen(() => repair.remove(state.selected, { begin: frameNow() })), ["Shift+Delete", "Shift+d"]],
      ["Ctrl+Z / Ctrl+Shift+Z", "Undo, redo", (event) => (event.shiftKey ? repair.redo() : repair.undo()), ["Ctrl+z", "Ctrl+Shift+z"]],
    ]],
    ["What is seen", [
      ["F", "Follow the id", flip("follow"), "f"],
      ["B", "Boxes", flip("boxes"), "b"],
      ["M", "Silhouettes and contours", flip("shapes"), "m"],
      ["T", "Trails", flip("trails"), "t"],
      ["I", "Ids", flip("labels"), "i"],
      ["U", "Who is not seen", flip("unseen"), "u"],
      ["V", "Truth or another run beside", () => { const { options } = byId("beside"); beside(state.beside ? "" : options[1]?.value ?? ""); }, "v"],
      ["0", "The whole picture", () => { set({ follow: false }); stage.whole(); }, "0"],
    ]],
    ["Page", [
      ["1 … 5", "Tabs", (event) => tab(Number(event.key) - 1)(), ["1", "2", "3", "4", "5"]],
      ["L", "Light, dark", () => byId("theme").click(), "l"],
      ["Enter", "Close the zone that is drawn", () => zones.finish(), "Enter"],
      ["Esc", "Let go of what is selected", () => zones.cancel() || set({ selected: 0, partner: 0, doubt: null, follow: false }), "Escape"],
      ["?", "This page", () => keys.show(sections), "?"],
    ]],
  ];
  keys.listen(sections);
}

// Beginning -----------------------------------------------------------------------------------------------------

async function begin() {
  theme();
  sizing();
  set({ session: await ask("session") });
  set({ about: state.session.runs[0] });
  stage = new Stage(views);
  player = new Player((frame) => film(state.run).has(frame) && layer().ready(frame));
  timeline = new Timeline(() => layer(), (at) => player.seek(at), (one) => doubts.choose(one));
  doubts.begin(player);
  tracks.begin(() => layer(), player);
  card.begin(() => layer(), player, doubts.step);
  score.begin(player);
  zones.begin(stage);
  ground.begin(stage);
  for (const name of ["undo", "redo"]) {
    put(byId(name), icon(name));
    byId(name).addEventListener("click", repair[name]);
  }
  put(byId("theme"), icon("theme"));
  byId("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  byId("left-to-look").addEventListener("click", () => { set({ tab: "doubts" }); doubts.step(1); });
  byId("beside").addEventListener("change", (event) => beside(event.target.value));
  on("standing events frames about", drawBar);
  on("frames", redraw);
  on("events tab about", drawTabs);
  on("tab", drawPanel);
  on("selected", () => state.selected && timeline.reveal(state.selected));
  on("at", () => state.playing && layer().ahead(frameNow() + 40));
  shortcuts();
  drawBeside();
  drawTabs();
  drawBar();
  doubts.draw();
  await show(0);
  performance.mark("perdure-shown");
}

begin().catch((error) => put(byId("notes"), h("p", { class: "bad" }, error.message)));
