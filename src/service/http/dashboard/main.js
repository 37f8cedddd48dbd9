// The page around the views: which one is shown, the colours, and whether the server can be reached.

import { connection, door } from "./api.js";
import { h } from "./dom.js";
import { jobs } from "./jobs.js";
import { signIn, signedIn } from "./signin.js";
import { submit } from "./submit.js";
import { sweep } from "./sweep.js";
import { sweeps } from "./sweeps.js";
import { job } from "./job.js";
import { viewer } from "./viewer.js";

const ROUTES = [
  [/^#\/(?:\?(.*))?$/, "jobs", jobs],
  [/^#\/sweeps$/, "sweeps", sweeps],
  [/^#\/sweeps\/([0-9a-f-]{36})$/, "sweep", sweep],
  [/^#\/new(?:\?(.*))?$/, "new", submit],
  [/^#\/jobs\/([0-9a-f-]{36})$/, "job", job],
  [/^#\/jobs\/([0-9a-f-]{36})\/view$/, "view", viewer],
];

const main = document.getElementById("main");
let leave = new AbortController();

function show(first) {
  const hash = location.hash || "#/";
  const found = ROUTES.map(([pattern, name, view]) => ({ match: pattern.exec(hash), name, view })).find((r) => r.match);
  leave.abort();
  leave = new AbortController();
  main.replaceChildren();
  document.querySelectorAll("nav [data-view]").forEach((link) => {
    if (link.dataset.view === found?.name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  });
  if (!found) {
    main.append(h("h1", {}, "There is no such page"), h("p", {}, h("a", { href: "#/" }, "All jobs")));
    return;
  }
  main.dataset.view = found.name;
  found.view(main, found.match[1] ?? "", leave.signal);
  document.title = `${main.querySelector("h1")?.textContent ?? "Gridfall"} · Gridfall`;
  // Readers begin at the new content; the first one is read anyway.
  if (!first) {
    main.focus({ preventScroll: true });
    scrollTo(0, 0);
  }
}

addEventListener("hashchange", () => main.dataset.view === "signin" || show(false));
document.getElementById("skip").addEventListener("click", (event) => {
  event.preventDefault();
  main.focus();
});

const theme = document.getElementById("theme");
theme.value = document.documentElement.dataset.theme ?? "auto";
theme.addEventListener("change", () => {
  if (theme.value === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme.value;
  try {
    localStorage.setItem("gridfall-theme", theme.value);
  } catch {
    // It lasts as long as the page.
  }
  dispatchEvent(new Event("themechange"));
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dispatchEvent(new Event("themechange")));

const banner = document.getElementById("connection");
let ticking = 0;
connection.changed = (seconds) => {
  clearInterval(ticking);
  if (seconds === null) {
    banner.hidden = true;
    return;
  }
  const wait = h("span", {}, `in ${seconds} s`);
  const now = h("button", { type: "button", onclick: () => connection.retry() }, "Try now");
  // A countdown that was read aloud every second would say nothing else.
  wait.setAttribute("aria-hidden", "true");
  banner.replaceChildren("The connection to the server is lost. It is tried again ", wait, ". ", now);
  banner.hidden = false;
  let left = seconds;
  ticking = setInterval(() => {
    left -= 1;
    wait.textContent = left > 0 ? `in ${left} s` : "now";
    if (left <= 0) clearInterval(ticking);
  }, 1000);
};

door.closed = () => {
  if (main.dataset.view === "signin") return;
  leave.abort();
  leave = new AbortController();
  signIn(main, () => location.reload());
};

if (await signedIn()) show(true);
else door.closed();
