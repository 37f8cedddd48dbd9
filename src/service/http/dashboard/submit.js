// A new job or sweep: a scene of the library, pasted or from a file, judged while it is written.

import { sceneOf } from "./actions.js";
import { ApiError, connection, freshKey, json, Unreachable } from "./api.js";
import { announce, h, text, toast } from "./dom.js";
import { estimate, sweepCost } from "./estimate.js";
import { count, duration } from "./format.js";
import { library } from "./library.js";
import { options } from "./options.js";
import { errorPlace, locate } from "./pointer.js";
import { failed, problem } from "./problem.js";
import { sweepForm } from "./sweepform.js";
import { uploads } from "./uploads.js";

const PATIENCE = 350;

export function submit(main, query, signal) {
  const wanted = new URLSearchParams(query);
  let judging = new AbortController();
  let timer = 0;
  let key = freshKey();

  const editor = h("textarea", {
    id: "scene",
    spellcheck: "false",
    autocapitalize: "off",
    rows: 24,
    wrap: "off",
    "aria-describedby": "scene-help",
    oninput: () => later(),
  });
  const verdict = h("div", { class: "verdict", id: "verdict" });
  const status = h("p", { class: "judged", role: "status" });
  const button = h("button", { type: "submit", class: "primary", disabled: true }, "Submit the job");
  const errors = h("div", { role: "alert" });
  const wishes = options(later, wanted.get("start"), signal);
  const swept = sweepForm(later);
  const files = uploads(editor, judge, take, signal);

  const file = h("input", { type: "file", id: "file", accept: ".json,application/json", class: "hidden-file" });
  file.addEventListener("change", async () => {
    if (file.files[0]) take(await file.files[0].text());
    file.value = "";
  });

  const form = h(
    "form",
    { class: "new", novalidate: true, onsubmit: send },
    library(take, wanted.get("scene"), signal).element,
    h(
      "div",
      { class: "written" },
      h(
        "section",
        { class: "card editor", "aria-labelledby": "scene-title" },
        h(
          "div",
          { class: "head" },
          h("h2", { id: "scene-title" }, h("label", { for: "scene" }, "Scene")),
          h("label", { class: "button", for: "file" }, "Open a file"),
          file,
        ),
        h("p", { id: "scene-help", class: "note" }, "JSON. Paste one, or choose one from the library and change it."),
        editor,
      ),
      files.element,
      swept.element,
    ),
    h(
      "div",
      { class: "asked" },
      h(
        "section",
        { class: "card judge", "aria-labelledby": "judge-title" },
        h("h2", { id: "judge-title" }, "Check and cost"),
        status,
        errors,
        button,
        verdict,
      ),
      wishes.element,
    ),
  );
  main.append(h("div", { class: "title" }, h("h1", {}, "New job")), form);
  files.watch(form);
  judge();
  if (wanted.has("job")) {
    const oops = (error) => signal.aborted || errors.replaceChildren(failed(error));
    sceneOf(wanted.get("job"), signal).then(take, oops);
  }

  function take(scene) {
    editor.value = scene;
    editor.scrollTop = 0;
    judge();
  }

  function later() {
    clearTimeout(timer);
    button.disabled = true;
    timer = setTimeout(judge, PATIENCE);
  }

  /** What is to be run: the body of the request, and how it is told. Throws with the reason where it is not complete.
   * The scene goes as it was written, so that the server judges just that. */
  function request() {
    const sweep = swept.grid();
    const more = { ...(sweep && { grid: sweep.grid }), ...wishes.members(Boolean(sweep)) };
    const body = `{"scene":${editor.value},${JSON.stringify(more).slice(1)}`.replace(/,}$/, "}");
    return { body, more, sweep };
  }

  async function judge() {
    clearTimeout(timer);
    judging.abort();
    judging = new AbortController();
    const own = judging;
    key = freshKey();
    button.disabled = true;
    if (!editor.value.trim()) {
      text(button, "Submit the job");
      text(status, "Nothing to check yet.");
      verdict.replaceChildren(
        h("p", { class: "note" }, "The cost of the run will be here, or all faults of the scene."),
      );
      return;
    }
    let asked;
    try {
      swept.update(JSON.parse(editor.value));
    } catch (error) {
      return notJson(error);
    }
    try {
      asked = request();
    } catch (error) {
      text(status, "Something is missing.");
      verdict.replaceChildren(h("p", {}, error.message));
      return;
    }
    text(button, asked.sweep ? `Submit ${asked.sweep.jobs} jobs` : "Submit the job");
    text(status, asked.sweep ? `Checking ${asked.sweep.jobs} jobs …` : "Checking …");
    try {
      await (asked.sweep ? judgeSweep : judgeJob)(asked, own.signal);
    } catch (error) {
      if (own.signal.aborted || signal.aborted) return;
      if (error instanceof Unreachable) {
        text(status, "The server does not answer; it is tried again.");
        connection.lost(3);
        timer = setTimeout(judge, 3000);
        return;
      }
      const faults = error.problem?.faults?.length ?? 0;
      const whole = asked.sweep ? "A job of the sweep has" : "";
      const many = `${faults} ${faults === 1 ? "fault" : "faults"}`;
      text(status, faults ? (whole ? `${whole} ${many}.` : `${many} in the scene.`) : "This cannot be submitted.");
      verdict.replaceChildren(error instanceof ApiError ? problem(error.problem, reach) : failed(error));
    }
  }

  function notJson(error) {
    const place = errorPlace(editor.value, error.message);
    text(status, "This is not JSON.");
    const go = h(
      "button",
      { type: "button", class: "place", onclick: () => reach(place) },
      `line ${place.line}, column ${place.column}`,
    );
    verdict.replaceChildren(h("div", { class: "problem" }, h("p", {}, go, " ", error.message)));
  }

  async function judgeJob({ body, more }, own) {
    const answer = await json("POST", "/v1/scenes:validate", { body, signal: own });
    const { estimate: e } = answer;
    const cost = (e[e.integrator] ?? e.explicit).two_cores_s;
    const tooMuch = more.max_cost !== undefined && cost > more.max_cost;
    const said = tooMuch ? `It would cost ${duration(cost)}, more than you allow.` : "";
    text(status, said || `Valid: ${count(e.particles)} particles.`);
    verdict.replaceChildren(...[estimate(answer, reach)].flat(3).filter(Boolean));
    button.disabled = tooMuch;
  }

  async function judgeSweep({ body }, own) {
    const answer = await json("POST", "/v1/sweeps:validate", { body, signal: own });
    text(status, `Valid: ${answer.jobs.length} jobs.`);
    verdict.replaceChildren(...sweepCost(answer));
    button.disabled = false;
  }

  /** Selects the place of a fault in the text. */
  function reach(at) {
    const { start, end, line } = typeof at === "string" ? locate(editor.value, at.replace(/^\/scene/, "")) : at;
    editor.focus();
    editor.setSelectionRange(start, end);
    const height = editor.scrollHeight / editor.value.split("\n").length;
    editor.scrollTop = Math.max(0, (line - 4) * height);
    announce(`line ${line}`);
  }

  async function send(event) {
    event.preventDefault();
    if (button.disabled) return;
    button.disabled = true;
    errors.replaceChildren();
    try {
      const { body, sweep } = request();
      const path = sweep ? "/v1/sweeps" : "/v1/jobs";
      // The key makes a second try of the same request harmless.
      const made = await json("POST", path, { body, headers: { "idempotency-key": key }, signal });
      toast(`${made.name} was submitted.`);
      location.hash = sweep ? `#/sweeps/${made.id}` : `#/jobs/${made.id}`;
    } catch (error) {
      if (signal.aborted) return;
      button.disabled = false;
      errors.replaceChildren(failed(error));
    }
  }
}
