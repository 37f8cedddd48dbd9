// Signing in, where the server asks for a key. The browser keeps the key in a cookie that no script can read: plain
// links to files and pictures then have it, too.

import { get, json, request } from "./api.js";
import { h, prose } from "./dom.js";
import { failed } from "./problem.js";

const place = document.getElementById("session");

/** Whether the browser may go on; shows whose key it has. */
export async function signedIn() {
  let session;
  try {
    session = await get("/v1/session");
  } catch {
    // The views say that the server cannot be reached, and go on when it can.
    return true;
  }
  if (session.key) {
    const out = h("button", { type: "button", onclick: signOut }, "Sign out");
    place.replaceChildren(h("span", {}, session.key.name), out);
  }
  place.hidden = !session.key;
  return Boolean(session.key) || !session.keys_required;
}

async function signOut() {
  await request("DELETE", "/v1/session").catch(() => {});
  location.reload();
}

/** Asks for a key. */
export function signIn(main, done) {
  const key = h("input", { type: "password", id: "key", autocomplete: "current-password", spellcheck: "false" });
  const said = h("div", { role: "alert" });
  const enter = h("button", { type: "submit", class: "primary" }, "Sign in");
  const submit = async (event) => {
    event.preventDefault();
    enter.disabled = true;
    said.replaceChildren();
    try {
      await json("PUT", "/v1/session", { body: { key: key.value.trim() } });
      done();
    } catch (error) {
      said.replaceChildren(failed(error));
      enter.disabled = false;
      key.focus();
    }
  };
  main.replaceChildren(
    h("h1", {}, "Sign in"),
    h(
      "form",
      { class: "signin", onsubmit: submit },
      h("p", {}, prose("This server asks for a key. Whoever runs it makes them: `gridfall keys create NAME`")),
      h("label", { class: "field", for: "key" }, h("span", {}, "Key"), key),
      enter,
      said,
    ),
  );
  main.dataset.view = "signin";
  document.title = "Sign in · Gridfall";
  key.focus();
}
