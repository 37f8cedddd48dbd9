// A plot of series over a common axis, in SVG: axes with units, a legend that hides series, values under the pointer or
// the arrow keys, a summary for readers, and the numbers as a table.

import { h, s, text } from "./dom.js";
import { number, prefix } from "./format.js";

const [LEFT, RIGHT, TOP, BOTTOM, HEIGHT] = [62, 12, 10, 40, 210];
const MOST_ROWS = 40;

/** Round numbers over a range, about as many as asked for. */
export function ticks(low, high, n) {
  const raw = (high - low) / n;
  if (!(raw > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= raw);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, k) => Number(((first + k) * step).toPrecision(12)));
}

/** Significant digits that tell values apart which lie a step from each other. */
function digits(low, high, step) {
  const largest = Math.max(Math.abs(low), Math.abs(high));
  return Math.min(12, Math.max(3, Math.floor(Math.log10(largest)) - Math.floor(Math.log10(step) + 1e-9) + 1));
}

/** Powers of ten in a range, with twos and fives between them where they are few. */
function decades(low, high) {
  const [from, to] = [low, high].map((x) => Math.floor(Math.log10(x)));
  const all = (factors) =>
    Array.from({ length: to - from + 1 }, (_, k) => factors.map((f) => Number((f * 10 ** (from + k)).toPrecision(3))))
      .flat()
      .filter((x) => x >= low * (1 - 1e-9) && x <= high * (1 + 1e-9));
  return all([1]).length < 3 ? all([1, 2, 5]) : all([1]);
}

/** Lowest and highest of what is shown, with room around it. */
function extent(lists, fromZero) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) {
    for (const value of list) {
      if (!Number.isFinite(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) return [0, 1];
  if (fromZero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  const room = high > low ? 0.05 * (high - low) : Math.abs(high) * 0.1 || 1;
  return [low - (fromZero && low === 0 ? 0 : room), high + (fromZero && high === 0 && low < 0 ? 0 : room)];
}

/** A plot. `series` have a `name` and a column `key`; `update` takes the rows. Values are shown with a prefix of the
 * unit if they are to be `scaled`. Rows are joined by a `line`, have `dots`, or both. Where `x` has `words`, they are
 * what its values count; where it is `log`, all of it is above 0. */
export function plot({ title, unit, scaled = false, series, x, fromZero = true, line: joined = true, dots = false }) {
  const svg = s("svg", { height: HEIGHT, "aria-hidden": "true" });
  const area = h("div", { class: "plot-area", tabindex: 0, role: "img" }, svg);
  const values = h("p", { class: "values", "aria-live": "polite" });
  const measure = h("span", { class: "note" });
  const hidden = new Set();
  const legend = h(
    "div",
    { class: "legend", role: "group", "aria-label": `Series of ${title}` },
    series.map(({ name, key }, n) => {
      const swatch = s(
        "svg",
        { width: 22, height: 8, "aria-hidden": "true" },
        s("line", { x1: 0, x2: 22, y1: 4, y2: 4, class: `series s${n}` }),
      );
      const button = h("button", { type: "button", "aria-pressed": "true" }, swatch, name);
      button.addEventListener("click", () => {
        if (!hidden.delete(key)) hidden.add(key);
        button.setAttribute("aria-pressed", String(!hidden.has(key)));
        draw();
      });
      return button;
    }),
  );
  const table = h("details", { class: "numbers", ontoggle: () => tabulate() }, h("summary", {}, "Numbers"));
  const element = h(
    "figure",
    { class: "plot" },
    h("figcaption", {}, h("span", { class: "plot-title" }, title), measure),
    area,
    values,
    series.length > 1 && legend,
    table,
  );
  let [rows, mark, scales] = [[], null, null];

  let [factor, shownUnit] = [1, unit];
  let exact = 3;
  const say = (value) => number(value / factor, exact);
  const sayX = (value) => x.words?.[value] ?? number(value);
  const spaced = () => (shownUnit ? ` ${shownUnit}` : "");

  /** Takes the prefix of the unit that suits the largest value. */
  function scale() {
    const sizes = series.flatMap(({ key }) => rows.map((row) => Math.abs(row[key]))).filter(Number.isFinite);
    const largest = sizes.reduce((a, b) => Math.max(a, b), 0);
    const [by, sign] = scaled && largest > 0 ? prefix(largest) : [1, ""];
    [factor, shownUnit] = [by, sign + unit];
    text(measure, shownUnit ? ` (${shownUnit})` : "");
  }

  const shown = () => series.filter(({ key }) => !hidden.has(key) && rows.some((row) => Number.isFinite(row[key])));

  function draw() {
    const width = area.clientWidth;
    if (!width || !rows.length) return;
    const [xs, list] = [rows.map((row) => row[x.key]), shown()];
    const place = x.log ? Math.log : (value) => value;
    let [x0, x1] = [xs[0], xs.at(-1)].map(place);
    if (!(x1 > x0)) x1 = x0 + 1;
    // Words have room around them, and so has what is alone.
    if (x.words || (dots && xs.at(-1) === xs[0])) [x0, x1] = [place(xs[0]) - 0.5, place(xs.at(-1)) + 0.5];
    else if (dots) [x0, x1] = [x0 - 0.03 * (x1 - x0), x1 + 0.03 * (x1 - x0)];
    const [y0, y1] = extent(
      list.map(({ key }) => rows.map((row) => row[key])),
      fromZero,
    );
    const right = (value) => LEFT + ((place(value) - x0) / (x1 - x0)) * (width - LEFT - RIGHT);
    const down = (value) => HEIGHT - BOTTOM - ((value - y0) / (y1 - y0)) * (HEIGHT - TOP - BOTTOM);
    scales = { right, down, width };
    const label = (where, value) => s("text", where, value);
    const parts = [];
    const heights = ticks(y0, y1, 5);
    exact = heights.length > 1 ? digits(heights[0], heights.at(-1), heights[1] - heights[0]) : 3;
    for (const value of heights) {
      const y = down(value);
      parts.push(s("line", { x1: LEFT, x2: width - RIGHT, y1: y, y2: y, class: value === 0 ? "zero" : "grid" }));
      parts.push(label({ x: LEFT - 8, y: y + 4, "text-anchor": "end" }, say(value)));
    }
    const most = Math.max(2, Math.floor(width / 110));
    const marks = x.words ? x.words.map((_, n) => n) : x.log ? decades(xs[0], xs.at(-1)) : ticks(x0, x1, most);
    for (const value of marks) {
      parts.push(
        s("line", { x1: right(value), x2: right(value), y1: HEIGHT - BOTTOM, y2: HEIGHT - BOTTOM + 4, class: "grid" }),
      );
      parts.push(label({ x: right(value), y: HEIGHT - BOTTOM + 17, "text-anchor": "middle" }, sayX(value)));
    }
    parts.push(s("text", { x: (LEFT + width - RIGHT) / 2, y: HEIGHT - 4, "text-anchor": "middle" }, x.label));
    for (const one of list) {
      const kind = `s${series.indexOf(one)}`;
      if (joined) parts.push(s("path", { d: line(xs, one.key, right, down, width), class: `series ${kind}` }));
      for (const row of dots ? rows.filter((row) => Number.isFinite(row[one.key])) : []) {
        parts.push(s("circle", { cx: right(row[x.key]), cy: down(row[one.key]), r: 4, class: `dot ${kind}` }));
      }
    }
    svg.setAttribute("width", width);
    svg.replaceChildren(...parts, s("g", { class: "mark" }));
    area.setAttribute("aria-label", `${title} over ${x.label}. ${summary(list)} Arrow keys read the values.`);
    point(mark);
  }

  /** A path, of no more points than pixels: of each pixel the lowest and the highest value. */
  function line(xs, key, right, down, width) {
    let [path, pen] = ["", "M"];
    const every = Math.max(1, Math.floor(rows.length / width));
    for (let at = 0; at < rows.length; at += every) {
      let [low, high] = [at, at];
      for (let k = at; k < Math.min(at + every, rows.length); k += 1) {
        if (rows[k][key] < rows[low][key]) low = k;
        if (rows[k][key] > rows[high][key]) high = k;
      }
      for (const k of low === high ? [low] : [Math.min(low, high), Math.max(low, high)]) {
        if (rows[k][key] === undefined) continue;
        if (!Number.isFinite(rows[k][key])) {
          pen = "M";
          continue;
        }
        path += `${pen}${right(xs[k]).toFixed(1)} ${down(rows[k][key]).toFixed(1)}`;
        pen = "L";
      }
    }
    return path;
  }

  function summary(list) {
    const said = list.map(({ name, key }) => {
      const all = rows.map((row) => row[key]).filter(Number.isFinite);
      const [low, high] = [all.reduce((a, b) => Math.min(a, b)), all.reduce((a, b) => Math.max(a, b))];
      return `${name}: ${say(low)} to ${say(high)}, at last ${say(all.at(-1))}${spaced()}.`;
    });
    return said.join(" ");
  }

  /** Marks a row and says its values. */
  function point(n) {
    mark = n === null ? null : Math.min(rows.length - 1, Math.max(0, n));
    const group = svg.querySelector(".mark");
    group?.replaceChildren();
    const row = rows[mark ?? rows.length - 1];
    if (!row || !group) return;
    const list = shown();
    const said = list.map(({ name, key }) => `${name} ${say(row[key])}`).join(", ");
    text(values, `${x.name} ${sayX(row[x.key])}${x.unit ? ` ${x.unit}` : ""}: ${said}${spaced()}`);
    if (mark === null) return;
    const at = scales.right(row[x.key]);
    group.append(s("line", { x1: at, x2: at, y1: TOP, y2: HEIGHT - BOTTOM, class: "cursor" }));
    for (const one of list) {
      if (Number.isFinite(row[one.key])) {
        group.append(
          s("circle", { cx: at, cy: scales.down(row[one.key]), r: 3.5, class: `dot s${series.indexOf(one)}` }),
        );
      }
    }
  }

  function tabulate() {
    if (!table.open) return;
    const n = Math.min(rows.length, MOST_ROWS);
    const chosen = Array.from({ length: n }, (_, k) => rows[Math.round((k * (rows.length - 1)) / Math.max(1, n - 1))]);
    const head = [x.label, ...series.map(({ name }) => (shownUnit ? `${name} (${shownUnit})` : name))];
    const cells = (row) => series.map(({ key }) => h("td", {}, say(row[key])));
    const caption = n < rows.length ? `${title}: ${n} of ${rows.length} rows; the CSV has all` : title;
    const content = h(
      "table",
      {},
      h("caption", {}, caption),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          head.map((name) => h("th", { scope: "col" }, name)),
        ),
      ),
      h(
        "tbody",
        {},
        chosen.map((row) => h("tr", {}, h("th", { scope: "row" }, sayX(row[x.key])), cells(row))),
      ),
    );
    table.querySelector(".scroll")?.remove();
    table.append(
      h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": `Numbers of ${title}` }, content),
    );
  }

  area.addEventListener("pointermove", (event) => {
    if (!scales || !rows.length) return;
    const away = (row) => Math.abs(scales.right(row[x.key]) - event.offsetX);
    let best = 0;
    rows.forEach((row, n) => {
      if (away(row) < away(rows[best])) best = n;
    });
    point(best);
  });
  area.addEventListener("pointerleave", () => point(null));
  area.addEventListener("blur", () => point(null));
  area.addEventListener("keydown", (event) => {
    const [last, large] = [rows.length - 1, Math.max(1, Math.round(rows.length / 20))];
    const from = mark ?? last;
    const to = {
      ArrowLeft: from - 1,
      ArrowRight: from + 1,
      PageDown: from - large,
      PageUp: from + large,
      Home: 0,
      End: last,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    point(to);
  });
  const size = new ResizeObserver(draw);
  size.observe(area);

  const update = (given) => {
    rows = given;
    scale();
    draw();
    tabulate();
  };
  return { element, update };
}
