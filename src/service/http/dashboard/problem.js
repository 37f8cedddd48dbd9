// Errors of the API: what went wrong, where, and what to do about it.

import { ApiError, Unreachable } from "./api.js";
import { h, prose } from "./dom.js";

/** One fault of a scene. `reach` is called to go to its place, if there is a way. */
export function fault({ pointer, reason, remedy, code }, reach) {
  const place = pointer.replace(/^\/scene/, "") || "/";
  const where = reach
    ? h("button", { type: "button", class: "place", onclick: () => reach(pointer) }, place)
    : h("code", { class: "place" }, place);
  return h(
    "li",
    { class: "fault", "data-code": code },
    where,
    h("p", {}, prose(reason)),
    remedy && h("p", { class: "remedy" }, h("strong", {}, "Remedy: "), prose(remedy)),
  );
}

/** A problem (RFC 9457) with all its faults. */
export function problem(body, reach) {
  const faults = body.faults ?? [];
  const more = body.type && h("p", {}, h("a", { href: body.type }, "What this means and what to do"));
  return h(
    "div",
    { class: "problem" },
    h("p", { class: "problem-title" }, h("strong", {}, body.title), body.code && h("code", {}, body.code)),
    body.detail && h("p", {}, prose(body.detail)),
    faults.length > 0 &&
      h(
        "ul",
        { class: "faults" },
        faults.map((one) => fault(one, reach)),
      ),
    faults.length === 0 && more,
  );
}

/** Whatever was thrown. */
export function failed(error) {
  if (error instanceof ApiError) return problem(error.problem);
  const detail = error instanceof Unreachable ? "It is tried again by itself." : "Reload the page to try again.";
  return problem({ title: error.message, detail });
}
