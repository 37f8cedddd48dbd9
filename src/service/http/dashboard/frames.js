// The points of frames, as `GET /v1/jobs/{id}/frames/{frame}/points` sends them.

import { request } from "./api.js";

const HEAD = 64;

/** Takes an answer apart. All numbers are little-endian, as they are on every machine with a browser. */
export function decode(buffer) {
  const head = new DataView(buffer, 0, HEAD);
  const mark = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  if (mark !== "GFPT" || head.getUint32(4, true) !== 1)
    throw new Error("The points are of another version; reload the page.");
  const n = head.getUint32(12, true);
  const flags = head.getUint32(20, true);
  return {
    frame: head.getUint32(8, true),
    n,
    recorded: head.getUint32(16, true),
    time: head.getFloat64(24, true),
    origin: [32, 40, 48].map((at) => head.getFloat64(at, true)),
    range: [head.getFloat32(56, true), head.getFloat32(60, true)],
    positions: new Float32Array(buffer, HEAD, 3 * n),
    values: flags & 1 ? new Float32Array(buffer, HEAD + 12 * n, n) : null,
    colors: flags & 2 ? new Uint8Array(buffer, HEAD + 12 * n, 4 * n) : null,
    bytes: buffer.byteLength,
  };
}

/** Frames of a job that were looked at, the last ones in memory. */
export class Frames {
  #kept = new Map();
  #size = 0;

  constructor(job, { most = null, room = 192e6, signal }) {
    Object.assign(this, { job, most, room, signal });
  }

  /** A frame in the colours of a field, or in those that were recorded (`""`). */
  async get(frame, field = "") {
    const key = `${frame} ${field}`;
    const kept = this.#kept.get(key);
    if (kept) {
      this.#kept.delete(key);
      this.#kept.set(key, kept);
      return kept;
    }
    const terms = new URLSearchParams({ ...(field && { field }), ...(this.most && { max_points: this.most }) });
    const path = `/v1/jobs/${this.job}/frames/${frame}/points${terms.size ? `?${terms}` : ""}`;
    const answer = await request("GET", path, { signal: this.signal });
    const points = decode(await answer.arrayBuffer());
    this.#kept.set(key, points);
    this.#size += points.bytes;
    for (const [old, { bytes }] of this.#kept) {
      if (this.#size <= this.room || old === key) break;
      this.#kept.delete(old);
      this.#size -= bytes;
    }
    return points;
  }
}
