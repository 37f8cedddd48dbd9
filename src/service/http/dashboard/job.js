// The page of a job: how far it is, what it looks like, what its diagnostics say, and what it leaves.

import { cancel, hasEnded, remove, rerun } from "./actions.js";
import { follow, get } from "./api.js";
import { announce, h, prose, text } from "./dom.js";
import { drawnFrame } from "./drawing.js";
import { exports } from "./exports.js";
import { count, duration, many, number, ordinal, percent, when } from "./format.js";
import { badge } from "./jobs.js";
import { downloads, viewers } from "./outputs.js";
import { plots } from "./plots.js";
import { preview } from "./preview.js";
import { failed, fault } from "./problem.js";
import { shown } from "./values.js";

const MOST_LINES = 500;
const BETWEEN = 1500;

const card = (id, title, ...content) =>
  h(
    "section",
    { class: `card ${id}`, "aria-labelledby": `${id}-title` },
    h("h2", { id: `${id}-title` }, title),
    content,
  );

export function job(main, id, signal) {
  const state = badge();
  const title = h("h1", {}, "Job");
  const actions = h("div", { class: "actions" });
  const bar = h("progress", { max: 1, "aria-label": "Progress" });
  const far = h("p", { class: "far" });
  const failure = h("div", {});
  const errors = h("div", { role: "alert" });
  const facts = h("dl", { class: "facts" });
  const moving = preview(id, signal);
  const picture = h("div", {});
  const charts = h("div", { class: "plots" });
  const noCharts = h("p", { class: "note" }, "The plots come with the first frames.");
  const drawn = plots(charts);
  const files = h("div", {});
  const exported = exports(id);
  const links = h("div", {});
  const log = h("pre", { class: "log", tabindex: 0, role: "region", "aria-label": "Log of the job" });
  const notices = h("div", {});
  const view = h("a", { class: "button", href: `#/jobs/${id}/view` }, "Open the 3D view");
  const media = card("media", "Picture", h("div", { class: "media-row" }, moving.element, picture), view);
  const charted = card("charts", "Diagnostics", noCharts, charts);
  let [last, scene, drawnFrames, timer, drawing] = [null, null, -1, 0, false];

  main.append(
    h(
      "div",
      { class: "title" },
      h("div", {}, h("p", { class: "crumbs" }, h("a", { href: "#/" }, "Jobs")), title),
      state.element,
      actions,
    ),
    errors,
    h("div", { class: "progressing" }, bar, far),
    failure,
    h("div", { class: "columns" }, media, card("details", "Details", facts, notices)),
    charted,
    h(
      "div",
      { class: "columns" },
      card("downloads", "Downloads", files, exported.element),
      card("opens", "Open in", links),
    ),
    card("logs", "Log", log),
  );

  function update(now) {
    const before = last;
    last = now;
    if (before && before.status !== now.status) announce(`${now.name}: ${now.status}`);
    text(title, now.name);
    document.title = `${now.name}, ${now.status} · Gridfall`;
    state.update(now);
    progress(now);
    if (
      !before ||
      before.status !== now.status ||
      before.attempt !== now.attempt ||
      !before.progress.frames_written !== !now.progress.frames_written
    ) {
      buttons(now);
      fail(now);
      files.replaceChildren(...downloads(now, scene));
      links.replaceChildren(...viewers(now));
      pictureOf(now);
    }
    view.hidden = !now.progress.frames_written;
    // A job that left no frame has nothing to show.
    media.hidden = charted.hidden = hasEnded(now) && !now.progress.frames_written;
    details(now);
    if (scene) exported.update(now.progress.frames_written, scene.dimension === 2);
    if (scene && now.progress.frames_written)
      moving.update(scene, now.particles, now.progress.frames_written, hasEnded(now));
    later(hasEnded(now) ? 0 : BETWEEN);
  }

  function progress(now) {
    const {
      sim_time: at,
      end_time: end,
      frames_written: done,
      frames,
      fraction,
      eta_s: eta,
      particle_steps_per_s: speed,
    } = now.progress;
    bar.value = hasEnded(now) && now.status === "succeeded" ? 1 : fraction;
    const parts = {
      queued: [
        now.queue_position ? `${ordinal(now.queue_position)} in the queue` : "waits in the queue",
        now.estimate_s !== null && `about ${duration(now.estimate_s)} on two cores`,
      ],
      running: [
        percent(fraction),
        eta !== null && `${duration(eta)} left`,
        speed !== null && `${many(speed)} particle steps a second`,
      ],
    }[now.status] ?? [`ended ${when(now.finished_at)}`, `ran ${duration(now.run_s)}`];
    const common =
      now.status === "queued" ? [] : [`${number(at)} of ${number(end)} s`, `${count(done)} of ${count(frames)} frames`];
    text(far, [...parts, ...common].filter(Boolean).join(" · "));
  }

  function buttons(now) {
    const after = (what) => async () => {
      const answers = await what([last]);
      if (what === rerun && answers?.length) location.hash = `#/jobs/${answers[0].id}`;
      if (what === remove && answers?.length) location.hash = "#/";
    };
    const button = (name, what, kind) => h("button", { type: "button", class: kind, onclick: after(what) }, name);
    actions.replaceChildren(
      ...(hasEnded(now) ? [button("Run again", rerun, "primary")] : [button("Cancel", cancel, "danger")]),
      h("a", { class: "button", href: `#/new?job=${id}` }, "Edit and run"),
      ...(hasEnded(now) ? [button("Delete", remove, "danger")] : []),
    );
  }

  function fail(now) {
    failure.replaceChildren();
    if (!now.failure) return;
    const { code, message, remedy } = now.failure;
    failure.append(
      h(
        "div",
        { class: "problem" },
        h("p", { class: "problem-title" }, h("strong", {}, "The job failed"), h("code", {}, code)),
        h("p", { class: "message" }, message),
        remedy && h("p", { class: "remedy" }, h("strong", {}, "Remedy: "), prose(remedy)),
        h("p", {}, h("a", { href: `/docs/errors#failure-${code}` }, "More on this code")),
      ),
    );
  }

  function pictureOf(now) {
    if (!hasEnded(now) || !now.progress.frames_written || picture.childElementCount) return;
    picture.append(drawnFrame(now, exported.choose, signal));
  }

  const swept = (values) =>
    Object.entries(values)
      .map(([path, one]) => `\`${path}\` ${shown(one)}`)
      .join(", ");

  function details(now) {
    const rows = [
      ["Device", now.backend ? now.backend.device : "not chosen yet", now.backend?.reason],
      ...(now.cluster_job ? [["Cluster job", h("code", {}, now.cluster_job)]] : []),
      ["Integrator", now.integrator, now.integrator_reason],
      ["Particles", count(now.particles)],
      ["Steps", count(now.progress.step)],
      ["Submitted", when(now.created_at)],
      ["Started", when(now.started_at), now.attempt > 1 ? `attempt ${now.attempt}` : null],
      ["Estimate", now.estimate_s === null ? "–" : `${duration(now.estimate_s)} on two cores`],
      ...(now.sweep
        ? [["Sweep", h("a", { href: `#/sweeps/${now.sweep}` }, "its sweep"), swept(now.sweep_values)]]
        : []),
      ["Tags", now.tags.length ? now.tags.join(", ") : "none"],
      ["Priority", String(now.priority), now.deadline && `must start before ${when(now.deadline)}`],
      ["Id", h("code", {}, now.id)],
    ];
    const told = JSON.stringify(rows.map(([name, value, note]) => [name, value.textContent ?? value, note]));
    if (facts.dataset.told === told) return;
    facts.dataset.told = told;
    facts.replaceChildren(
      ...rows.flatMap(([name, value, note]) => [
        h("dt", {}, name),
        h("dd", {}, value, note && h("span", { class: "note" }, prose(note))),
      ]),
    );
    const list = now.notices;
    notices.replaceChildren(
      ...(list.length
        ? [
            h("h3", {}, "Notices"),
            h(
              "ul",
              { class: "faults notices" },
              list.map((one) => fault(one)),
            ),
          ]
        : []),
    );
  }

  /** Draws the diagnostics when there are new ones, not more often than now and then. */
  function later(wait) {
    if (timer || !last.progress.frames_written) return;
    if (last.progress.frames_written === drawnFrames && !wait && last.status === drawn.status) return;
    timer = setTimeout(
      async () => {
        timer = 0;
        await diagnose();
      },
      drawnFrames < 0 ? 0 : wait,
    );
  }

  async function diagnose() {
    if (drawing || signal.aborted || last.progress.frames_written === drawnFrames) return;
    drawing = true;
    const [frames, implicit] = [last.progress.frames_written, last.integrator === "implicit"];
    try {
      const [{ rows }, solver] = await Promise.all([
        get(`/v1/jobs/${id}/diagnostics`, signal),
        implicit ? get(`/v1/jobs/${id}/solver`, signal) : { rows: [] },
      ]);
      drawnFrames = frames;
      noCharts.hidden = rows.length > 0;
      drawn.update(rows, solver.rows);
    } catch (error) {
      // The next change of the job is another chance.
      if (!signal.aborted && error.problem && error.problem.status !== 404) errors.replaceChildren(failed(error));
    } finally {
      drawing = false;
    }
    if (last.progress.frames_written !== drawnFrames) later(BETWEEN);
  }

  const heard = {
    status: update,
    progress: update,
    log: (line) => {
      const end = log.scrollHeight - log.scrollTop - log.clientHeight < 8;
      log.append(h("span", {}, `${line}\n`));
      while (log.childElementCount > MOST_LINES) log.firstElementChild.remove();
      if (end) log.scrollTop = log.scrollHeight;
    },
    deleted: () => {
      announce("The job was deleted.");
      errors.replaceChildren(
        h("div", { class: "problem" }, h("p", {}, "The job was deleted. ", h("a", { href: "#/" }, "All jobs"))),
      );
    },
  };

  async function begin() {
    update(await get(`/v1/jobs/${id}`, signal));
    const events = follow(`/v1/jobs/${id}/events`, (event, data) => heard[event]?.(data), signal);
    scene = await get(`/v1/jobs/${id}/scene`, signal);
    files.replaceChildren(...downloads(last, scene));
    exported.update(last.progress.frames_written, scene.dimension === 2);
    if (last.progress.frames_written)
      moving.update(scene, last.particles, last.progress.frames_written, hasEnded(last));
    await events;
  }

  begin().catch((error) => {
    if (signal.aborted) return;
    text(title, error.problem?.code === "job_not_found" ? "There is no such job" : "This job cannot be shown");
    main.replaceChildren(
      h("div", { class: "title" }, title),
      failed(error),
      h("p", {}, h("a", { href: "#/" }, "All jobs")),
    );
  });
}
