// A frame and what is said of it, on a canvas: silhouettes, contours, boxes, trails, labels.
//
// How a row looks says how well it is known, as in the films: solid is seen; a dashed edge is the hidden side of who is
// partly hidden; dashed and dim is hidden; short dashes are lost; dotted with a "?" is one of several in one silhouette;
// corner brackets are round a group.

import { colourOf, css, dimmer, readableOn } from "./colours.js";
import { AMBIGUOUS, LOST, OCCLUDED, PARTLY } from "./rows.js";

const DASHES = { [OCCLUDED]: [7, 5], [LOST]: [3, 7], [AMBIGUOUS]: [1.5, 4] };
const SIDES = { left: 1, top: 2, right: 4, bottom: 8 };
const TRAIL_SECONDS = 3, PIECES = 6;

// `to` maps picture to screen: { scale, x, y }.
export function paintRows(ctx, to, rows, { shapes, options, selected, partner, hovered }) {
  const shown = rows.filter((row) => options.unseen || (row.status !== LOST && row.status !== OCCLUDED));
  const raised = (row) => (row.id === selected || row.id === partner || row.id === hovered ? 1 : 0);
  const order = [...shown].sort((a, b) => raised(a) - raised(b));
  const muted = selected > 0;
  if (options.shapes && shapes) {
    const sheet = sheetOf(shapes);
    for (const row of order) paintShape(ctx, to, row, shapes[row.id], sheet);
  }
  for (const row of order) {
    const lit = raised(row) > 0;
    ctx.globalAlpha = muted && !lit ? 0.62 : 1;
    if (options.boxes || lit) paintBox(ctx, to, row, lit, row.id === selected);
  }
  ctx.globalAlpha = 1;
  const taken = [];
  if (options.labels) for (const row of order.toReversed()) paintLabel(ctx, to, row, rows, raised(row) > 0, muted, taken);
}

function lookOf(row) {
  const colour = colourOf(row.id);
  return row.status === OCCLUDED || row.status === LOST ? dimmer(colour) : colour;
}

function paintBox(ctx, to, row, lit, chosen) {
  const x1 = to.x + row.x1 * to.scale, y1 = to.y + row.y1 * to.scale;
  const x2 = to.x + row.x2 * to.scale, y2 = to.y + row.y2 * to.scale;
  const colour = css(lookOf(row));
  const width = chosen ? 3 : lit ? 2.5 : row.status === LOST ? 1.25 : 1.75;
  if (row.isGroup) return brackets(ctx, x1 - 3, y1 - 3, x2 + 3, y2 + 3, colour, width);
  const dash = DASHES[row.status];
  if (row.status === PARTLY && row.hidden) {
    const edges = [["left", x1, y1, x1, y2], ["top", x1, y1, x2, y1], ["right", x2, y1, x2, y2], ["bottom", x1, y2, x2, y2]];
    for (const [side, ax, ay, bx, by] of edges) {
      stroke(ctx, [[ax, ay], [bx, by]], false, colour, width, row.hidden & SIDES[side] ? DASHES[OCCLUDED] : []);
    }
    return;
  }
  stroke(ctx, [[x1, y1], [x2, y1], [x2, y2], [x1, y2]], true, colour, width, dash ?? []);
}

function stroke(ctx, points, closed, colour, width, dash) {
  ctx.beginPath();
  points.forEach(([x, y], k) => (k ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
  if (closed) ctx.closePath();
  ctx.lineJoin = "round";
  ctx.setLineDash(dash);
  ctx.strokeStyle = "rgb(10 12 16 / .55)";
  ctx.lineWidth = width + 2;
  ctx.stroke();
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.stroke();
  ctx.setLineDash([]);
}

function brackets(ctx, x1, y1, x2, y2, colour, width) {
  const reach = Math.min(14, (x2 - x1) / 3, (y2 - y1) / 3);
  for (const [x, y, dx, dy] of [[x1, y1, 1, 1], [x2, y1, -1, 1], [x2, y2, -1, -1], [x1, y2, 1, -1]]) {
    stroke(ctx, [[x + dx * reach, y], [x, y], [x, y + dy * reach]], false, colour, width, []);
  }
}

const LETTERS = '700 12px system-ui, "Segoe UI", "DejaVu Sans", sans-serif';

function paintLabel(ctx, to, row, rows, lit, muted, taken) {
  if (row.isGroup && !lit) return;
  const text = row.isGroup
    ? `group ${rows.filter((one) => one.group === row.id).map((one) => one.id).join(" ")}`
    : row.status === AMBIGUOUS ? `${row.id}?` : String(row.id);
  ctx.font = LETTERS;
  const wide = ctx.measureText(text).width + 10, high = 17;
  const [x, y] = freePlace(to, row, wide, high, taken);
  const colour = lookOf(row), dim = row.status === OCCLUDED || row.status === LOST;
  ctx.globalAlpha = muted && !lit ? 0.6 : 1;
  ctx.fillStyle = dim ? "rgb(20 23 29 / .85)" : css(colour);
  ctx.beginPath();
  ctx.roundRect(x, y, wide, high, 3);
  ctx.fill();
  ctx.fillStyle = dim ? css(colour) : readableOn(colour);
  ctx.textBaseline = "middle";
  ctx.fillText(text, x + 5, y + high / 2 + 0.5);
  ctx.globalAlpha = 1;
}

// Above the box, below it, or a little aside, where no other label is.
function freePlace(to, row, wide, high, taken) {
  const left = to.x + row.x1 * to.scale, right = to.x + row.x2 * to.scale - wide;
  const above = to.y + row.y1 * to.scale - high - 2, below = to.y + row.y2 * to.scale + 2;
  const free = ([x, y]) => y >= to.top && y + high <= to.high && !taken.some(([a, b, c]) => x < a + c && a < x + wide && Math.abs(y - b) < high);
  const tries = [[left, above], [right, above], [left, below], [right, below], [left, above - high - 2], [right + wide, above], [left - wide, above]];
  const found = (tries.find(free) ?? [left, Math.max(to.top, above)]).map(Math.round);
  taken.push([...found, wide]);
  return found;
}

// Silhouettes ---------------------------------------------------------------------------------------------------

// All silhouettes of a frame are painted once into one sheet, and cut out of it from then on.
const sheets = new WeakMap(); // shapes of a frame -> Map of mask -> { canvas, x, y }

function paintShape(ctx, to, row, shape, sheet) {
  if (!shape) return;
  if (shape.mask) paintMask(ctx, to, shape.mask, sheet);
  if (shape.outline) return paintOutline(ctx, to, row, shape.outline);
  if (shape.believed && row.status !== 0) paintMask(ctx, to, shape.believed, sheet);
}

function paintMask(ctx, to, mask, sheet) {
  const place = sheet.get(mask), [high, wide] = mask.size;
  if (!place) return;
  ctx.drawImage(place.canvas, place.x, place.y, wide, high, to.x + mask.x * to.scale, to.y + mask.y * to.scale, wide * to.scale, high * to.scale);
}

function sheetOf(shapes) {
  let found = sheets.get(shapes);
  if (!found) sheets.set(shapes, (found = madeSheet(shapes)));
  return found;
}

function madeSheet(shapes) {
  const parts = [];
  for (const [id, { mask, believed }] of Object.entries(shapes)) {
    if (mask) parts.push({ id: Number(id), mask, inside: 0.34, edge: 0.95 });
    if (believed) parts.push({ id: Number(id), mask: believed, inside: 0.1, edge: 0.6 });
  }
  const wide = Math.max(512, ...parts.map(({ mask }) => mask.size[1])), found = new Map();
  let x = 0, y = 0, row = 0;
  for (const part of parts.sort((a, b) => a.mask.size[0] - b.mask.size[0])) {
    const [tall, broad] = part.mask.size;
    if (x + broad > wide) [x, y, row] = [0, y + row, 0];
    Object.assign(part, { x, y });
    x += broad;
    row = Math.max(row, tall);
  }
  const high = y + row;
  if (!high || high > 16384) return found;
  const canvas = new OffscreenCanvas(wide, high), image = new ImageData(wide, high), pixels = new Uint32Array(image.data.buffer);
  for (const part of parts) {
    fill(pixels, wide, part);
    found.set(part.mask, { canvas, x: part.x, y: part.y });
  }
  canvas.getContext("2d").putImageData(image, 0, 0);
  return found;
}

// Run lengths go column by column, empty and filled by turns.
function fill(pixels, stride, { id, mask, inside, edge, x: left, y: top }) {
  const [high, wide] = mask.size, bits = new Uint8Array(high * wide), [red, green, blue] = colourOf(id);
  const colour = (alpha) => ((Math.round(255 * alpha) << 24) | (blue << 16) | (green << 8) | red) >>> 0;
  const within = colour(inside), rim = colour(edge);
  let place = 0, filled = 0;
  for (const run of mask.runs) {
    if (filled) bits.fill(1, place, place + run);
    place += run;
    filled = 1 - filled;
  }
  for (let x = 0, k = 0; x < wide; x++) {
    for (let y = 0; y < high; y++, k++) {
      if (!bits[k]) continue;
      const deep = y && y < high - 1 && x && x < wide - 1 && bits[k - 1] && bits[k + 1] && bits[k - high] && bits[k + high];
      pixels[(top + y) * stride + left + x] = deep ? within : rim;
    }
  }
}

function paintOutline(ctx, to, row, outline) {
  ctx.beginPath();
  for (const ring of outline.rings) {
    let x = 0, y = 0;
    for (let k = 0; k < ring.length; k += 2) {
      x += ring[k] / outline.per_pixel;
      y += ring[k + 1] / outline.per_pixel;
      const sx = to.x + x * to.scale, sy = to.y + y * to.scale;
      if (k) ctx.lineTo(sx, sy); else ctx.moveTo(sx, sy);
    }
    ctx.closePath();
  }
  ctx.setLineDash(row.status === OCCLUDED ? [6, 5] : []);
  ctx.strokeStyle = css(lookOf(row));
  ctx.lineWidth = 1.75;
  ctx.stroke();
  ctx.setLineDash([]);
}

// Trails --------------------------------------------------------------------------------------------------------

// Where everybody's feet were in the last seconds; `rowsAt` gives rows by place in `frames`.
export function paintTrails(ctx, to, layer, frames, times, at, only) {
  const points = new Map();
  for (let k = at; k >= 0 && times[at] - times[k] <= TRAIL_SECONDS; k--) {
    if (!layer.ready(frames[k])) break;
    for (const row of layer.rowsAt(frames[k])) {
      if (row.status === LOST || row.isGroup || (only && !only.has(row.id))) continue;
      if (!points.has(row.id)) points.set(row.id, []);
      points.get(row.id).push([(row.x1 + row.x2) / 2, row.y2, k, row.y2 - row.y1]);
    }
  }
  ctx.lineCap = "round";
  for (const [id, line] of points) {
    const now = line[0][2];
    if (at - now > 1) continue;
    for (let piece = 0; piece < PIECES; piece++) {
      const from = Math.floor((piece * (line.length - 1)) / PIECES), till = Math.floor(((piece + 1) * (line.length - 1)) / PIECES);
      if (till <= from) continue;
      const age = (times[at] - times[line[from][2]]) / TRAIL_SECONDS;
      ctx.strokeStyle = css(colourOf(id), 0.85 * (1 - age) + 0.05);
      ctx.lineWidth = 2.2 * (1 - 0.5 * age);
      ctx.beginPath();
      for (let k = from; k <= till; k++) {
        const [x, y, a] = line[k], [px, py, b, tall] = line[Math.max(from, k - 1)];
        const broken = b - a > 3 || Math.hypot(px - x, py - y) > tall; // no movement, but another box
        if (k === from || broken) ctx.moveTo(to.x + x * to.scale, to.y + y * to.scale);
        else ctx.lineTo(to.x + x * to.scale, to.y + y * to.scale);
      }
      ctx.stroke();
    }
  }
  ctx.lineCap = "butt";
}

// Zones and ground ----------------------------------------------------------------------------------------------

export const ZONE_COLOURS = {
  entry: [95, 192, 139], exit: [240, 140, 90], occlusion: [150, 130, 240], "low-contrast": [210, 190, 90],
  noise: [200, 110, 180], ignore: [150, 158, 170], ground: [90, 180, 220],
};

export function paintZone(ctx, to, zone, chosen, open) {
  const colour = ZONE_COLOURS[zone.kind] ?? [200, 200, 200];
  ctx.beginPath();
  for (const ring of zone.rings) {
    ring.forEach(([x, y], k) => {
      const sx = to.x + x * to.scale, sy = to.y + y * to.scale;
      if (k) ctx.lineTo(sx, sy); else ctx.moveTo(sx, sy);
    });
    if (!open) ctx.closePath();
  }
  if (!open) {
    ctx.fillStyle = css(colour, chosen ? 0.28 : 0.14);
    ctx.fill("evenodd");
  }
  ctx.setLineDash(zone.kind === "occlusion" ? [6, 4] : []);
  ctx.strokeStyle = "rgb(10 12 16 / .6)";
  ctx.lineWidth = chosen ? 4.5 : 3.5;
  ctx.stroke();
  ctx.strokeStyle = css(colour);
  ctx.lineWidth = chosen ? 2.5 : 1.5;
  ctx.stroke();
  ctx.setLineDash([]);
  if (chosen || open) for (const ring of zone.rings) for (const point of ring) paintKnob(ctx, to, point, css(colour));
  if (!open && zone.name) {
    const [x, y] = zone.rings[0].reduce(([a, b], [c, d]) => (d < b ? [c, d] : [a, b]));
    ctx.font = LETTERS;
    const half = ctx.measureText(zone.name).width / 2 + 6;
    paintWords(ctx, Math.max(Math.max(0, to.x) + half, to.x + x * to.scale), to.y + y * to.scale + 14, zone.name, css(colour));
  }
}

export function paintKnob(ctx, to, [x, y], colour, name = "") {
  const sx = to.x + x * to.scale, sy = to.y + y * to.scale;
  ctx.beginPath();
  ctx.arc(sx, sy, 5, 0, 2 * Math.PI);
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.lineWidth = 2;
  ctx.strokeStyle = "rgb(10 12 16 / .85)";
  ctx.stroke();
  if (name) paintWords(ctx, sx + 16, sy - 10, name, colour);
}

export function paintWords(ctx, x, y, text, colour) {
  ctx.font = LETTERS;
  const wide = ctx.measureText(text).width + 10;
  ctx.fillStyle = "rgb(14 16 20 / .8)";
  ctx.beginPath();
  ctx.roundRect(x - wide / 2, y - 9, wide, 18, 4);
  ctx.fill();
  ctx.fillStyle = colour;
  ctx.textBaseline = "middle";
  ctx.fillText(text, x - wide / 2 + 5, y + 0.5);
}

export function paintGrid(ctx, to, lines) {
  ctx.strokeStyle = "rgb(120 200 235 / .75)";
  ctx.lineWidth = 1;
  for (const line of lines) {
    ctx.beginPath();
    line.forEach(([x, y], k) => {
      const sx = to.x + x * to.scale, sy = to.y + y * to.scale;
      if (k) ctx.lineTo(sx, sy); else ctx.moveTo(sx, sy);
    });
    ctx.stroke();
  }
}
