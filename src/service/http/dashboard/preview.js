// A small moving picture of a job: some frames over the run, drawn in the browser, again and again.

import { h, text } from "./dom.js";
import { number } from "./format.js";
import { Frames } from "./frames.js";
import { domain, Scene3D } from "./scene3d.js";
import { Solids } from "./solids.js";

const MOST_FRAMES = 48;
const MOST_POINTS = 8000;
const PER_SECOND = 12;

/** The preview of a job. Tell it the scene and how many frames there are with `update`. */
export function preview(id, signal) {
  const canvas = h("canvas", { class: "preview", role: "img", "aria-label": "Moving preview of the run" });
  const button = h("button", { type: "button", onclick: () => play(!playing) }, "Play");
  const time = h("span", { class: "note" });
  const note = h("p", { class: "note" }, "The preview comes with the first frames.");
  const stage = h("div", { class: "stage" }, canvas, note);
  const element = h("div", { class: "player" }, stage, h("div", { class: "actions" }, button, time));
  const calm = matchMedia("(prefers-reduced-motion: reduce)");
  const frames = new Frames(id, { most: MOST_POINTS, room: 48e6, signal });
  let [playing, wanted, known, scene3d, solids, shown] = [!calm.matches, 0, [], null, null, 0];
  let loading = false;
  button.disabled = true;

  function start(scene) {
    try {
      scene3d = new Scene3D(canvas);
    } catch (error) {
      text(note, error.message);
      return;
    }
    solids = new Solids(id, scene, signal);
    const { min, max, flat, pitch } = domain(scene);
    scene3d.pitch = pitch;
    scene3d.setBounds(min, max, flat);
  }

  /** Loads frames that are spread over all there are. */
  async function load() {
    if (loading || !scene3d) return;
    loading = true;
    try {
      while (wanted && !signal.aborted && (known.total ?? 0) !== wanted) {
        const total = wanted;
        const n = Math.min(MOST_FRAMES, total);
        const chosen = Array.from({ length: n }, (_, k) => Math.round((k * (total - 1)) / Math.max(n - 1, 1)));
        const list = [];
        for (const frame of chosen) {
          const [points, { solids: around }] = await Promise.all([frames.get(frame), solids.at(frame)]);
          list.push({ points, around });
        }
        known = Object.assign(list, { total });
        if (!playing) show(known.length - 1);
        else if (note.hidden === false) show(0);
        note.hidden = true;
        button.disabled = false;
        label();
      }
    } catch (error) {
      if (!signal.aborted && !known.length) text(note, "There is no preview: the frames cannot be read.");
    } finally {
      loading = false;
    }
  }

  function show(k) {
    if (!known[k] || !canvas.clientWidth) return;
    shown = k;
    const { points, around } = known[k];
    scene3d.setPoints(points);
    scene3d.solids = around;
    scene3d.fit();
    scene3d.draw();
    text(time, `${number(points.time)} s`);
  }

  function label() {
    text(button, playing ? "Pause" : "Play");
    button.setAttribute("aria-label", playing ? "Pause the preview" : "Play the preview");
  }

  function play(on) {
    playing = on;
    label();
  }

  const timer = setInterval(() => {
    if (!playing || !known.length || document.hidden) return;
    // The last frame stays for a second.
    const next = shown + 1;
    if (next < known.length + PER_SECOND) {
      if (next < known.length) show(next);
      else shown = next;
    } else {
      show(0);
    }
  }, 1000 / PER_SECOND);
  const size = new ResizeObserver(() => show(Math.min(shown, known.length - 1)));
  size.observe(canvas);
  signal.addEventListener("abort", () => {
    clearInterval(timer);
    size.disconnect();
    scene3d?.close();
  });

  const update = (scene, particles, total, ended) => {
    if (!scene3d) start(scene);
    if (scene3d) scene3d.particles = particles;
    // While the job runs, not every frame is worth another round.
    if (ended || total >= 1.25 * wanted + 1) {
      wanted = total;
      load();
    }
  };
  return { element, update };
}
