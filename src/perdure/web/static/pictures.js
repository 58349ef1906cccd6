// Frames of a source as bitmaps, each by its exact number: kept, and fetched ahead of the playhead.

import { blob, roughly } from "./api.js";

const KEPT_BYTES = 320 << 20, AT_ONCE = 3;

export class Film {
  constructor(run, about, arrived) {
    this.run = run;
    this.wrong = about.no_pictures;
    this._bytes = Math.max(1, about.width * about.height * 4);
    this._most = Math.max(24, Math.floor(KEPT_BYTES / this._bytes));
    this._arrived = arrived;
    this._kept = new Map(); // frame -> ImageBitmap, the latest used last
    this._coming = new Map(); // frame -> AbortController
    this._wanted = []; // frames to fetch, the most wanted first
    this._roughly = null; // the frame that a dragged playhead was over last
    this.problem = new Map(); // frame -> why there is no picture
  }

  // The picture of a frame if it is here, else null; and what else will be wanted soon. While the playhead is being
  // dragged (`rough`) nothing is fetched that must be decoded from far: frames near at hand are, each by its own number.
  want(frame, soon = [], rough = false) {
    if (this.wrong) return null;
    const found = this._kept.get(frame);
    if (found) {
      this._kept.delete(frame);
      this._kept.set(frame, found);
    }
    if (rough) {
      this._wanted = [];
      if (!found) this._rough(frame);
      return found ?? null;
    }
    this._wanted = [frame, ...soon].filter((one) => !this._kept.has(one) && !this.problem.has(one));
    for (const [one, control] of this._coming) {
      if (!this._wanted.includes(one)) control.abort();
    }
    this._next();
    return found ?? null;
  }

  // A frame that is here, the nearest to one that is not; -1 if none is within `reach` frames.
  nearest(frame, reach) {
    let found = -1;
    for (const one of this._kept.keys()) {
      if (Math.abs(one - frame) <= reach && (found < 0 || Math.abs(one - frame) < Math.abs(found - frame))) found = one;
    }
    return found;
  }

  picture(frame) {
    return this._kept.get(frame) ?? null;
  }

  has(frame) {
    return Boolean(this.wrong) || this._kept.has(frame) || this.problem.has(frame);
  }

  async _rough(frame) {
    this._roughly = frame;
    if (this._roughing) return;
    this._roughing = true;
    while (this._roughly !== null) {
      const wanted = this._roughly;
      this._roughly = null;
      try {
        const [found, number] = await roughly(`runs/${this.run}/pictures/${wanted}.jpg?near`);
        this._keep(number, await createImageBitmap(found));
        this._arrived(number);
      } catch {
        break;
      }
    }
    this._roughing = false;
  }

  _next() {
    for (const frame of this._wanted) {
      if (this._coming.size >= AT_ONCE) return;
      if (!this._coming.has(frame)) this._fetch(frame);
    }
  }

  async _fetch(frame) {
    const control = new AbortController();
    this._coming.set(frame, control);
    try {
      const found = await blob(`runs/${this.run}/pictures/${frame}.jpg`, { signal: control.signal });
      this._keep(frame, await createImageBitmap(found));
    } catch (error) {
      if (error.name !== "AbortError" && error.status === 404) this.problem.set(frame, error.message);
    } finally {
      this._coming.delete(frame);
    }
    this._wanted = this._wanted.filter((one) => !this._kept.has(one) && !this.problem.has(one));
    this._arrived(frame);
    this._next();
  }

  _keep(frame, bitmap) {
    this._kept.set(frame, bitmap);
    while (this._kept.size > this._most) {
      const [oldest, gone] = this._kept.entries().next().value;
      this._kept.delete(oldest);
      gone.close();
    }
  }
}
