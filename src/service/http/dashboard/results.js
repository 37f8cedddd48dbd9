// What the jobs of a sweep have come to: a plot of a result over a parameter.

import { h } from "./dom.js";
import { plot } from "./plot.js";
import { brief, shown } from "./values.js";

const MOST_SERIES = 4;
/** Values that differ by this factor are shown by their magnitudes. */
const FAR_APART = 30;
const NUMBER = "number of the job";
const TAKEN = [
  ["last", "at the end"],
  ["least", "smallest"],
  ["most", "largest"],
];

/** The unit of a column of diagnostics, by its name. */
function unit(column) {
  const ends = [
    ["_kg", "kg"],
    ["_j", "J"],
    ["_s", "s"],
    ["speed", "m/s"],
  ];
  if (/(^|_)angular_momentum_.$/.test(column)) return "kg m²/s";
  if (/momentum_.$/.test(column)) return "kg m/s";
  if (/force_.$/.test(column)) return "N";
  if (/torque_.$/.test(column)) return "N m";
  return ends.find(([end]) => column.endsWith(end))?.[1] ?? "";
}

const called = (column) => column.replace(/_(kg|j|s)$/, "").replaceAll("_", " ");

/** The plot with its choices. `update` takes the jobs; `value(job)` is the result that is chosen, `label()` its
 * name. */
export function results(changed) {
  const select = (id, what) => h("select", { id, onchange: what });
  const [over, result, taken] = [select("over", draw), select("result", draw), select("taken", draw)];
  taken.append(...TAKEN.map(([value, label]) => h("option", { value }, label)));
  taken.value = "most";
  const takes = h("label", {}, "taken ", taken);
  const place = h("div", {});
  const element = h(
    "div",
    { class: "results" },
    h("div", { class: "controls" }, h("label", {}, "Result ", result), takes, h("label", {}, "over ", over)),
    place,
  );
  let [jobs, made, drawn] = [[], "", null];

  const keep = (list, options, first) => {
    const told = options.map(([value]) => value).join("\n");
    if (list.dataset.told === told) return;
    const before = list.value;
    list.dataset.told = told;
    list.replaceChildren(...options.map(([value, label]) => h("option", { value }, label)));
    list.value = options.some(([value]) => value === before) ? before : first;
  };

  function value(job) {
    if (result.value === "run_s") return job.run_s;
    if (result.value === "steps") return job.progress.step;
    return job.diagnostics[result.value]?.[taken.value] ?? NaN;
  }
  const isColumn = () => !["run_s", "steps"].includes(result.value);
  const measure = () => (result.value === "run_s" ? "s" : isColumn() ? unit(result.value) : "");
  function label() {
    if (!result.value) return "Result";
    const name = result.selectedOptions[0]?.textContent ?? "";
    const how = isColumn() ? `, ${taken.selectedOptions[0].textContent}` : "";
    return `${name.replace(/ \(.*\)$/, "")}${how}${measure() ? ` (${measure()})` : ""}`;
  }

  function draw() {
    takes.hidden = !isColumn();
    const path = over.value;
    const all = jobs.map((job, n) => ({ job, x: path === NUMBER ? n + 1 : job.values[path], y: value(job) }));
    const words = all.some(({ x }) => typeof x !== "number") ? [...new Set(all.map(({ x }) => shown(x)))] : null;
    const at = ({ x }) => (words ? words.indexOf(shown(x)) : x);
    const others = Object.keys(jobs[0]?.values ?? {}).filter((one) => one !== path && path !== NUMBER);
    const names = brief(Object.keys(jobs[0]?.values ?? {}));
    const group = ({ job }) => others.map((one) => `${names.get(one)} ${shown(job.values[one])}`).join(", ");
    const groups = [...new Set(all.map(group))];
    const apart = groups.length <= MOST_SERIES;
    const series = apart
      ? groups.map((name, n) => ({ name: name || "result", key: `s${n}` }))
      : [{ name: "jobs", key: "s0" }];
    const rows = apart
      ? pivoted(all, at, (one) => groups.indexOf(group(one)))
      : all.map((one) => ({ x: at(one), s0: one.y }));
    rows.sort((a, b) => a.x - b.x);
    const [low, high] = [rows[0].x, rows.at(-1).x];
    const log = !words && path !== NUMBER && low > 0 && high >= FAR_APART * low;
    const now = JSON.stringify([path, result.value, taken.value, series, words, log]);
    if (now !== made) {
      made = now;
      drawn = plot({
        title: label().replace(/ \([^)]*\)$/, ""),
        unit: measure(),
        series,
        x: { key: "x", name: "at", unit: "", label: (names.get(path) ?? path).replaceAll("_", " "), words, log },
        fromZero: false,
        dots: true,
        line: apart && !words,
      });
      place.replaceChildren(drawn.element);
    }
    drawn.update(rows);
    changed();
  }

  /** Rows of equal x with a member for each group. */
  function pivoted(all, at, group) {
    const found = new Map();
    for (const one of all) {
      const x = at(one);
      const row = found.get(x) ?? { x };
      row[`s${group(one)}`] = one.y;
      found.set(x, row);
    }
    return [...found.values()];
  }

  function update(list) {
    jobs = list;
    const columns = Object.keys(jobs.find((job) => Object.keys(job.diagnostics).length)?.diagnostics ?? {});
    const measured = columns.filter((name) => !["frame", "time_s", "steps"].includes(name));
    const named = measured.map((name) => [name, called(name) + (unit(name) ? ` (${unit(name)})` : "")]);
    element.hidden = !columns.length;
    if (element.hidden) return;
    keep(
      result,
      [...named, ["run_s", "wall time (s)"], ["steps", "steps"]],
      measured.includes("max_speed") ? "max_speed" : "run_s",
    );
    const paths = Object.keys(jobs[0]?.values ?? {});
    keep(
      over,
      [...paths, NUMBER].map((path) => [path, path]),
      paths[0] ?? NUMBER,
    );
    draw();
  }
  return { element, update, value, label };
}
