// What a scene will cost, in words and numbers.

import { h, prose } from "./dom.js";
import { bytes, count, duration, many, number, quantity } from "./format.js";
import { fault } from "./problem.js";

const row = (name, value, note) => [
  h("dt", {}, name),
  h("dd", {}, value, note && h("span", { class: "note" }, prose(note))),
];

/** The estimate of a valid scene, with its notices. */
export function estimate({ estimate: e, notices }, reach) {
  const ways = [
    ["explicit", e.explicit],
    ["implicit", e.implicit],
  ].filter(([, way]) => way);
  const taken = ways.find(([name]) => name === e.integrator)?.[1] ?? e.explicit;
  const compared = h(
    "table",
    { class: "ways" },
    h("caption", { class: "hidden" }, "Ways to integrate"),
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        ["Integrator", "Step", "Steps", "Time"].map((name) => h("th", { scope: "col" }, name)),
      ),
    ),
    h(
      "tbody",
      {},
      ways.map(([name, way]) =>
        h(
          "tr",
          { class: name === e.integrator ? "taken" : null },
          h("th", { scope: "row" }, name, name === e.integrator && h("span", { class: "note" }, "taken")),
          h("td", {}, quantity(way.dt_s, "s")),
          h("td", {}, count(way.steps)),
          h("td", {}, duration(way.two_cores_s)),
        ),
      ),
    ),
  );
  return [
    h("p", { class: "cost" }, h("strong", {}, `About ${duration(taken.two_cores_s)}`), " on two cores of a server"),
    h(
      "dl",
      { class: "facts" },
      row("Particles", count(e.particles)),
      row("Recording", `${count(e.frames)} frames, ${number(e.end_time)} s`),
      row("Steps", count(e.steps), `${many(e.particle_steps)} particle steps`),
      row(
        "Cells",
        e.cells
          .filter((n, axis) => axis < 2 || n > 1)
          .map(count)
          .join(" × "),
      ),
      row(
        "Memory",
        bytes(e.host_memory_bytes),
        e.device_memory_bytes ? `${bytes(e.device_memory_bytes)} on a GPU` : "CPU only",
      ),
      row("Step", quantity(e.dt_s, "s"), e.dt_reason),
      row("Integrator", e.integrator, e.integrator_reason),
    ),
    compared,
    notices.length > 0 && [
      h("h3", {}, "Notices"),
      h(
        "ul",
        { class: "faults notices" },
        notices.map((one) => fault(one, reach)),
      ),
    ],
  ];
}
