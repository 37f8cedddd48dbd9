// The 3D view of a job: its points in any frame, turned by mouse, touch and keyboard. It follows a job that runs.

import { hasEnded } from "./actions.js";
import { follow, get } from "./api.js";
import { axes } from "./axes.js";
import { announce, h, text } from "./dom.js";
import { count, number } from "./format.js";
import { Frames } from "./frames.js";
import { badge } from "./jobs.js";
import { legend } from "./legend.js";
import { orbit } from "./orbit.js";
import { failed } from "./problem.js";
import { domain, Scene3D } from "./scene3d.js";
import { Solids } from "./solids.js";

const KEYS =
  "Arrow keys turn the view, with Shift they move it; plus and minus zoom, Home shows all. " +
  "Space plays, comma and full stop step, F follows.";

export function viewer(main, id, signal) {
  const frames = new Frames(id, { signal });
  const state = badge();
  // The frame that is shown, and the one that was asked for last.
  let [at, asked] = [-1, -1];
  let [job, scene3d, rate, total, field] = [null, null, 24, 0, "speed"];
  let [playing, busy, range, units, solids, bodies] = [false, false, null, {}, null, []];

  const title = h("h1", {}, "3D view");
  const back = h("a", { href: `#/jobs/${id}` }, "Job");
  const canvas = h("canvas", { class: "view3d", tabindex: 0, role: "application", "aria-label": `3D view. ${KEYS}` });
  const colored = legend();
  const triad = axes();
  const note = h("p", { class: "note stage-note", role: "status" }, "The view comes with the first frame.");
  const errors = h("div", { role: "alert" });
  const play = h("button", { type: "button", onclick: () => setPlaying(!playing) }, "Play");
  const scrub = h("input", { type: "range", id: "frame", min: 0, max: 0, value: "0", step: 1, disabled: true });
  const said = h("output", { class: "note", for: "frame" });
  const following = h("input", { type: "checkbox", id: "follow", checked: true });
  const follows = h("label", { class: "check" }, following, "Follow");
  const speed = h(
    "select",
    { id: "speed" },
    [0.1, 0.25, 0.5, 1, 2].map((x) =>
      h("option", { value: x, selected: x === 1 }, x === 1 ? "as simulated" : `${x} ×`),
    ),
  );
  const colors = h("select", { id: "field", onchange: recolor });
  const size = h("input", { type: "range", id: "size", min: -2, max: 2, step: 0.1, value: "0", oninput: resize });
  const style = h(
    "select",
    { id: "colliders", onchange: restyle },
    [
      ["solid", "solid"],
      ["through", "see-through"],
      ["hidden", "hidden"],
    ].map(([value, label]) => h("option", { value }, label)),
  );
  const styled = h("label", { hidden: true }, "Colliders ", style);
  const direction = (name, azimuth, elevation) =>
    h("button", { type: "button", onclick: () => (scene3d?.fit(azimuth, elevation), draw()) }, name);

  const sides = [direction("Front", -90, 0), direction("Side", 0, 0), direction("Top", -90, 90)];

  main.append(
    h(
      "div",
      { class: "title" },
      h("div", {}, h("p", { class: "crumbs" }, h("a", { href: "#/" }, "Jobs"), " / ", back), title),
      state.element,
    ),
    errors,
    h(
      "div",
      { class: "viewer" },
      h("div", { class: "stage" }, canvas, colored.element, triad.element, note),
      h(
        "div",
        { class: "controls timeline" },
        play,
        h("button", { type: "button", "aria-label": "Frame before", onclick: () => step(-1) }, "‹"),
        h("button", { type: "button", "aria-label": "Frame after", onclick: () => step(1) }, "›"),
        h("label", { class: "grow" }, h("span", { class: "hidden" }, "Frame"), scrub),
        said,
        follows,
      ),
      h(
        "div",
        { class: "controls" },
        h("label", {}, "Colour ", colors),
        h("label", {}, "Speed ", speed),
        h("label", {}, "Point size ", size),
        styled,
        h("div", { class: "actions", role: "group", "aria-label": "Directions" }, direction("All"), sides),
      ),
      h("p", { class: "note" }, "Drag to turn, drag with Shift or two fingers to move, wheel or pinch to zoom. ", KEYS),
    ),
  );

  scrub.addEventListener("input", () => {
    following.checked = false;
    setPlaying(false);
    go(Number(scrub.value));
  });
  following.addEventListener("change", () => following.checked && go(total - 1));

  function draw() {
    requestAnimationFrame(() => scene3d && !signal.aborted && scene3d.draw());
  }

  /** Shows a frame; while one is loaded, the last that was asked for waits. */
  async function go(frame) {
    if (frame < 0 || frame >= total || !scene3d) return;
    asked = frame;
    if (busy) return;
    busy = true;
    try {
      let [next, by] = [];
      do {
        [next, by] = [asked, field];
        const [points, placed] = await Promise.all([frames.get(next, field), solids.at(next)]);
        if (signal.aborted) return;
        place(placed);
        show(points);
      } while (next !== asked || by !== field);
      errors.replaceChildren();
    } catch (error) {
      scrub.value = asked = at;
      if (!signal.aborted) errors.replaceChildren(failed(error));
    } finally {
      busy = false;
    }
  }

  /** The colliders of the frame, and the domain as it is simulated. */
  function place({ domain: box, solids: list }) {
    const { flat, bounds } = scene3d;
    const corners = box ? [box.min, box.max].map((at) => (flat ? [at[0], at[1], 0] : at)) : bounds;
    if (bounds.flat().some((x, k) => x !== corners.flat()[k])) scene3d.setBounds(...corners, flat);
    scene3d.solids = list;
    styled.hidden &&= !list.length;
  }

  function show(points) {
    at = points.frame;
    if (field === "body") {
      range = [-0.5, bodies.length - 0.5];
    } else if (points.values && Number.isFinite(points.range[0])) {
      range = range ? [Math.min(range[0], points.range[0]), Math.max(range[1], points.range[1])] : [...points.range];
    }
    scene3d.range = range ?? [0, 1];
    scene3d.setPoints(points);
    draw();
    note.hidden = true;
    // The frames that come by must not move the slider from where it was set meanwhile.
    scrub.value = asked;
    const shares = points.n < points.recorded ? ` of ${count(points.recorded)}` : "";
    text(said, `frame ${at} of ${total - 1}, ${number(points.time)} s, ${count(points.n)}${shares} points`);
    scrub.setAttribute("aria-valuetext", `frame ${at}, ${number(points.time)} s`);
    if (!points.values || !range) colored.hide();
    else if (field === "body") colored.bodies(bodies, range);
    else colored.scale(field.replaceAll("_", " "), range, units[field]);
  }

  function step(by) {
    following.checked = false;
    setPlaying(false);
    go(Math.min(total - 1, Math.max(0, asked + by)));
  }

  function setPlaying(on) {
    playing = on && total > 1;
    text(play, playing ? "Pause" : "Play");
    if (playing) {
      following.checked = false;
      if (at >= total - 1) go(0);
      tick();
    }
  }

  function tick() {
    if (!playing || signal.aborted) return;
    if (!busy) {
      if (at + 1 < total) {
        go(at + 1);
        // The next one is on its way while this one is drawn.
        if (at + 2 < total) Promise.all([frames.get(at + 2, field), solids.at(at + 2)]).catch(() => {});
      } else if (hasEnded(job)) {
        go(0);
      }
    }
    setTimeout(tick, Math.max(15, 1000 / (rate * Number(speed.value))));
  }

  function recolor() {
    field = colors.value;
    range = null;
    go(Math.max(0, asked));
  }

  function restyle() {
    if (!scene3d) return;
    scene3d.style = style.value;
    draw();
  }

  function resize() {
    if (!scene3d) return;
    scene3d.size = 2 ** Number(size.value);
    draw();
  }

  /** The fields that points can be coloured by are known with the first frame. */
  async function fields() {
    const list = await get(`/v1/jobs/${id}/frames`, signal);
    units = Object.fromEntries(list.fields.map(({ name, unit }) => [name, unit]));
    if (!(field in units)) field = "";
    const options = list.fields.map(({ name, unit }) => [
      name,
      name.replaceAll("_", " ") + (unit && unit !== "1" ? ` (${unit})` : ""),
    ]);
    colors.replaceChildren(...[...options, ["", "as recorded"]].map(([value, label]) => h("option", { value }, label)));
    colors.value = field;
  }

  async function update(now) {
    if (job && job.status !== now.status) announce(`${now.name}: ${now.status}`);
    job = now;
    scene3d.particles = job.particles;
    state.update(job);
    text(title, job.name);
    document.title = `${job.name}, 3D view · Gridfall`;
    const before = total;
    total = job.progress.frames_written;
    scrub.max = Math.max(0, total - 1);
    scrub.disabled = !total;
    follows.hidden = hasEnded(job);
    if (!before && total) {
      await fields();
      await go(following.checked ? total - 1 : 0);
    } else if (total > before && following.checked) {
      go(total - 1);
    }
    if (hasEnded(job) && !total) text(note, "The job ended before its first frame.");
    if (job.status === "queued") text(note, "The job waits in the queue. The view comes with the first frame.");
  }

  async function begin() {
    try {
      scene3d = new Scene3D(canvas);
    } catch (error) {
      text(note, error.message);
      return;
    }
    const scene = await get(`/v1/jobs/${id}/scene`, signal);
    rate = scene.time.frame_rate ?? 24;
    const { min, max, flat, pitch } = domain(scene);
    scene3d.pitch = pitch;
    solids = new Solids(id, scene, signal);
    bodies = [...scene.bodies, ...(scene.sources ?? [])].map(({ name }) => name);
    scene3d.drawn = (camera) => triad.update({ ...camera, flat });
    // What is flat has one side to look at.
    sides.forEach((button) => (button.hidden = flat));
    const first = new ResizeObserver(() => {
      scene3d.resized();
      draw();
    });
    scene3d.draw();
    scene3d.setBounds(min, max, flat);
    first.observe(canvas);
    orbit(canvas, scene3d, draw, {
      " ": () => setPlaying(!playing),
      ",": () => step(-1),
      ".": () => step(1),
      f: () => ((following.checked = true), setPlaying(false), go(total - 1)),
    });
    signal.addEventListener("abort", () => {
      first.disconnect();
      scene3d.close();
    });
    draw();
    await follow(
      `/v1/jobs/${id}/events`,
      (event, data) => ["status", "progress"].includes(event) && update(data),
      signal,
    );
  }

  begin().catch((error) => signal.aborted || errors.replaceChildren(failed(error)));
}
