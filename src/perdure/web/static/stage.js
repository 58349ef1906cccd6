// The film, one view or two side by side: drawing, picking, zooming. Both views show the same frame and the same part.

import { paintGrid, paintKnob, paintRows, paintTrails, paintZone } from "./draw.js";
import { byId, h, put } from "./dom.js";
import { frameNow, on, placeOf, set, state } from "./store.js";

const MOST_ZOOM = 12, NEAR = 9; // px on screen: so near a point is grasped
const REACH = 12; // s: of a dragged playhead, so far off a frame is shown instead of one that must be decoded

export class Stage {
  // `layers` gives for each view { title, film, layer } ; `tools` are those that take clicks before tracks do.
  constructor(layers) {
    this.layers = layers;
    this.views = [];
    this.zoom = 1;
    this.centre = null;
    this.tool = null; // { press(point, event), drag(point), lift(), double(point), hover(point), cursor }
    this._due = false;
    new ResizeObserver(() => this.redraw()).observe(byId("stage"));
    on("events dragging at selected partner hovered boxes shapes trails labels unseen zones ground tab follow", () => this.redraw());
    this.rebuild();
  }

  rebuild() {
    this.views = this.layers().map((one) => this._view(one));
    put(byId("stage"), this.views.map((view) => view.place));
    this.redraw();
  }

  whole() {
    this.zoom = 1;
    this.centre = null;
    this.redraw();
  }

  redraw() {
    if (this._due) return;
    this._due = true;
    requestAnimationFrame(() => {
      this._due = false;
      for (const view of this.views) this._paint(view);
    });
  }

  _view(one) {
    const canvas = h("canvas", { tabindex: "0", role: "img", "aria-label": `Film, ${one.title}` });
    const title = h("div", { class: "title" }, this.layers().length > 1 ? one.title : "");
    const said = h("div", { class: "said" });
    const view = { ...one, canvas, said, place: h("div", { class: "view" }, canvas, title, said), shownFrame: -1 };
    canvas.addEventListener("pointerdown", (event) => this._press(view, event));
    canvas.addEventListener("pointermove", (event) => this._move(view, event));
    canvas.addEventListener("pointerup", (event) => this._lift(view, event));
    canvas.addEventListener("pointerleave", () => set({ hovered: 0 }));
    canvas.addEventListener("dblclick", (event) => (this.tool ? this.tool.double?.(this._point(view, event)) : this.whole()));
    canvas.addEventListener("wheel", (event) => this._wheel(view, event), { passive: false });
    return view;
  }

  // From picture to screen.
  _to(view) {
    const { width, height } = state.about, box = view.canvas;
    const wide = box.clientWidth, high = box.clientHeight;
    const fit = Math.min(wide / width, high / height) || 1, scale = fit * this.zoom;
    const [cx, cy] = this.centre ?? [width / 2, height / 2];
    const held = (middle, size, room) => (size * scale <= room ? (room - size * scale) / 2 : Math.min(0, Math.max(room - size * scale, room / 2 - middle * scale)));
    return { scale, x: held(cx, width, wide), y: held(cy, height, high), top: 0, wide, high };
  }

  _paint(view) {
    const { canvas } = view, ratio = devicePixelRatio || 1;
    const wide = Math.round(canvas.clientWidth * ratio), high = Math.round(canvas.clientHeight * ratio);
    if (!wide || !high || !state.about) return;
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    const ctx = canvas.getContext("2d");
    let frame = frameNow(), picture = view.film.want(frame, view.soon?.() ?? [], state.dragging);
    if (!picture && state.dragging) {
      const near = view.film.nearest(frame, REACH * state.about.fps); // with its own boxes, until the playhead rests
      if (near >= 0) [frame, picture] = [near, view.film.picture(near)];
    }
    const why = view.film.wrong || view.film.problem.get(frame) || "";
    if (!picture && !why && state.frames.length) return; // until it is there the last one stays, with its own boxes
    const rows = view.layer.rowsAt(frame), ready = view.layer.ready(frame) || !state.frames.length;
    if (!ready && view.shownFrame >= 0 && state.playing) return;
    if (state.follow && state.selected) this._follow(rows);
    const to = this._to(view), { width, height } = state.about;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, to.wide, to.high);
    ctx.imageSmoothingQuality = "high";
    if (picture) ctx.drawImage(picture, to.x, to.y, width * to.scale, height * to.scale);
    else this._blank(ctx, to, width, height);
    view.said.textContent = !picture && why ? `no picture: ${why}` : "";
    if (why && view.film.wrong) view.said.style.top = "92%";
    this._overlay(ctx, to, view, rows, frame);
    view.shownFrame = frame;
    canvas.dataset.frame = frame;
    canvas.dataset.rows = ready && state.standing && state.events ? rows.length : "";
  }

  _overlay(ctx, to, view, rows, frame) {
    const { width, height } = state.about;
    ctx.save();
    ctx.beginPath();
    ctx.rect(to.x - 1, to.y - 1, width * to.scale + 2, height * to.scale + 2);
    ctx.clip();
    if (state.tab === "ground" && state.ground) {
      paintGrid(ctx, to, state.ground.grid);
      state.ground.points.forEach((point, k) => paintKnob(ctx, to, point, "rgb(120 200 235)", "ABCD"[k]));
    }
    if (state.zones && (state.tab === "zones" || state.zones.always)) {
      for (const zone of state.zones.list) paintZone(ctx, to, zone, state.tab === "zones" && zone === state.zones.chosen, false);
      if (state.zones.drawing) paintZone(ctx, to, state.zones.drawing, true, true);
    }
    ctx.restore();
    const editing = state.tab === "zones" || state.tab === "ground";
    ctx.globalAlpha = editing ? 0.5 : 1;
    if (state.trails) paintTrails(ctx, to, view.layer, state.frames, state.times, frame === frameNow() ? state.at : placeOf(frame), null);
    paintRows(ctx, to, rows, {
      shapes: state.shapes ? view.layer.shapesAt(frame, !state.dragging) : null, options: state, hovered: state.hovered,
      selected: view.main ? state.selected : 0, partner: view.main ? state.partner : 0,
    });
    ctx.globalAlpha = 1;
  }

  _blank(ctx, to, width, height) {
    const light = document.documentElement.dataset.theme === "light";
    ctx.fillStyle = light ? "#eceff3" : "#1a1d23";
    ctx.fillRect(to.x, to.y, width * to.scale, height * to.scale);
  }

  _follow(rows) {
    const row = rows.find((one) => one.id === state.selected);
    if (!row) return;
    this.zoom = Math.max(this.zoom, 2);
    this.centre = [(row.x1 + row.x2) / 2, (row.y1 + row.y2) / 2];
  }

  // Pointing ----------------------------------------------------------------------------------------------------

  _point(view, event) {
    const box = view.canvas.getBoundingClientRect(), to = this._to(view);
    return { x: (event.clientX - box.left - to.x) / to.scale, y: (event.clientY - box.top - to.y) / to.scale, near: NEAR / to.scale };
  }

  // The smallest box that holds a point: of two people the one in front is rarely the larger.
  _rowAt(view, { x, y }) {
    const rows = view.layer.rowsAt(frameNow()).filter((one) => !one.isGroup && one.x1 <= x && x <= one.x2 && one.y1 <= y && y <= one.y2);
    return rows.sort((a, b) => (a.x2 - a.x1) * (a.y2 - a.y1) - (b.x2 - b.x1) * (b.y2 - b.y1))[0];
  }

  _press(view, event) {
    const point = this._point(view, event);
    view.canvas.setPointerCapture(event.pointerId);
    if (this.tool && event.button === 0 && this.tool.press(point, event)) {
      this._grasp = "tool";
      return;
    }
    this._grasp = { x: event.clientX, y: event.clientY, centre: this.centre ?? [state.about.width / 2, state.about.height / 2], moved: false };
  }

  _move(view, event) {
    const point = this._point(view, event);
    if (this._grasp === "tool") return this.tool?.drag?.(point);
    if (this._grasp) {
      const dx = event.clientX - this._grasp.x, dy = event.clientY - this._grasp.y;
      if (this._grasp.moved || Math.hypot(dx, dy) > 4) {
        const { scale } = this._to(view);
        this._grasp.moved = true;
        if (this.zoom > 1) this.centre = this._held([this._grasp.centre[0] - dx / scale, this._grasp.centre[1] - dy / scale]);
        this.redraw();
      }
      return undefined;
    }
    if (this.tool) this.tool.hover?.(point);
    const row = this.tool ? null : this._rowAt(view, point);
    view.canvas.style.cursor = this.tool?.cursor ?? (row && view.main ? "pointer" : this.zoom > 1 ? "grab" : "default");
    if (view.main) set({ hovered: row?.id ?? 0 });
    return undefined;
  }

  _lift(view, event) {
    const grasp = this._grasp;
    this._grasp = null;
    if (grasp === "tool") return this.tool?.lift?.();
    if (!grasp || grasp.moved || this.tool || !view.main) return undefined;
    const row = this._rowAt(view, this._point(view, event));
    if (event.shiftKey && row && state.selected && row.id !== state.selected) set({ partner: row.id });
    else set({ selected: row?.id ?? 0, partner: 0 });
    return undefined;
  }

  _wheel(view, event) {
    event.preventDefault();
    const before = this._point(view, event), old = this.zoom;
    this.zoom = Math.min(MOST_ZOOM, Math.max(1, this.zoom * Math.exp(-event.deltaY * 0.0016)));
    if (this.zoom === 1) this.centre = null;
    else {
      const [cx, cy] = this.centre ?? [state.about.width / 2, state.about.height / 2], part = old / this.zoom;
      this.centre = this._held([before.x + (cx - before.x) * part, before.y + (cy - before.y) * part]);
    }
    this.redraw();
  }

  _held([x, y]) {
    const { width, height } = state.about;
    return [Math.min(width, Math.max(0, x)), Math.min(height, Math.max(0, y))];
  }
}
