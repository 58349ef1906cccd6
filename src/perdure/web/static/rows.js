// Rows, silhouettes and stretches of one run or truth, fetched by blocks of frames and kept.

import { ask, bytes } from "./api.js";

const BLOCK = 256, SHAPES = 16, KEPT = 96;
export const STATUS = ["visible", "partly occluded", "occluded", "ambiguous", "lost"];
export const VISIBLE = 0, PARTLY = 1, OCCLUDED = 2, AMBIGUOUS = 3, LOST = 4;

export class Layer {
  // `address` is where it is asked for, such as "runs/0" or "runs/0/truth".
  constructor(address, { shapes = true, changed = () => {} } = {}) {
    this.address = address;
    this.hasShapes = shapes;
    this.changed = changed;
    this.edition = 0;
    this.tracks = new Map(); // id -> { id, spans: [{begin, end, status, grouped}], first, last, group, class }
    this.order = []; // ids by their first frame
    this._blocks = new Map();
    this._shapes = new Map();
    this._coming = new Map();
  }

  async load() {
    this.take(await ask(`${this.address}/tracks`));
  }

  // Take up stretches; what was fetched of rows is kept on show until the new ones are there.
  take(told) {
    const { id, begin, end, status, grouped } = told.spans, groups = new Set(told.groups), tracks = new Map();
    for (let k = 0; k < id.length; k++) {
      let track = tracks.get(id[k]);
      if (!track) {
        track = { id: id[k], spans: [], first: begin[k], last: end[k], group: groups.has(id[k]), name: told.classes[id[k]] ?? "" };
        tracks.set(id[k], track);
      }
      track.spans.push({ begin: begin[k], end: end[k], status: status[k], grouped: grouped[k] });
      track.last = end[k];
    }
    this.tracks = tracks;
    this.order = [...tracks.values()].sort((a, b) => a.first - b.first || a.id - b.id).map((one) => one.id);
    this.edition += 1;
    this.changed();
  }

  // Rows of a frame: [] until they are there. `ready` says whether they are.
  rowsAt(frame) {
    const block = this._block(frame);
    return block?.at(frame) ?? [];
  }

  ready(frame) {
    const block = this._blocks.get(Math.floor(frame / BLOCK));
    return block !== undefined;
  }

  // Silhouettes and contours of a frame by id, as far as they are here; `fetched` asks for those that are not.
  shapesAt(frame, fetched = true) {
    if (!this.hasShapes) return null;
    const key = Math.floor(frame / SHAPES), held = this._shapes.get(key);
    if (fetched && (!held || held.edition !== this.edition)) this._fetchShapes(key);
    return held?.value[frame] ?? null;
  }

  ahead(frame) {
    this._block(Math.max(0, frame));
    if (this.hasShapes) this.shapesAt(Math.max(0, frame));
  }

  _block(frame) {
    const key = Math.floor(frame / BLOCK), held = this._blocks.get(key);
    if (!held || held.edition !== this.edition) this._fetch(key);
    return held;
  }

  async _fetch(key) {
    await this._once(`rows ${key}`, async (edition) => {
      const packed = await bytes(`${this.address}/rows?from=${key * BLOCK}&to=${(key + 1) * BLOCK}`);
      keep(this._blocks, key, new Block(packed, edition));
    });
  }

  async _fetchShapes(key) {
    await this._once(`shapes ${key}`, async (edition) => {
      const value = await ask(`${this.address}/shapes?from=${key * SHAPES}&to=${(key + 1) * SHAPES}`);
      keep(this._shapes, key, { edition, value });
    });
  }

  async _once(name, fetched) {
    if (this._coming.get(name) === this.edition) return;
    const edition = this.edition;
    this._coming.set(name, edition);
    try {
      await fetched(edition);
      this.changed();
    } catch (error) {
      if (error.status) console.warn(error.message);
    } finally {
      if (this._coming.get(name) === edition) this._coming.delete(name);
    }
  }
}

function keep(kept, key, value) {
  kept.delete(key);
  kept.set(key, value);
  if (kept.size > KEPT) kept.delete(kept.keys().next().value);
}

class Block {
  constructor(packed, edition) {
    this.edition = edition;
    const n = new DataView(packed).getUint32(0, true);
    let place = 4;
    const next = (Kind, count) => {
      const values = new Kind(packed, place, count);
      place += values.byteLength;
      return values;
    };
    this.frames = next(Int32Array, n);
    this.ids = next(Int32Array, n);
    this.groups = next(Int32Array, n);
    this.boxes = next(Float32Array, 4 * n);
    this.confidence = next(Float32Array, n);
    this.status = next(Uint8Array, n);
    this.inferred = next(Uint8Array, n);
    this.hidden = next(Uint8Array, n);
    this._made = new Map();
  }

  at(frame) {
    let rows = this._made.get(frame);
    if (!rows) this._made.set(frame, (rows = this._rows(frame)));
    return rows;
  }

  _rows(frame) {
    let low = 0, high = this.frames.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.frames[middle] < frame) low = middle + 1; else high = middle;
    }
    const rows = [];
    for (let k = low; k < this.frames.length && this.frames[k] === frame; k++) {
      const [x1, y1, x2, y2] = this.boxes.subarray(4 * k, 4 * k + 4);
      rows.push({
        id: this.ids[k], group: this.groups[k], x1, y1, x2, y2, confidence: this.confidence[k],
        status: this.status[k], inferred: this.inferred[k] > 0, hidden: this.hidden[k],
      });
    }
    const members = new Set(rows.map((row) => row.group).filter(Boolean));
    for (const row of rows) row.isGroup = members.has(row.id);
    return rows;
  }
}
