// The colliders of frames, as `GET /v1/jobs/{id}/frames/{frame}/colliders` sends them.

import { ApiError, get } from "./api.js";

const MOST = 4096;

/** Colliders of a job's frames. Shapes are fetched once, and again when colliders appear or go. */
export class Solids {
  #frames = new Map();
  #editions = new Map();
  /** Nothing ever appears or moves, so that all frames are as the first one. */
  #always = null;

  constructor(job, scene, signal) {
    Object.assign(this, { job, signal });
    const still = (one) => !one.motion && one.from === undefined && one.until === undefined;
    // Grips of bodies are colliders too, and mostly move.
    this.still = (scene.colliders ?? []).every(still) && !scene.bodies?.some((body) => body.grips?.length);
  }

  /** The domain and the colliders of a frame: name, mesh, place, and whether what is inside should be seen. Where the
   * recording has none, there is no domain either: points are seen without them. */
  async at(frame) {
    if (this.#always) return this.#always;
    const kept = this.#frames.get(frame);
    if (kept) return kept;
    try {
      return await this.#ask(frame);
    } catch (error) {
      if (!(error instanceof ApiError)) throw error;
      const none = { domain: null, solids: [] };
      // Recordings of old releases have no shapes in any frame. They are not asked again, if it is not the frame that
      // was missing.
      if (error.problem.code === "output_not_found" && (await this.#exists(frame))) this.#always = none;
      return none;
    }
  }

  async #exists(frame) {
    const { frames } = await get(`/v1/jobs/${this.job}/frames`, this.signal).catch(() => ({ frames: 0 }));
    return frame < frames;
  }

  async #ask(frame) {
    const path = `/v1/jobs/${this.job}/frames/${frame}/colliders`;
    let answer = await get(this.#editions.size ? path : `${path}?meshes=true`, this.signal);
    if (!this.#editions.has(answer.edition)) {
      if (!answer.colliders.every(({ mesh }) => mesh)) answer = await get(`${path}?meshes=true`, this.signal);
      this.#editions.set(answer.edition, new Map(answer.colliders.map(({ name, mesh }) => [name, mesh])));
    }
    const meshes = this.#editions.get(answer.edition);
    const { domain, colliders } = answer;
    const found = { domain, solids: colliders.map((one) => ({ ...one, mesh: meshes.get(one.name) })) };
    if (this.still) this.#always = found;
    this.#frames.set(frame, found);
    if (this.#frames.size > MOST) this.#frames.delete(this.#frames.keys().next().value);
    return found;
  }
}
