// The list of jobs: filters, pages, selection, and what can be done with what is selected.

import { all, cancel, hasEnded, remove, rerun } from "./actions.js";
import { get, repeat } from "./api.js";
import { announce, h, text } from "./dom.js";
import { ago, count, device, duration, ordinal, percent, when } from "./format.js";
import { failed } from "./problem.js";
import { Selection } from "./selection.js";

const STATES = ["queued", "running", "succeeded", "failed", "canceled"];
const MARKS = { queued: "◷", running: "▶", succeeded: "✓", failed: "✕", canceled: "⊘" };
const PAGE = 25;

/** The state of a job, in a mark and a word. */
export function badge() {
  const mark = h("span", { "aria-hidden": "true" });
  const word = h("span", {});
  const element = h("span", { class: "badge" }, mark, word);
  const update = (job) => {
    const stopping = job.cancel_requested && job.status === "running";
    element.className = `badge ${job.status}`;
    text(mark, MARKS[job.status]);
    text(word, stopping ? "canceling" : job.status);
  };
  return { element, update };
}

/** How far a job is, in a few words. */
export function progressText(job) {
  const { fraction, eta_s: eta, frames_written: done, frames } = job.progress;
  if (job.status === "queued") return job.queue_position ? `${ordinal(job.queue_position)} in the queue` : "waiting";
  if (job.status !== "running")
    return hasEnded(job) && done < frames ? `${count(done)} of ${count(frames)} frames` : `${count(frames)} frames`;
  return eta === null ? percent(fraction) : `${percent(fraction)}, ${duration(eta)} left`;
}

export function jobs(main, query, signal) {
  const wanted = new URLSearchParams(query);
  let cursors = [""];
  let next = null;
  const rows = new Map();
  const seen = new Map();

  const states = STATES.map((state) => {
    const box = h("input", { type: "checkbox", value: state, checked: wanted.getAll("status").includes(state) });
    box.addEventListener("change", restart);
    return h("label", { class: "chip" }, box, h("span", {}, state));
  });
  const search = h("input", {
    type: "search",
    id: "search",
    value: wanted.get("text") ?? "",
    placeholder: "name, or #tag",
    autocomplete: "off",
    oninput: () => {
      clearTimeout(typing);
      typing = setTimeout(restart, 250);
    },
  });
  let typing = 0;

  const chosen = () => selection.ids.map((id) => rows.get(id)?.job).filter(Boolean);
  const act = (what) => async () => {
    if (await what(chosen())) selection.clear();
    refresh();
  };
  const told = h("p", { class: "told", id: "selected", role: "status" });
  const some = [
    h("button", { type: "button", onclick: act(cancel) }, "Cancel"),
    h("button", { type: "button", onclick: act(rerun) }, "Run again"),
    h("button", { type: "button", class: "danger", onclick: act(remove) }, "Delete"),
    h("button", { type: "button", class: "quiet", onclick: () => selection.clear() }, "Select none"),
  ];
  const everything = (what) => async () => {
    const { name, tag, status } = filter();
    const terms = [name && `named ${name}`, tag.length && `tagged ${tag.join(", ")}`].filter(Boolean).join(", ");
    await all(what, { status, tag, ...(name ? { name } : {}) }, terms ? ` ${terms}` : "");
    refresh();
  };
  const many = [
    h("button", { type: "button", class: "quiet", onclick: everything("cancel") }, "Cancel all that match…"),
    h("button", { type: "button", class: "quiet", onclick: everything("delete") }, "Delete all that match…"),
  ];

  const bulk = h("div", { class: "bulk", hidden: true }, told, h("div", { class: "actions" }, some, many));
  const box = h("input", { type: "checkbox", id: "all", "aria-label": "Select all jobs of this page" });
  box.addEventListener("change", () => selection.set([...rows.values()], box.checked));
  const body = h("tbody", {});
  const columns = ["Job", "State", "Progress", "Device", "Particles", "Submitted"];
  const table = h(
    "table",
    { class: "jobs" },
    h("caption", { class: "hidden" }, "Jobs, the newest first. Space selects a job, arrows with Shift select several."),
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        h("th", { scope: "col", class: "select" }, box),
        columns.map((name) => h("th", { scope: "col" }, name)),
      ),
    ),
    body,
  );
  const empty = h("div", { class: "empty", hidden: true });
  const errors = h("div", { role: "alert" });
  const older = h("button", { type: "button", onclick: () => turn(1) }, "Older");
  const newer = h("button", { type: "button", onclick: () => turn(-1) }, "Newer");
  const pager = h("nav", { class: "pager", "aria-label": "Pages" }, newer, older);
  const devices = h("p", { class: "devices" });
  const selection = new Selection(() => [...rows.values()], selected);

  main.append(
    h("div", { class: "title" }, h("h1", {}, "Jobs"), h("a", { class: "button primary", href: "#/new" }, "New job")),
    devices,
    h(
      "form",
      { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() },
      h("fieldset", {}, h("legend", { class: "hidden" }, "States"), states),
      h(
        "label",
        { for: "search" },
        h("span", { class: "hidden" }, "Find by the beginning of the name, or by #tag"),
        search,
      ),
    ),
    bulk,
    errors,
    h("div", { class: "scroll" }, table),
    empty,
    pager,
  );
  selected([]);

  function filter() {
    const words = search.value.trim().split(/\s+/).filter(Boolean);
    const tag = words.filter((word) => word.startsWith("#") && word.length > 1).map((word) => word.slice(1));
    const name = words.filter((word) => !word.startsWith("#")).join(" ");
    const status = states
      .map((label) => label.firstChild)
      .filter((input) => input.checked)
      .map((input) => input.value);
    return { status, tag, name: name && `${name.replace(/\*$/, "")}*` };
  }

  function restart() {
    cursors = [""];
    // The address has the filter, so that it can be kept and shared. Nothing has to be drawn anew.
    const { status } = filter();
    const kept = new URLSearchParams([
      ...status.map((one) => ["status", one]),
      ...(search.value ? [["text", search.value]] : []),
    ]);
    history.replaceState(null, "", `#/${kept.size ? `?${kept}` : ""}`);
    refresh();
  }

  function turn(by) {
    if (by > 0) cursors.push(next);
    else cursors.pop();
    selection.clear();
    refresh();
  }

  function selected(ids) {
    const n = ids.length;
    text(told, n ? `${n} selected` : "Nothing is selected.");
    some.forEach((button) => (button.hidden = !n));
    many.forEach((button) => (button.hidden = Boolean(n)));
    box.checked = n > 0 && n === rows.size;
    box.indeterminate = n > 0 && n < rows.size;
  }

  async function load() {
    const { status, tag, name } = filter();
    const terms = new URLSearchParams({ limit: PAGE });
    if (status.length) terms.set("status", status.join(","));
    if (tag.length) terms.set("tag", tag.join(","));
    if (name) terms.set("name", name);
    if (cursors.at(-1)) terms.set("cursor", cursors.at(-1));
    let page;
    try {
      page = await get(`/v1/jobs?${terms}`, signal);
    } catch (error) {
      if (error.problem) errors.replaceChildren(failed(error));
      throw error;
    }
    errors.replaceChildren();
    draw(page.jobs);
    next = page.next_cursor;
    older.disabled = !next;
    newer.disabled = cursors.length < 2;
    pager.hidden = older.disabled && newer.disabled;
  }

  function draw(list) {
    const known = new Set(list.map((job) => job.id));
    for (const [id, row] of rows) {
      if (!known.has(id)) {
        row.element.remove();
        rows.delete(id);
      }
    }
    list.forEach((job, at) => {
      const row = rows.get(job.id) ?? makeRow(job);
      row.update(job);
      rows.delete(job.id);
      rows.set(job.id, row);
      if (body.children[at] !== row.element) body.insertBefore(row.element, body.children[at] ?? null);
      if (seen.has(job.id) && seen.get(job.id) !== job.status) announce(`${job.name}: ${job.status}`);
      seen.set(job.id, job.status);
    });
    selection.keep(known);
    selected(selection.ids);
    table.hidden = bulk.hidden = !list.length;
    empty.hidden = list.length > 0;
    if (list.length) return;
    const { status, tag, name } = filter();
    const filtered = status.length || tag.length || name;
    const what = filtered ? "No job matches this filter." : "No jobs yet.";
    const hint = filtered
      ? h("button", { type: "button", onclick: clear }, "Show all jobs")
      : h("p", {}, "Choose a scene of the library, or paste one of yours: ", h("a", { href: "#/new" }, "new job"), ".");
    if (empty.dataset.what !== what) empty.replaceChildren(h("p", {}, h("strong", {}, what)), hint);
    empty.dataset.what = what;
  }

  function clear() {
    search.value = "";
    states.forEach((label) => (label.firstChild.checked = false));
    restart();
  }

  function makeRow(first) {
    const state = badge();
    const link = h("a", { href: `#/jobs/${first.id}` });
    const tags = h("span", { class: "tags" });
    const sweep = first.sweep && h("a", { class: "of", href: `#/sweeps/${first.sweep}` }, "sweep");
    const narrow = h("span", { class: "narrow" });
    const bar = h("progress", { max: 1 });
    const words = h("span", {});
    const cells = [1, 2, 3].map(() => h("td", {}));
    const check = h("input", { type: "checkbox" });
    const element = h(
      "tr",
      {},
      h("td", { class: "select" }, check),
      h("th", { scope: "row" }, link, sweep && [" ", sweep], tags, narrow),
      h("td", {}, state.element),
      h("td", { class: "progress" }, bar, words),
      cells,
    );
    const row = { id: first.id, box: check, element, job: first, update };
    function update(job) {
      row.job = job;
      text(link, job.name);
      sweep?.setAttribute("aria-label", `sweep of ${job.name}`);
      check.setAttribute("aria-label", `Select ${job.name}, ${job.status}`);
      text(tags, job.tags.map((tag) => `#${tag}`).join(" "));
      state.update(job);
      bar.hidden = job.status !== "running";
      bar.value = job.progress.fraction;
      bar.setAttribute("aria-label", `Progress of ${job.name}`);
      text(words, progressText(job));
      text(narrow, progressText(job));
      text(cells[0], device(job.backend));
      cells[0].title = job.backend?.device ?? "";
      text(cells[1], count(job.particles));
      text(cells[2], ago(job.created_at));
      cells[2].title = when(job.created_at);
    }
    selection.watch(row);
    check.checked = selection.has(first.id);
    return row;
  }

  async function loadDevices() {
    const { state, reason, devices: list } = await get("/v1/devices", signal);
    const names = list.map((one) => (one.kind === "cpu" ? `CPU (${one.device})` : one.device)).join(", then ");
    text(devices, state === "ready" ? `Jobs run on ${names}.` : `No job runs now: ${reason}.`);
    devices.classList.toggle("bad", state === "unusable" || state === "stopped");
    devices.title = reason;
  }

  const refresh = repeat(load, 1500, signal);
  repeat(loadDevices, 15000, signal);
}
