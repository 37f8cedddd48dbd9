// The list of sweeps, newest first.

import { get, repeat } from "./api.js";
import { h, text } from "./dom.js";
import { ago, count, percent, when } from "./format.js";
import { failed } from "./problem.js";

const PAGE = 25;
const ORDER = ["running", "queued", "succeeded", "failed", "canceled"];

/** How many jobs of a sweep are in which state. */
export const states = (sweep) =>
  ORDER.filter((state) => sweep.jobs[state])
    .map((state) => `${count(sweep.jobs[state])} ${state}`)
    .join(" · ");

export function sweeps(main, query, signal) {
  const cursors = [""];
  let next = null;
  const rows = new Map();
  const body = h("tbody", {});
  const head = ["Sweep", "Jobs", "Progress", "Submitted"].map((name) => h("th", { scope: "col" }, name));
  const table = h(
    "table",
    { class: "jobs sweeps", hidden: true },
    h("caption", { class: "hidden" }, "Sweeps, the newest first"),
    h("thead", {}, h("tr", {}, head)),
    body,
  );
  const empty = h(
    "div",
    { class: "empty", hidden: true },
    h("p", {}, h("strong", {}, "No sweeps yet.")),
    h("p", {}, "Write a scene and add a parameter: ", h("a", { href: "#/new" }, "new job"), "."),
  );
  const errors = h("div", { role: "alert" });
  const turn = (by) => () => {
    if (by > 0) cursors.push(next);
    else cursors.pop();
    refresh();
  };
  const [older, newer] = [
    h("button", { type: "button", onclick: turn(1) }, "Older"),
    h("button", { type: "button", onclick: turn(-1) }, "Newer"),
  ];
  const pager = h("nav", { class: "pager", "aria-label": "Pages" }, newer, older);
  main.append(
    h(
      "div",
      { class: "title" },
      h("h1", {}, "Sweeps"),
      h("a", { class: "button primary", href: "#/new" }, "New sweep"),
    ),
    errors,
    h("div", { class: "scroll" }, table),
    empty,
    pager,
  );

  function makeRow(first) {
    const link = h("a", { href: `#/sweeps/${first.id}` });
    const [jobs, words, since] = [h("span", {}), h("span", {}), h("td", {})];
    const narrow = h("span", { class: "narrow" });
    const bar = h("progress", { max: 1 });
    const element = h(
      "tr",
      {},
      h("th", { scope: "row" }, link, narrow),
      h("td", {}, jobs),
      h("td", { class: "progress" }, bar, words),
      since,
    );
    const update = (sweep) => {
      text(link, sweep.name);
      text(jobs, states(sweep));
      text(narrow, states(sweep));
      bar.hidden = sweep.ended;
      bar.value = sweep.fraction;
      bar.setAttribute("aria-label", `Progress of ${sweep.name}`);
      text(words, sweep.ended ? "ended" : percent(sweep.fraction));
      text(since, ago(sweep.created_at));
      since.title = when(sweep.created_at);
    };
    return { element, update };
  }

  async function load() {
    const terms = new URLSearchParams({ limit: PAGE, ...(cursors.at(-1) && { cursor: cursors.at(-1) }) });
    let page;
    try {
      page = await get(`/v1/sweeps?${terms}`, signal);
    } catch (error) {
      if (error.problem) errors.replaceChildren(failed(error));
      throw error;
    }
    errors.replaceChildren();
    next = page.next_cursor;
    const known = new Set(page.sweeps.map(({ id }) => id));
    for (const [id, row] of rows) {
      if (known.has(id)) continue;
      row.element.remove();
      rows.delete(id);
    }
    page.sweeps.forEach((sweep, at) => {
      const row = rows.get(sweep.id) ?? makeRow(sweep);
      rows.set(sweep.id, row);
      row.update(sweep);
      if (body.children[at] !== row.element) body.insertBefore(row.element, body.children[at] ?? null);
    });
    table.hidden = !page.sweeps.length;
    empty.hidden = page.sweeps.length > 0;
    older.disabled = !next;
    newer.disabled = cursors.length < 2;
    pager.hidden = older.disabled && newer.disabled;
  }

  const refresh = repeat(load, 1500, signal);
}
