// The directions of x, y and z in a corner of the 3D view.

import { h, s } from "./dom.js";

const [SIZE, ARM] = [76, 24];

/** `update` takes the camera's axes; what is flat has no z. */
export function axes() {
  const drawing = s("svg", { width: SIZE, height: SIZE, viewBox: `${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${SIZE}` });
  const element = h("div", { class: "axes3d", "aria-hidden": "true" }, drawing);
  const update = ({ right, up, flat = false }) => {
    const arms = ["x", "y", "z"].slice(0, flat ? 2 : 3).map((name, i) => ({ name, x: right[i], y: -up[i] }));
    // The one that points away most is drawn first.
    const away = ({ x, y }) => -Math.hypot(x, y);
    drawing.replaceChildren(
      ...arms
        .sort((a, b) => away(b) - away(a))
        .flatMap(({ name, x, y }) => [
          s("line", { x1: 0, y1: 0, x2: ARM * x, y2: ARM * y, class: `axis-${name}` }),
          s("text", { x: (ARM + 8) * x, y: (ARM + 8) * y + 4, "text-anchor": "middle" }, name),
        ]),
    );
  };
  return { element, update };
}
