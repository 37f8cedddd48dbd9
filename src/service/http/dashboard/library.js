// The scenes that come with the program, to choose from.

import { get, request } from "./api.js";
import { h } from "./dom.js";
import { failed } from "./problem.js";

/** Scenes that run in moments, and show what to expect. */
const FIRST = ["quickstart", "bouncing-ball", "elastic-gate-2d", "dam-break"];

/** The list. `take` gets the text of the one that is chosen; `wanted` is one to begin with. */
export function library(take, wanted, signal) {
  const found = h("ul", { class: "library" });
  const find = h("input", {
    type: "search",
    id: "find",
    placeholder: "Find a scene",
    autocomplete: "off",
    oninput: list,
  });
  const small = h("input", { type: "checkbox", id: "small", onchange: list });
  const element = h(
    "section",
    { class: "card source", "aria-labelledby": "library-title" },
    h("h2", { id: "library-title" }, "Library"),
    h(
      "div",
      { class: "find" },
      h("label", { for: "find", class: "hidden" }, "Find a scene of the library"),
      find,
      h("label", { class: "check" }, small, "small"),
    ),
    found,
  );
  let all = [];

  const oops = (error) => signal.aborted || found.replaceChildren(h("li", {}, failed(error)));
  get("/v1/library", signal).then(({ scenes }) => {
    const rank = ({ name }) => (FIRST.includes(name) ? FIRST.indexOf(name) : FIRST.length);
    all = scenes.sort((a, b) => rank(a) - rank(b));
    list();
    if (wanted) choose(wanted);
  }, oops);

  function list() {
    const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = ({ name, description }) =>
      words.every((word) => `${name} ${description}`.toLowerCase().includes(word)) &&
      (!small.checked || name.endsWith("-small") || !all.some((other) => other.name === `${name}-small`));
    const shown = all.filter(fits);
    found.replaceChildren(
      ...shown.map(({ name, description, dimension }) =>
        h(
          "li",
          {},
          h(
            "button",
            { type: "button", "data-scene": name, onclick: () => choose(name) },
            h("strong", {}, name),
            dimension === 2 && h("span", { class: "note" }, "2D"),
            h("span", { class: "about" }, description),
          ),
        ),
      ),
    );
    if (!shown.length) found.append(h("li", { class: "note" }, "No scene has these words."));
  }

  async function choose(scene) {
    try {
      take(await (await request("GET", `/v1/library/${encodeURIComponent(scene)}`, { signal })).text());
      found.querySelectorAll("button").forEach((one) => one.classList.toggle("chosen", one.dataset.scene === scene));
    } catch (error) {
      oops(error);
    }
  }
  return { element };
}
