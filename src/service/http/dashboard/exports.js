// A frame of a job as files of other programs.

import { ApiError, get } from "./api.js";
import { h, text } from "./dom.js";
import { count } from "./format.js";

const POINTS = [
  ["ply", "PLY", "Blender, MeshLab"],
  ["vtp", "VTP", "ParaView"],
  ["npz", "npz", "NumPy"],
  ["csv", "CSV", "tables"],
];
const SURFACES = [
  ["ply", "PLY", "MeshLab"],
  ["glb", "glTF", "Blender, the web"],
  ["obj", "OBJ", "most programs"],
];

/** Links for one frame, the last one until another is chosen. `update` tells how many frames there are, `choose`
 * takes another one. */
export function exports(id) {
  const frame = h("input", { type: "number", id: "export-frame", min: 0, step: 1, required: true, oninput: link });
  const most = h("span", { class: "note" });
  const forms = h("dl", { class: "facts forms" });
  const note = h(
    "p",
    { class: "note" },
    "All frames at once, from the recording: ",
    h("code", {}, "gridfall export recording.mcap -o frames"),
  );
  const element = h(
    "div",
    { class: "exports", hidden: true },
    h("h3", {}, "One frame"),
    h("p", { class: "controls" }, h("label", { for: "export-frame" }, "Frame"), frame, most),
    forms,
    note,
  );
  let [last, chosen, flat, shapes] = [-1, false, false, true];
  frame.addEventListener("input", () => (chosen = true));

  function link() {
    const n = Number(frame.value);
    const known = frame.value !== "" && Number.isInteger(n) && n >= 0 && n <= last;
    frame.setAttribute("aria-invalid", String(!known));
    if (!known) {
      const wrong = `There are frames 0 to ${count(last)}.`;
      return forms.replaceChildren(h("dt", {}, "Files"), h("dd", { role: "alert" }, wrong));
    }
    const path = `/v1/jobs/${id}/frames/${n}`;
    const one = (href, name, what, of) =>
      h("a", { class: "button", href, download: true, "aria-label": `${of} as ${name}`, title: what }, name);
    const row = (name, list) => [h("dt", {}, name), h("dd", { class: "actions" }, list)];
    forms.replaceChildren(
      ...row(
        "Points",
        POINTS.map(([form, name, what]) => one(`${path}/export?format=${form}`, name, `for ${what}`, "Points")),
      ),
      ...(flat
        ? []
        : row(
            "Surface",
            SURFACES.map(([form, name, what]) => one(`${path}/surface?format=${form}`, name, `for ${what}`, "Surface")),
          )),
      ...row("Picture", [one(`${path}/picture.png?size=1280x720`, "PNG", "1280 × 720", "Picture")]),
      ...(shapes
        ? row("Colliders", [one(`${path}/colliders?meshes=true`, "JSON", "as triangles", "Colliders")])
        : []),
    );
  }

  /** Recordings of old releases have no shapes to send. */
  async function look() {
    try {
      await get(`/v1/jobs/${id}/frames/0/colliders`);
    } catch (error) {
      if (!(error instanceof ApiError) || error.problem.code !== "output_not_found") return;
      shapes = false;
      link();
    }
  }

  function choose(n) {
    chosen = true;
    frame.value = n;
    link();
  }

  /** The number of frames, and whether the scene is 2D (2D scenes have no surface). */
  function update(total, plane) {
    element.hidden = !total;
    if (total - 1 === last && plane === flat) return;
    if (last < 0 && total) look();
    [last, flat] = [total - 1, plane];
    frame.max = last;
    text(most, `of 0 to ${count(last)}`);
    if (!chosen) frame.value = last;
    if (total && (!chosen || plane)) link();
  }
  return { element, update, choose };
}
