// The picture of a frame of a job that has ended, as the server draws it.

import { get } from "./api.js";
import { h, text } from "./dom.js";

const SIZE = "960x600";

/** A figure with the last frame at first; frame and colours can be chosen. `chosen` is told of the frame. */
export function drawnFrame(job, chosen, signal) {
  const path = `/v1/jobs/${job.id}`;
  const last = job.progress.frames_written - 1;
  const image = h("img", { src: `${path}/thumbnail.png`, alt: `The last frame of ${job.name}` });
  const frame = h("input", { type: "range", id: "drawn-frame", min: 0, max: last, step: 1, value: String(last) });
  const colors = h("select", { id: "drawn-colors" }, h("option", { value: "" }, "as recorded"));
  const said = h("output", { class: "note", for: "drawn-frame" });
  const note = h("p", { class: "note", role: "status" });
  const save = h("a", { class: "button", href: image.src, download: true }, "Save");
  const element = h(
    "figure",
    { class: "picture", hidden: true },
    image,
    h(
      "figcaption",
      { class: "controls" },
      h("label", { class: "grow" }, h("span", { class: "hidden" }, "Frame"), frame),
      said,
      h("label", {}, "Colour ", colors),
      save,
    ),
    note,
  );

  function label() {
    const at = Number(frame.value);
    text(said, at === last ? `frame ${at}, the last` : `frame ${at}`);
  }

  function draw() {
    label();
    const terms = new URLSearchParams({ size: SIZE, ...(colors.value && { color_by: colors.value }) });
    image.alt = `Frame ${frame.value} of ${job.name}${colors.value && `, coloured by ${colors.value}`}`;
    image.src = save.href = `${path}/frames/${frame.value}/picture.png?${terms}`;
    save.setAttribute("download", `${job.name}.${frame.value.padStart(4, "0")}.png`);
    text(note, "Drawing …");
  }

  image.addEventListener("load", () => {
    element.hidden = false;
    text(note, "");
  });
  image.addEventListener("error", () => !element.hidden && text(note, "This picture cannot be drawn now; try again."));
  // While the slider moves only its number follows: each picture is work.
  frame.addEventListener("input", label);
  frame.addEventListener("change", () => {
    draw();
    chosen(Number(frame.value));
  });
  colors.addEventListener("change", draw);
  label();
  get(`${path}/frames`, signal)
    .then(({ fields }) => {
      const names = fields.map(({ name }) => name).filter((name) => name !== "body" && name !== "id");
      colors.append(...["body", ...names].map((name) => h("option", { value: name }, name)));
    })
    .catch(() => {
      // Without the fields there are the recorded colours.
    });
  return element;
}
