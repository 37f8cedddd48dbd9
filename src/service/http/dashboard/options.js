// What is asked of a job besides its scene.

import { get } from "./api.js";
import { h } from "./dom.js";
import { when } from "./format.js";

/** The options. `changed` is called after each change. `start` is the job to start from, if that is known. */
export function options(changed, start, signal) {
  const field = (id, label, properties, help) => {
    const about = help && { "aria-describedby": `${id}-help` };
    const input = h("input", { id, autocomplete: "off", oninput: changed, ...about, ...properties });
    return {
      input,
      element: h(
        "div",
        { class: "field" },
        h("label", { for: id }, label),
        input,
        help && h("small", { id: `${id}-help` }, help),
      ),
    };
  };
  const name = field("name", "Name", { maxlength: 200, placeholder: "as in the scene" });
  const tags = field("tags", "Tags", { placeholder: "a, b, c" });
  const priority = field(
    "priority",
    "Priority",
    { type: "number", min: -1000, max: 1000, value: "0" },
    "Higher runs first.",
  );
  const most = field("max-cost", "Most cost (s)", { type: "number", min: 0, step: "any", placeholder: "any" });
  const deadline = field(
    "deadline",
    "Must start before",
    { type: "datetime-local", step: 1 },
    "Otherwise it fails and leaves its place to others.",
  );
  const from = field(
    "start-from",
    "Start from the last state of",
    { list: "states", placeholder: "the id of a job", value: start ?? "" },
    "A job that succeeded with output.state, and has as many particles.",
  );
  const states = h("datalist", { id: "states" });
  const reuse = h("input", { type: "checkbox", id: "reuse", onchange: changed });
  const single = h("p", { class: "note", hidden: true }, "A sweep starts from its scene and reuses no results.");
  const more = h(
    "details",
    { class: "more", open: Boolean(start), ontoggle: offer },
    h("summary", {}, "More options"),
    h("div", { class: "fields" }, priority.element, most.element),
    deadline.element,
    from.element,
    states,
    h("label", { class: "check" }, reuse, "Take the result of a finished job of the same scene, if there is one"),
    single,
  );
  const element = h(
    "section",
    { class: "card options", "aria-labelledby": "options-title" },
    h("h2", { id: "options-title" }, "Options"),
    h("div", { class: "fields" }, name.element, tags.element),
    more,
  );
  if (start) offer();

  /** Jobs that may have left a state, the newest first. */
  async function offer() {
    if (!more.open || states.childElementCount) return;
    const { jobs } = await get("/v1/jobs?status=succeeded&limit=50", signal).catch(() => ({ jobs: [] }));
    const label = (job) => `${job.name}, ${job.status} ${when(job.finished_at)}`;
    states.replaceChildren(...jobs.map((job) => h("option", { value: job.id }, label(job))));
  }

  /** Members of the request; `swept` says whether it is one for a sweep. Throws with the reason where one is wrong. */
  function members(swept) {
    from.input.disabled = reuse.disabled = swept;
    single.hidden = !swept;
    const words = tags.input.value
      .split(",")
      .map((tag) => tag.trim())
      .filter(Boolean);
    const before = deadline.input.value && new Date(deadline.input.value);
    if (before && Number.isNaN(before.getTime())) throw new Error("“Must start before” is no date and time.");
    return {
      ...(name.input.value.trim() && { name: name.input.value }),
      ...(words.length && { tags: words }),
      ...(priority.input.value && { priority: Number(priority.input.value) }),
      ...(most.input.value && { max_cost: Number(most.input.value) }),
      ...(before && { deadline: before.toISOString() }),
      ...(!swept && from.input.value.trim() && { start_from: from.input.value.trim() }),
      ...(!swept && reuse.checked && { reuse: true }),
    };
  }
  return { element, members };
}
