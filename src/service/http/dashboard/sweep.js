// The page of a sweep: how far it is, its jobs, and a result over a parameter.

import { confirm, announce, h, text, toast } from "./dom.js";
import { get, json, repeat } from "./api.js";
import { duration, number, percent, when } from "./format.js";
import { badge, progressText } from "./jobs.js";
import { failed } from "./problem.js";
import { results } from "./results.js";
import { states } from "./sweeps.js";
import { brief, shown } from "./values.js";

export function sweep(main, id, signal) {
  const title = h("h1", {}, "Sweep");
  const cancel = h("button", { type: "button", class: "danger", hidden: true, onclick: stop }, "Cancel all jobs");
  const away = h("button", { type: "button", class: "danger", hidden: true, onclick: remove }, "Delete all jobs");
  const errors = h("div", { role: "alert" });
  const bar = h("progress", { max: 1, "aria-label": "Progress of the sweep" });
  const far = h("p", { class: "far" });
  const told = results(relabel);
  const none = h("p", { class: "note" }, "Results come with the first frames.");
  const body = h("tbody", {});
  const head = h("tr", {});
  const chosen = h("th", { scope: "col" });
  const rows = new Map();
  let [last, before, paths] = [null, "", null];

  main.append(
    h(
      "div",
      { class: "title" },
      h("div", {}, h("p", { class: "crumbs" }, h("a", { href: "#/sweeps" }, "Sweeps")), title),
      h("div", { class: "actions" }, cancel, away),
    ),
    errors,
    h("div", { class: "progressing" }, bar, far),
    h(
      "section",
      { class: "card charts", "aria-labelledby": "results-title" },
      h("h2", { id: "results-title" }, "Results"),
      none,
      told.element,
    ),
    h(
      "section",
      { class: "card", "aria-labelledby": "sweep-jobs-title" },
      h("h2", { id: "sweep-jobs-title" }, "Jobs"),
      h(
        "div",
        { class: "scroll", tabindex: 0, role: "region", "aria-label": "Jobs of the sweep" },
        h(
          "table",
          { class: "of-sweep" },
          h("caption", { class: "hidden" }, "Jobs of the sweep, in the order of the values"),
          h("thead", {}, head),
          body,
        ),
      ),
    ),
  );

  async function stop() {
    const detail = "What was recorded so far is kept. Jobs that were canceled can be run again, one by one.";
    const title = `Cancel the jobs of “${last.name}” that have not ended?`;
    if (!(await confirm({ title, detail, action: "Cancel now", danger: true }))) return;
    await act(() => json("POST", `/v1/sweeps/${id}/cancel`), "The sweep was canceled.");
  }

  async function remove() {
    const detail = "The jobs and all their files are gone then, and the sweep with them.";
    if (!(await confirm({ title: `Delete all jobs of “${last.name}”?`, detail, action: "Delete", danger: true })))
      return;
    await act(async () => {
      await json("POST", "/v1/jobs:delete", { body: { sweep: id } });
      location.hash = "#/sweeps";
    }, "The sweep was deleted.");
  }

  async function act(what, said) {
    try {
      await what();
      toast(said);
      refresh();
    } catch (error) {
      toast(error.problem?.detail ?? error.message, "bad");
    }
  }

  function relabel() {
    text(chosen, told.label());
    rows.forEach(({ job, result }) => text(result, number(told.value(job), 5)));
  }

  function heading() {
    const names = brief(paths);
    const columns = ["Job", ...paths, "State", "Progress", "Wall time"];
    const cells = columns.map((name) => h("th", { scope: "col", title: name }, names.get(name) ?? name));
    head.replaceChildren(...cells.slice(0, paths.length + 1), chosen, ...cells.slice(paths.length + 1));
  }

  function makeRow(first, n) {
    const state = badge();
    const link = h("a", { href: `#/jobs/${first.id}`, "aria-label": `Job ${n + 1}: ${first.name}` }, `${n + 1}`);
    const [result, progress, time] = [h("td", {}), h("td", {}), h("td", {})];
    const values = paths.map((path) => h("td", {}, shown(first.values[path])));
    const name = paths.length ? link : [link, ` ${first.name}`];
    const element = h(
      "tr",
      {},
      h("th", { scope: "row" }, name),
      values,
      result,
      h("td", {}, state.element),
      progress,
      time,
    );
    const row = { element, result, job: first };
    row.update = (job) => {
      row.job = job;
      state.update(job);
      text(progress, progressText(job));
      text(time, job.run_s ? duration(job.run_s) : "–");
    };
    return row;
  }

  function draw(jobs) {
    if (!paths) {
      paths = Object.keys(jobs[0]?.values ?? {});
      heading();
    }
    const known = new Set(jobs.map((job) => job.id));
    rows.forEach((row, one) => known.has(one) || (row.element.remove(), rows.delete(one)));
    jobs.forEach((job, n) => {
      const row = rows.get(job.id) ?? makeRow(job, n);
      if (!rows.has(job.id)) body.append(row.element);
      rows.set(job.id, row);
      row.update(job);
    });
    told.update(jobs);
    none.hidden = !told.element.hidden;
    relabel();
  }

  async function load() {
    const now = await get(`/v1/sweeps/${id}`, signal).catch((error) => {
      if (error.problem?.status === 404) return null;
      throw error;
    });
    // A sweep goes with its jobs.
    if (!now?.total) {
      text(title, "There is no such sweep");
      main.replaceChildren(h("div", { class: "title" }, title), h("p", {}, h("a", { href: "#/sweeps" }, "All sweeps")));
      return;
    }
    if (last && !last.ended && now.ended) announce(`${now.name}: all jobs have ended.`);
    last = now;
    text(title, now.name);
    document.title = `${now.name}, sweep · Gridfall`;
    bar.value = now.fraction;
    cancel.hidden = now.ended;
    away.hidden = !now.ended;
    const shares = [now.ended ? "ended" : percent(now.fraction), states(now), `submitted ${when(now.created_at)}`];
    text(far, shares.join(" · "));
    // What has ended does not change, but a job may be deleted.
    const seen = JSON.stringify(now.jobs);
    if (now.ended && seen === before) return;
    const { jobs } = await get(`/v1/sweeps/${id}/results`, signal);
    draw(jobs);
    before = seen;
    errors.replaceChildren();
  }

  const refresh = repeat(
    () =>
      load().catch((error) => {
        if (error.problem) errors.replaceChildren(failed(error));
        throw error;
      }),
    1500,
    signal,
  );
}
