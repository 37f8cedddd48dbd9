// What a scene will cost, in words and numbers.

import { h, prose } from "./dom.js";
import { bytes, count, duration, many, number, quantity } from "./format.js";
import { fault } from "./problem.js";
import { brief, shown } from "./values.js";

const fact = (name, value, note) => [
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
      fact("Particles", count(e.particles)),
      fact("Recording", `${count(e.frames)} frames, ${number(e.end_time)} s`),
      fact("Steps", count(e.steps), `${many(e.particle_steps)} particle steps`),
      fact(
        "Cells",
        e.cells
          .filter((n, axis) => axis < 2 || n > 1)
          .map(count)
          .join(" × "),
      ),
      fact(
        "Memory",
        bytes(e.host_memory_bytes),
        e.device_memory_bytes ? `${bytes(e.device_memory_bytes)} on a GPU` : "CPU only",
      ),
      fact("Step", quantity(e.dt_s, "s"), e.dt_reason),
      fact("Integrator", e.integrator, e.integrator_reason),
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

/** What the jobs of a sweep will cost. */
export function sweepCost({ jobs, estimate_s: total }) {
  const paths = Object.keys(jobs[0].values);
  const costs = jobs.map((job) => job.estimate_s);
  const [least, most] = [Math.min(...costs), Math.max(...costs)].map(duration);
  const names = brief(paths);
  const head = [...paths, "Particles", "Time"].map((name) =>
    h("th", { scope: "col", title: name }, names.get(name) ?? name),
  );
  const row = (job) =>
    h(
      "tr",
      {},
      paths.map((path, n) => h(n ? "td" : "th", n ? {} : { scope: "row" }, shown(job.values[path]))),
      h("td", {}, count(job.particles)),
      h("td", {}, duration(job.estimate_s)),
    );
  return [
    h("p", { class: "cost" }, h("strong", {}, `About ${duration(total)}`), " together on two cores of a server"),
    h(
      "dl",
      { class: "facts" },
      fact("Jobs", count(jobs.length)),
      fact("Each", least === most ? least : `${least} to ${most}`),
    ),
    h(
      "details",
      { class: "numbers", open: jobs.length <= 12 },
      h("summary", {}, "All jobs"),
      h(
        "div",
        { class: "scroll", tabindex: 0, role: "region", "aria-label": "Jobs of the sweep" },
        h("table", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, jobs.map(row))),
      ),
    ),
  ];
}
