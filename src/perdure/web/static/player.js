// Where we are in the film: playing, stepping, seeking; every frame in its turn, none left out below double speed.

import { byId, h, icon, put } from "./dom.js";
import { clock, frameNow, on, placeOf, set, state, timeNow } from "./store.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const AHEAD = 12; // frames fetched ahead

export class Player {
  // `ready(frame)` says whether a frame can be shown.
  constructor(ready) {
    this.ready = ready;
    this.until = null; // place at which playing ends by itself
    this._last = 0;
    on("playing", () => this._playing());
    on("at playing speed frames follow boxes shapes trails", () => this.draw());
    this._build();
  }

  seek(at) {
    set({ at: Math.min(Math.max(0, Math.round(at)), Math.max(0, state.frames.length - 1)) });
  }

  seekFrame(frame) {
    this.seek(placeOf(frame));
  }

  step(frames) {
    set({ playing: false });
    this.until = null;
    this.seek(state.at + frames);
  }

  skip(seconds) {
    const wanted = timeNow() + seconds, rate = state.about.fps;
    let at = Math.min(Math.max(0, state.at + Math.round(seconds * rate)), state.frames.length - 1);
    while (at > 0 && state.times[at] > wanted + 1e-6) at--;
    while (at < state.frames.length - 1 && state.times[at] < wanted - 1e-6) at++;
    this.seek(at);
  }

  toggle() {
    this.until = null;
    if (!state.playing && state.at >= state.frames.length - 1) this.seek(0);
    set({ playing: !state.playing });
  }

  // Plays from some seconds before a frame to some after it.
  around(begin, end, seconds = 1.5) {
    const rate = state.about.fps;
    this.seek(placeOf(begin) - Math.round(seconds * rate));
    this.until = Math.min(state.frames.length - 1, placeOf(end) + Math.round(seconds * rate));
    set({ playing: true });
  }

  faster(step) {
    const place = SPEEDS.indexOf(state.speed);
    set({ speed: SPEEDS[Math.min(Math.max(0, place + step), SPEEDS.length - 1)] });
  }

  // What will be wanted soon, in the order in which it will be.
  soon() {
    const { at, frames } = state, stride = state.playing ? Math.max(1, Math.round(state.speed / 2)) : 1;
    const coming = [];
    for (let k = 1; k <= (state.playing ? AHEAD : 3); k++) if (at + k * stride < frames.length) coming.push(frames[at + k * stride]);
    if (!state.playing && at) coming.push(frames[at - 1]);
    return coming;
  }

  _playing() {
    this._last = performance.now();
    if (state.playing) requestAnimationFrame((now) => this._tick(now));
  }

  _tick(now) {
    if (!state.playing) return;
    const { at, times, frames, speed } = state, elapsed = ((now - this._last) / 1000) * speed;
    let next = at;
    while (next + 1 < frames.length && times[next + 1] - times[at] <= elapsed + 1e-4) next++;
    if (speed <= 2 && next > at + 1) next = at + 1; // rather slower than with frames left out
    if (this.until !== null && next >= this.until) {
      this.seek(this.until);
      this.until = null;
      set({ playing: false });
      return;
    }
    if (next > at) {
      if (this.ready(frames[next])) {
        this._last = next === at + 1 ? Math.max(this._last + ((times[next] - times[at]) / speed) * 1000, now - 100) : now;
        this.seek(next);
      } else this._last = Math.max(this._last, now - 1000 / 20);
    } else if (at >= frames.length - 1) {
      if (!state.standing?.live) return void set({ playing: false });
      this._last = now;
    }
    requestAnimationFrame((later) => this._tick(later));
  }

  _build() {
    const button = (name, label, run) => h("button", { class: "icon", "aria-label": label, title: label, onclick: run }, icon(name));
    this.play = h("button", { class: "icon primary", "aria-label": "Play (Space)", onclick: () => this.toggle() });
    this.box = h("input", { type: "text", inputmode: "numeric", class: "frame", "aria-label": "Frame", size: 6 });
    this.box.addEventListener("change", () => /^\d+$/.test(this.box.value.trim()) && this.seekFrame(Number(this.box.value)));
    this.box.addEventListener("keydown", (event) => event.key === "Enter" && this.box.blur());
    this.time = h("span", { class: "clock" });
    this.speed = h("select", { "aria-label": "Speed", onchange: () => set({ speed: Number(this.speed.value) }) },
      SPEEDS.map((one) => h("option", { value: one }, `${one}×`)));
    const layer = (name, label, key) => {
      const made = h("button", { title: `${label} (${key})`, onclick: () => set({ [name]: !state[name] }) }, label);
      on(name, () => made.setAttribute("aria-pressed", state[name]));
      made.setAttribute("aria-pressed", state[name]);
      return made;
    };
    put(byId("transport"),
      button("first", "First frame (Home)", () => this.seek(0)),
      button("back", "One frame back (←)", () => this.step(-1)),
      this.play,
      button("ahead", "One frame on (→)", () => this.step(1)),
      button("last", "Last frame (End)", () => this.seek(1e12)),
      this.time, this.box, this.speed,
      h("span", { class: "layers", role: "group", "aria-label": "What is drawn" },
        layer("boxes", "Boxes", "B"), layer("shapes", "Silhouettes", "M"), layer("trails", "Trails", "T"),
        layer("labels", "Ids", "I"), layer("unseen", "Unseen", "U"), layer("follow", "Follow", "F")));
    this.draw();
  }

  draw() {
    put(this.play, icon(state.playing ? "pause" : "play"));
    this.play.setAttribute("aria-label", state.playing ? "Pause (Space)" : "Play (Space)");
    if (document.activeElement !== this.box) this.box.value = frameNow();
    const last = state.times.at(-1) ?? 0;
    put(this.time, h("b", {}, clock(timeNow())), h("span", {}, ` / ${clock(last)} · frame`));
    this.speed.value = String(state.speed);
  }
}
