// What the colours of the 3D view mean: a scale of values, or the names of bodies.

import { h, text } from "./dom.js";
import { quantity } from "./format.js";
import { viridis } from "./shaders.js";

const MOST_NAMES = 12;
const color = (t) => `rgb(${viridis(t)})`;

/** `scale` takes what is shown, its range and its unit; `bodies` their names and the range. */
export function legend() {
  const bar = h("canvas", { class: "scale", width: 200, height: 1, "aria-hidden": "true" });
  const paint = bar.getContext("2d");
  for (let x = 0; x < 200; x += 1) {
    paint.fillStyle = color(x / 199);
    paint.fillRect(x, 0, 1, 1);
  }
  const [low, high, what] = [h("span", {}), h("span", {}), h("span", { class: "what" })];
  const numbers = h("div", { class: "ends" }, low, high);
  const names = h("ul", { class: "names" });
  const element = h("div", { class: "legend3d", hidden: true }, what, bar, numbers, names);
  let told = "";

  const hide = () => (element.hidden = true);
  const show = (name, listed) => {
    element.hidden = false;
    text(what, name);
    bar.hidden = numbers.hidden = listed;
    names.hidden = !listed;
  };
  const scale = (name, range, unit) => {
    show(name, false);
    // As many digits as tell the ends apart.
    const said = (digits) => range.map((end) => quantity(end, unit, digits));
    const ends = said([3, 4, 5, 6].find((digits) => new Set(said(digits)).size === 2) ?? 3);
    text(low, ends[0]);
    text(high, ends[1]);
  };
  const bodies = (list, range) => {
    show("body", true);
    const now = JSON.stringify([list, range]);
    if (told === now) return;
    told = now;
    const item = (name, n) => {
      const swatch = h("span", { class: "swatch", "aria-hidden": "true" });
      swatch.style.background = color((n - range[0]) / Math.max(range[1] - range[0], 1e-30));
      return h("li", {}, swatch, name);
    };
    const more = list.length - MOST_NAMES;
    names.replaceChildren(
      ...list.slice(0, MOST_NAMES).map(item),
      ...(more > 0 ? [h("li", {}, `and ${more} more`)] : []),
    );
  };
  return { element, hide, scale, bodies };
}
