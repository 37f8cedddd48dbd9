// A new job: a scene of the library, pasted or from a file, judged while it is written.

import { sceneOf } from "./actions.js";
import { ApiError, connection, freshKey, get, json, request, Unreachable } from "./api.js";
import { announce, h, text, toast } from "./dom.js";
import { estimate } from "./estimate.js";
import { count } from "./format.js";
import { errorPlace, locate } from "./pointer.js";
import { failed, problem } from "./problem.js";

const PATIENCE = 350;
/** Scenes that run in moments, and show what to expect. */
const FIRST = ["quickstart", "bouncing-ball", "elastic-gate-2d", "dam-break"];

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

  const field = (id, label, properties, help) => {
    const input = h("input", { id, autocomplete: "off", oninput: () => later(), ...properties });
    return {
      input,
      element: h("div", { class: "field" }, h("label", { for: id }, label), input, help && h("small", {}, help)),
    };
  };
  const name = field("name", "Name", { maxlength: 200, placeholder: "as in the scene" });
  const tags = field("tags", "Tags", { placeholder: "separated by commas" });
  const priority = field(
    "priority",
    "Priority",
    { type: "number", min: -1000, max: 1000, value: "0" },
    "Higher runs first.",
  );
  const most = field("max-cost", "Most cost (s)", { type: "number", min: 0, step: "any", placeholder: "any" });
  const reuse = h("input", { type: "checkbox", id: "reuse" });

  const found = h("ul", { class: "library" });
  const find = h("input", {
    type: "search",
    id: "find",
    placeholder: "Find a scene",
    autocomplete: "off",
    oninput: list,
  });
  const small = h("input", { type: "checkbox", id: "small", onchange: list });
  let library = [];

  const file = h("input", { type: "file", id: "file", accept: ".json,application/json", class: "hidden-file" });
  file.addEventListener("change", async () => {
    if (file.files[0]) take(await file.files[0].text());
    file.value = "";
  });

  main.append(
    h("div", { class: "title" }, h("h1", {}, "New job")),
    h(
      "form",
      { class: "new", onsubmit: send },
      h(
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
      ),
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
      h(
        "section",
        { class: "card judge", "aria-labelledby": "judge-title" },
        h("h2", { id: "judge-title" }, "Check and cost"),
        status,
        errors,
        button,
        verdict,
      ),
      h(
        "section",
        { class: "card options", "aria-labelledby": "options-title" },
        h("h2", { id: "options-title" }, "Options"),
        h("div", { class: "fields" }, name.element, tags.element, priority.element, most.element),
        h("label", { class: "check" }, reuse, "Take the result of a finished job of the same scene, if there is one"),
      ),
    ),
  );
  judge();

  get("/v1/library", signal).then(({ scenes }) => {
    const rank = ({ name }) => (FIRST.includes(name) ? FIRST.indexOf(name) : FIRST.length);
    library = scenes.sort((a, b) => rank(a) - rank(b));
    list();
    if (wanted.has("scene")) choose(wanted.get("scene"));
  }, oops(found));
  if (wanted.has("job")) {
    sceneOf(wanted.get("job"), signal).then(take, oops(errors));
  }

  function oops(place) {
    return (error) => signal.aborted || place.replaceChildren(failed(error));
  }

  function list() {
    const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = ({ name, description }) =>
      words.every((word) => `${name} ${description}`.toLowerCase().includes(word)) &&
      (!small.checked || name.endsWith("-small") || !library.some((other) => other.name === `${name}-small`));
    const shown = library.filter(fits);
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
      oops(errors)(error);
    }
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

  /** The body of the request. The scene goes as it was written, so that the server judges just that. */
  function body() {
    const words = tags.input.value
      .split(",")
      .map((tag) => tag.trim())
      .filter(Boolean);
    const more = {
      ...(name.input.value.trim() && { name: name.input.value }),
      ...(words.length && { tags: words }),
      ...(priority.input.value && { priority: Number(priority.input.value) }),
      ...(most.input.value && { max_cost: Number(most.input.value) }),
      ...(reuse.checked && { reuse: true }),
    };
    return `{"scene":${editor.value},${JSON.stringify(more).slice(1)}`.replace(/,}$/, "}");
  }

  async function judge() {
    judging.abort();
    judging = new AbortController();
    const own = judging;
    key = freshKey();
    button.disabled = true;
    if (!editor.value.trim()) {
      text(status, "Nothing to check yet.");
      verdict.replaceChildren(
        h("p", { class: "note" }, "The cost of the run will be here, or all faults of the scene."),
      );
      return;
    }
    try {
      JSON.parse(editor.value);
    } catch (error) {
      const place = errorPlace(editor.value, error.message);
      text(status, "This is not JSON.");
      const go = h(
        "button",
        { type: "button", class: "place", onclick: () => reach(place) },
        `line ${place.line}, column ${place.column}`,
      );
      verdict.replaceChildren(h("div", { class: "problem" }, h("p", {}, go, " ", error.message)));
      return;
    }
    text(status, "Checking …");
    try {
      const answer = await json("POST", "/v1/scenes:validate", { body: body(), signal: own.signal });
      text(status, `Valid: ${count(answer.estimate.particles)} particles.`);
      verdict.replaceChildren(...[estimate(answer, reach)].flat(3).filter(Boolean));
      button.disabled = false;
    } catch (error) {
      if (own.signal.aborted || signal.aborted) return;
      if (error instanceof Unreachable) {
        text(status, "The server does not answer; it is tried again.");
        connection.lost(3);
        timer = setTimeout(judge, 3000);
        return;
      }
      const faults = error.problem?.faults?.length ?? 0;
      text(
        status,
        faults ? `${faults} ${faults === 1 ? "fault" : "faults"} in the scene.` : "This cannot be submitted.",
      );
      verdict.replaceChildren(error instanceof ApiError ? problem(error.problem, reach) : failed(error));
    }
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
      // The key makes a second try of the same request harmless.
      const job = await json("POST", "/v1/jobs", { body: body(), headers: { "idempotency-key": key }, signal });
      toast(`${job.name} was submitted.`);
      location.hash = `#/jobs/${job.id}`;
    } catch (error) {
      if (signal.aborted) return;
      button.disabled = false;
      errors.replaceChildren(failed(error));
    }
  }
}
