// The ground plane by hand: four points on it and the distances between them, shown as a grid before it is saved.

import { ask, send } from "./api.js";
import { byId, h, put } from "./dom.js";
import { on, set, state, touch } from "./store.js";

const NAMES = ["a", "b", "c", "d"], PAIRS = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]];
let stage = null, problem = "", saved = "", tried = false, held = -1;

export function begin(theStage) {
  stage = theStage;
  on("tab", () => {
    if (state.tab === "ground") {
      stage.tool = tool;
      if (!state.ground) load();
      draw();
    } else if (stage.tool === tool) stage.tool = null;
  });
  on("run", () => set({ ground: null }));
}

async function load() {
  const told = await ask(`runs/${state.run}/calibration`);
  problem = told.note;
  set({ ground: { points: [], lengths: Array(6).fill(""), grid: told.grid, file: told.file, step: told.step ?? 0 } });
  draw();
}

const tool = {
  get cursor() { return (state.ground?.points.length ?? 4) < 4 ? "crosshair" : "default"; },
  press(point) {
    const { ground } = state;
    if (!ground) return false;
    held = ground.points.findIndex(([x, y]) => Math.hypot(x - point.x, y - point.y) < point.near);
    if (held >= 0) return true;
    if (ground.points.length >= 4) return false;
    ground.points.push([point.x, point.y]);
    moved();
    return true;
  },
  drag(point) {
    if (held < 0) return;
    state.ground.points[held] = [point.x, point.y];
    moved();
  },
  lift() {
    held = -1;
    draw();
  },
};

function moved() {
  tried = false;
  saved = "";
  state.ground.grid = [];
  touch("ground");
}

function value() {
  const { points, lengths } = state.ground, round = (one) => Math.round(10 * one) / 10;
  return {
    frame: [state.about.width, state.about.height],
    points: points.map(([x, y], k) => ({ name: NAMES[k], image: [round(x), round(y)] })),
    distances: PAIRS.map(([a, b], k) => [NAMES[a], NAMES[b], Number(lengths[k])]).filter((one) => one[2] > 0),
    tape: 0.05,
    note: "drawn in the viewer",
  };
}

async function say(method) {
  try {
    const told = await send(method, `runs/${state.run}/calibration`, value());
    Object.assign(state.ground, { grid: told.grid, step: told.step });
    problem = "";
    tried = true;
    if (method === "PUT") saved = `Saved in ${told.file}. Track with it: perdure track … --calibration ${told.file}`;
  } catch (error) {
    problem = error.message;
  }
  touch("ground");
  draw();
}

export function draw() {
  const { ground } = state;
  if (!ground) return void put(byId("panel"), h("div", { class: "empty" }, "Reading the ground plane…"));
  const whole = ground.points.length === 4;
  put(byId("panel"),
    h("div", { class: "toolbar" },
      h("button", { id: "try-ground", class: "primary", onclick: () => say("POST") }, "Show the grid"),
      h("button", { id: "save-ground", onclick: () => say("PUT") }, "Save"), h("span", { class: "spring" }),
      h("button", { disabled: !ground.points.length, onclick: () => { ground.points = []; moved(); draw(); } }, "Clear")),
    h("div", { class: "form" }, h("div", { class: "problem", role: "alert" }, problem), saved && h("p", { class: "saved", role: "status" }, saved),
      h("p", {}, whole ? "How far apart are they, in metres? Five of the six will do; the sixth checks them." : `Click four points on the ground, round a large quadrangle: ${["A", "B", "C", "D"][ground.points.length]} is next.`),
      ground.grid.length > 0 && h("p", {}, `The grid has a line every ${ground.step} m. It should lie on the ground like paving.`),
      whole && PAIRS.map(([a, b], k) => {
        const field = h("input", { type: "number", id: `length-${k}`, min: 0, step: "any", value: ground.lengths[k], placeholder: "metres" });
        field.addEventListener("input", () => { ground.lengths[k] = field.value; tried = false; enable(); });
        return h("div", { class: "field" }, h("label", { for: `length-${k}` }, `${"ABCD"[a]} to ${"ABCD"[b]}`), field);
      })));
  enable();
}

function enable() {
  const known = state.ground.lengths.filter((one) => Number(one) > 0).length, { writable } = state.session;
  byId("try-ground").disabled = state.ground.points.length < 4 || known < 5 || !writable;
  byId("save-ground").disabled = !tried || !writable;
}
