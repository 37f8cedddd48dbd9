// The parameters of a sweep: paths in the scene, each with values or a range.

import { h, text } from "./dom.js";
import { listed, paths, ranged, shown } from "./values.js";

const MOST_JOBS = 256;
const MOST_SHOWN = 12;

/** The form. `changed` is called after each change; `grid()` is what to combine, or null without parameters, and
 * throws with the reason where it is not complete. `update(scene)` tells it which paths there are. */
export function sweepForm(changed) {
  const known = h("datalist", { id: "paths" });
  const rows = [];
  const list = h("div", { class: "parameters" });
  const total = h("p", { class: "note", role: "status", id: "sweep-total" });
  const add = h("button", { type: "button", onclick: () => append(true) }, "Add a parameter");
  const element = h(
    "section",
    { class: "card sweep", "aria-labelledby": "sweep-title" },
    h("h2", { id: "sweep-title" }, "Sweep"),
    h(
      "p",
      { class: "note" },
      "Runs the scene with several values, every value of one parameter with every value of the others: a job each.",
    ),
    known,
    list,
    h("div", { class: "actions" }, add, total),
  );
  let [scene, numbered] = [new Map(), 0];

  function append(focus) {
    const row = parameter((numbered += 1));
    rows.push(row);
    list.append(row.element);
    if (focus) row.path.focus();
    told();
  }

  function parameter(n) {
    const field = (name, label, properties) => {
      const input = h("input", { id: `${name}-${n}`, autocomplete: "off", oninput: told, ...properties });
      return { input, element: h("div", { class: "field" }, h("label", { for: `${name}-${n}` }, label), input) };
    };
    const number = { type: "number", step: "any" };
    const path = field("path", "Parameter", { list: "paths", placeholder: "as materials.sand.density" });
    const values = field("values", "Values", { placeholder: "with commas between them" });
    const [from, to] = [field("from", "From", number), field("to", "To", number)];
    const count = field("count", "Number of values", { type: "number", min: 2, max: MOST_JOBS, value: "5" });
    const kind = h(
      "select",
      { id: `kind-${n}`, onchange: told },
      [
        ["list", "a list of values"],
        ["range", "a range, evenly"],
        ["ratios", "a range, by even ratios"],
      ].map(([value, label]) => h("option", { value }, label)),
    );
    const range = h("div", { class: "range" }, from.element, to.element, count.element);
    const said = h("p", { class: "note" });
    const legend = h("legend", { class: "hidden" }, `Parameter ${n}`);
    const remove = h("button", { type: "button", class: "quiet", "aria-label": `Remove parameter ${n}` }, "Remove");
    const row = { path: path.input };
    row.element = h(
      "fieldset",
      { class: "parameter" },
      legend,
      h(
        "div",
        { class: "fields" },
        path.element,
        h("div", { class: "field" }, h("label", { for: `kind-${n}` }, "Takes"), kind),
      ),
      values.element,
      range,
      h("div", { class: "actions" }, said, remove),
    );
    row.read = () => {
      const place = path.input.value.trim();
      if (!place) throw new Error("Name the parameter.");
      if (kind.value !== "list") {
        const [first, last] = [from, to].map(({ input }) => (input.value === "" ? NaN : Number(input.value)));
        return [place, ranged(first, last, Number(count.input.value), kind.value === "ratios")];
      }
      const found = listed(values.input.value);
      if (!found.length) throw new Error("Give its values.");
      return [place, found];
    };
    row.tell = () => {
      values.element.hidden = kind.value !== "list";
      range.hidden = kind.value === "list";
      const now = scene.get(path.input.value.trim());
      const has = now === undefined ? "" : ` The scene has ${shown(now)}.`;
      try {
        const [, found] = row.read();
        const first = found.slice(0, MOST_SHOWN).map(shown).join(", ");
        text(said, `${found.length} values: ${first}${found.length > MOST_SHOWN ? ", …" : ""}.${has}`);
      } catch (error) {
        text(said, error.message + has);
      }
    };
    remove.addEventListener("click", () => {
      rows.splice(rows.indexOf(row), 1);
      row.element.remove();
      (rows.at(-1)?.path ?? add).focus();
      told();
    });
    return row;
  }

  function grid() {
    if (!rows.length) return null;
    const all = rows.map((row) => row.read());
    const twice = all.find(([path], n) => all.findIndex(([other]) => other === path) < n);
    if (twice) throw new Error(`${twice[0]} is there twice; put all its values into one.`);
    const jobs = all.reduce((product, [, values]) => product * values.length, 1);
    if (jobs > MOST_JOBS) throw new Error(`${jobs} jobs; a sweep has at most ${MOST_JOBS}. Take fewer values.`);
    return { grid: Object.fromEntries(all), jobs, sizes: all.map(([, values]) => values.length) };
  }

  function told() {
    rows.forEach((row) => row.tell());
    try {
      const found = grid();
      const product = found?.sizes.length > 1 ? `${found.sizes.join(" × ")} = ` : "";
      text(total, found ? `${product}${found.jobs} ${found.jobs === 1 ? "job" : "jobs"}` : "");
    } catch (error) {
      text(total, rows.length ? "The sweep is not complete." : "");
    }
    changed();
  }

  const update = (document) => {
    scene = paths(document);
    known.replaceChildren(...[...scene].map(([path, value]) => h("option", { value: path }, shown(value))));
    rows.forEach((row) => row.tell());
  };
  return { element, update, grid };
}
