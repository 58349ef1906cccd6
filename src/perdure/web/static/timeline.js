// Everybody over time: a lane for each id, with how well it was seen; merges and splits between lanes; doubts above.

import { colourOf, css, dimmer, readableOn } from "./colours.js";
import { byId, h, put } from "./dom.js";
import { AMBIGUOUS, LOST, OCCLUDED, PARTLY } from "./rows.js";
import { clock, frameNow, on, placeOf, set, state } from "./store.js";

const RULER = 20, DOUBTS = 14, LANE = 15, LABEL = 46, REST = 120, KINDS = new Set(["merge", "split"]);

export class Timeline {
  constructor(layer, seek, choose) {
    this.layer = layer;
    this.seek = seek;
    this.choose = choose; // a doubt
    this.canvas = h("canvas", { tabindex: "0", role: "slider", "aria-label": "Timeline", "aria-valuemin": "0" });
    this.still = null; // all but the playhead, drawn when something changes
    this.from = 0;
    this.to = null; // places that are in view; null for the whole
    this.scroll = 0;
    put(byId("timeline"), this.canvas);
    new ResizeObserver(() => this.redraw()).observe(byId("timeline"));
    on("frames selected partner events doubt hovered", () => this.redraw());
    on("at", () => this._due());
    this._pointing();
  }

  redraw() {
    this.still = null;
    this._due();
  }

  // Brings a lane into view.
  reveal(id) {
    const lane = this._lanes().indexOf(id), high = this._high();
    if (lane < 0) return;
    if (lane * LANE < this.scroll) this.scroll = lane * LANE;
    if ((lane + 1) * LANE > this.scroll + high) this.scroll = (lane + 1) * LANE - high;
    this.redraw();
  }

  _lanes() {
    return this.layer().order.filter((id) => !this.layer().tracks.get(id).group);
  }

  _high() {
    return Math.max(0, this.canvas.clientHeight - RULER - DOUBTS);
  }

  _due() {
    if (this._waiting) return;
    this._waiting = true;
    requestAnimationFrame(() => {
      this._waiting = false;
      this._paint();
    });
  }

  _span() {
    const last = Math.max(1, state.frames.length - 1);
    return [this.from, Math.max(this.from + 1, this.to ?? last)];
  }

  _x(place) {
    const [from, to] = this._span();
    return LABEL + ((place - from) / (to - from)) * (this.canvas.clientWidth - LABEL - 10);
  }

  _place(x) {
    const [from, to] = this._span();
    return from + ((x - LABEL) / (this.canvas.clientWidth - LABEL - 10)) * (to - from);
  }

  _paint() {
    const { canvas } = this, ratio = devicePixelRatio || 1;
    const wide = canvas.clientWidth, high = canvas.clientHeight;
    if (!wide || !high) return;
    if (canvas.width !== Math.round(wide * ratio) || canvas.height !== Math.round(high * ratio)) {
      Object.assign(canvas, { width: Math.round(wide * ratio), height: Math.round(high * ratio) });
      this.still = null;
    }
    if (!this.still) this._paintStill(wide, high, ratio);
    const ctx = canvas.getContext("2d");
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.clearRect(0, 0, canvas.width, canvas.height);
    ctx.drawImage(this.still, 0, 0);
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    const x = Math.round(this._x(state.at)) + 0.5;
    if (x >= LABEL - 1) {
      ctx.strokeStyle = this.look.accent;
      ctx.lineWidth = 1.5;
      ctx.beginPath();
      ctx.moveTo(x, 4);
      ctx.lineTo(x, high);
      ctx.stroke();
      ctx.fillStyle = this.look.accent;
      ctx.beginPath();
      ctx.roundRect(x - 5, 2, 10, 9, 3);
      ctx.fill();
    }
    canvas.setAttribute("aria-valuemax", Math.max(0, state.frames.length - 1));
    canvas.setAttribute("aria-valuenow", state.at);
    canvas.setAttribute("aria-valuetext", `frame ${frameNow()}`);
  }

  _paintStill(wide, high, ratio) {
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim();
    this.look = { text: colour("--text"), quiet: colour("--quiet"), faint: colour("--faint"), line: colour("--line"), panel: colour("--panel"), raised: colour("--raised"), accent: colour("--accent"), chosen: colour("--accent-ground"), warn: colour("--warn"), good: colour("--good") };
    this.still = new OffscreenCanvas(Math.max(1, Math.round(wide * ratio)), Math.max(1, Math.round(high * ratio)));
    const ctx = this.still.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    const lanes = this._lanes();
    this.scroll = Math.max(0, Math.min(this.scroll, lanes.length * LANE - this._high()));
    ctx.save();
    ctx.beginPath();
    ctx.rect(0, RULER + DOUBTS, wide, high);
    ctx.clip();
    const place = new Map(lanes.map((id, k) => [id, RULER + DOUBTS + k * LANE - this.scroll]));
    for (const [id, y] of place) if (y > -LANE && y < high) this._paintLane(ctx, this.layer().tracks.get(id), y, wide);
    this._paintMeetings(ctx, place);
    this._paintLabels(ctx, place, high);
    this._paintScroll(ctx, lanes.length * LANE, wide);
    ctx.restore();
    this._paintRuler(ctx, wide);
    this._paintDoubts(ctx, wide);
  }

  // How far down the lanes go.
  _paintScroll(ctx, whole, wide) {
    const room = this._high();
    if (whole <= room) return;
    ctx.fillStyle = this.look.faint;
    ctx.globalAlpha = 0.6;
    ctx.beginPath();
    ctx.roundRect(wide - 6, RULER + DOUBTS + 2 + (this.scroll / whole) * (room - 4), 4, (room / whole) * (room - 4), 2);
    ctx.fill();
    ctx.globalAlpha = 1;
  }

  _paintLane(ctx, track, y, wide) {
    const chosen = track.id === state.selected || track.id === state.partner;
    if (chosen || track.id === state.hovered) {
      ctx.fillStyle = chosen ? this.look.chosen : this.look.raised;
      ctx.fillRect(0, y, wide, LANE);
    }
    const colour = colourOf(track.id), [from, to] = this._span(), middle = y + LANE / 2;
    for (const { begin, end, status, grouped } of track.spans) {
      const a = placeOf(begin), b = placeOf(end) + 1;
      if (b < from || a > to) continue;
      const x1 = Math.max(LABEL, this._x(a)), x2 = Math.min(wide - 4, Math.max(this._x(b), x1 + 0.75));
      if (x2 <= LABEL) continue;
      if (status === LOST || status === OCCLUDED) {
        ctx.fillStyle = css(dimmer(colour), status === LOST ? 0.5 : 0.95);
        ctx.fillRect(x1, middle - (status === LOST ? 0.5 : 1.25), x2 - x1, status === LOST ? 1 : 2.5);
      } else {
        const tall = status === PARTLY ? 6 : 9;
        ctx.fillStyle = css(colour, status === AMBIGUOUS ? 0.5 : status === PARTLY ? 0.8 : 1);
        ctx.fillRect(x1, middle - tall / 2, x2 - x1, tall);
      }
      if (grouped && x2 - x1 > 1) {
        ctx.fillStyle = css(colour, 0.9);
        ctx.fillRect(x1, y + LANE - 2, x2 - x1, 1);
      }
    }
  }

  _paintMeetings(ctx, place) {
    for (const event of state.events?.events ?? []) {
      if (!KINDS.has(event.kind)) continue;
      const ys = event.ids.map((id) => place.get(id)).filter((y) => y !== undefined);
      const x = this._x(placeOf(event.begin));
      if (ys.length < 2 || x < LABEL || x > this.canvas.clientWidth) continue;
      const lit = event.ids.includes(state.selected);
      ctx.globalAlpha = lit ? 0.95 : state.selected ? 0.18 : 0.4;
      ctx.strokeStyle = lit ? this.look.text : this.look.quiet;
      ctx.fillStyle = event.kind === "merge" ? ctx.strokeStyle : this.look.panel;
      ctx.lineWidth = lit ? 1 : 0.75;
      ctx.beginPath();
      ctx.moveTo(x, Math.min(...ys) + LANE / 2);
      ctx.lineTo(x, Math.max(...ys) + LANE / 2);
      ctx.stroke();
      for (const y of ys) {
        ctx.beginPath();
        ctx.arc(x, y + LANE / 2, lit ? 2.2 : 1.5, 0, 2 * Math.PI);
        ctx.fill();
        ctx.stroke();
      }
      ctx.globalAlpha = 1;
    }
  }

  _paintLabels(ctx, place, high) {
    ctx.fillStyle = this.look.panel;
    ctx.fillRect(0, RULER + DOUBTS, LABEL - 2, high);
    ctx.font = '600 11px system-ui, "DejaVu Sans", sans-serif';
    ctx.textBaseline = "middle";
    for (const [id, y] of place) {
      if (y < -LANE || y > high) continue;
      const chosen = id === state.selected || id === state.partner, text = String(id), across = ctx.measureText(text).width;
      ctx.fillStyle = chosen ? css(colourOf(id)) : this.look.panel;
      ctx.beginPath();
      ctx.roundRect(LABEL - across - 15, y + 1, across + 10, LANE - 2, 3);
      ctx.fill();
      ctx.fillStyle = chosen ? readableOn(colourOf(id)) : this.look.quiet;
      ctx.fillText(text, LABEL - across - 10, y + LANE / 2 + 0.5);
      ctx.fillStyle = css(colourOf(id));
      ctx.fillRect(4, y + 3, 3, LANE - 6);
    }
  }

  _paintRuler(ctx, wide) {
    const [from, to] = this._span(), { times } = state;
    ctx.fillStyle = this.look.panel;
    ctx.fillRect(0, 0, wide, RULER);
    ctx.font = '11px system-ui, "DejaVu Sans", sans-serif';
    ctx.textBaseline = "middle";
    const seconds = (times[Math.min(Math.ceil(to), times.length - 1)] ?? 0) - (times[Math.floor(from)] ?? 0);
    const least = seconds / Math.max(1, (wide - LABEL) / 84);
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800, 3600, 7200].find((one) => one >= least) ?? 14400;
    const begin = Math.ceil((times[Math.floor(from)] ?? 0) / step - 1e-6) * step;
    let place = Math.floor(from);
    for (let time = begin; times.length && time <= (times[Math.min(Math.ceil(to), times.length - 1)] ?? 0) + 1e-6; time += step) {
      while (place < times.length - 1 && times[place] < time - 1e-6) place++;
      const x = Math.round(this._x(place)) + 0.5;
      ctx.strokeStyle = this.look.line;
      ctx.beginPath();
      ctx.moveTo(x, RULER - 6);
      ctx.lineTo(x, RULER);
      ctx.stroke();
      ctx.fillStyle = this.look.faint;
      const text = step < 1 ? clock(time) : clock(time).replace(/\.00$/, "");
      if (x + 4 + ctx.measureText(text).width < wide) ctx.fillText(text, x + 4, RULER / 2 + 1);
    }
    ctx.strokeStyle = this.look.line;
    ctx.beginPath();
    ctx.moveTo(0, RULER + DOUBTS - 0.5);
    ctx.lineTo(wide, RULER + DOUBTS - 0.5);
    ctx.stroke();
  }

  _paintDoubts(ctx, wide) {
    ctx.fillStyle = this.look.faint;
    ctx.fillText("doubts", 4, RULER + DOUBTS / 2 - 1);
    for (const one of state.events?.doubts ?? []) {
      if (!one.doubtful) continue;
      const x = this._x(placeOf(one.begin)), y = RULER + DOUBTS / 2 - 1, chosen = one === state.doubt;
      if (x < LABEL - 2 || x > wide) continue;
      ctx.fillStyle = one.looked ? this.look.good : this.look.warn;
      ctx.beginPath();
      const reach = chosen ? 6 : 4;
      ctx.moveTo(x, y - reach);
      ctx.lineTo(x + reach, y);
      ctx.lineTo(x, y + reach);
      ctx.lineTo(x - reach, y);
      ctx.fill();
      if (chosen) {
        ctx.strokeStyle = this.look.text;
        ctx.stroke();
      }
    }
  }

  // Pointing ----------------------------------------------------------------------------------------------------

  _pointing() {
    const { canvas } = this;
    let grasped = false, rest = 0;
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      const y = event.offsetY, x = event.offsetX;
      const lane = this._lanes()[Math.floor((y - RULER - DOUBTS + this.scroll) / LANE)];
      if (y > RULER && y < RULER + DOUBTS) {
        const near = this._doubtAt(x);
        if (near) return void this.choose(near);
      }
      if (y >= RULER + DOUBTS && lane !== undefined) {
        if (event.shiftKey && state.selected && lane !== state.selected) set({ partner: lane });
        else if (lane !== state.selected) set({ selected: lane, partner: 0 });
        if (x < LABEL) return;
      }
      grasped = true;
      canvas.setPointerCapture(event.pointerId);
      set({ playing: false });
      clearTimeout(rest);
      this.seek(this._place(x));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (grasped) {
        set({ dragging: true });
        clearTimeout(rest);
        rest = setTimeout(() => set({ dragging: false }), REST);
        return void this.seek(this._place(event.offsetX));
      }
      const y = event.offsetY - RULER - DOUBTS + this.scroll;
      set({ hovered: event.offsetY > RULER + DOUBTS ? this._lanes()[Math.floor(y / LANE)] ?? 0 : 0 });
    });
    canvas.addEventListener("pointerup", () => {
      grasped = false;
      set({ dragging: false });
    });
    canvas.addEventListener("pointerleave", () => set({ hovered: 0 }));
    canvas.addEventListener("dblclick", () => this._zoomTo(0, null));
    canvas.addEventListener("wheel", (event) => this._wheel(event), { passive: false });
  }

  _doubtAt(x) {
    const near = (state.events?.doubts ?? []).filter((one) => one.doubtful && Math.abs(this._x(placeOf(one.begin)) - x) < 7);
    return near.sort((a, b) => Math.abs(this._x(placeOf(a.begin)) - x) - Math.abs(this._x(placeOf(b.begin)) - x))[0];
  }

  _wheel(event) {
    event.preventDefault();
    const [from, to] = this._span(), last = Math.max(1, state.frames.length - 1);
    if (event.ctrlKey || event.altKey) {
      const middle = this._place(event.offsetX), part = Math.exp(event.deltaY * 0.003);
      const a = middle - (middle - from) * part, b = middle + (to - middle) * part;
      if (b - a >= last) return void this._zoomTo(0, null);
      if (b - a < 20) return undefined;
      return void this._zoomTo(Math.max(0, a), Math.min(last, b));
    }
    if ((event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) && this.to !== null) {
      const move = Math.max(-from, Math.min(last - to, (event.deltaX || event.deltaY) * (to - from) * 0.001));
      return void this._zoomTo(from + move, to + move);
    }
    this.scroll += event.deltaY;
    this.redraw();
    return undefined;
  }

  _zoomTo(from, to) {
    this.from = from;
    this.to = to;
    this.redraw();
  }
}
