// What a job leaves: files to download, and viewers that open its recording.

import { hasEnded } from "./actions.js";
import { h } from "./dom.js";

/** Web pages that show a recording from its address. */
const VIEWERS = [
  [
    "Lichtblick",
    (url) => `https://lichtblick-suite.github.io/lichtblick/?ds=remote-file&ds.url=${encodeURIComponent(url)}`,
  ],
  ["Foxglove", (url) => `https://app.foxglove.dev/~/view?ds=remote-file&ds.url=${encodeURIComponent(url)}`],
  ["Rerun", (url) => `https://rerun.io/viewer?url=${encodeURIComponent(url)}`],
];

/** Those of them that show a run as it goes, from the address of its messages. */
const LIVE = [
  [
    "Lichtblick",
    (url) => `https://lichtblick-suite.github.io/lichtblick/?ds=foxglove-websocket&ds.url=${encodeURIComponent(url)}`,
  ],
  ["Foxglove", (url) => `https://app.foxglove.dev/~/view?ds=foxglove-websocket&ds.url=${encodeURIComponent(url)}`],
];

const buttons = (list, url) =>
  h(
    "ul",
    { class: "viewers" },
    list.map(([name, link]) =>
      h("li", {}, h("a", { class: "button", href: link(url), target: "_blank", rel: "noreferrer" }, name)),
    ),
  );

const file = (href, name, about) =>
  h("li", {}, h("a", { href, download: true }, name), h("span", { class: "note" }, about));

/** Downloads of a job as it stands; `scene` is known a little later. */
export function downloads(job, scene) {
  const of = (name) => `/v1/jobs/${job.id}/${name}`;
  if (job.status === "queued") return [h("p", { class: "note" }, "There is nothing to download before the job runs.")];
  const some = job.progress.frames_written > 0;
  const state = job.status === "succeeded" && scene?.output?.state;
  const from = h("a", { href: `#/new?job=${job.id}&start=${job.id}` }, "start a job from it");
  const recording = hasEnded(job)
    ? file(of("recording.mcap"), "recording.mcap", "all frames")
    : file(of("recording-so-far.mcap"), "recording-so-far.mcap", "the frames so far");
  return [
    h(
      "ul",
      { class: "files" },
      some && recording,
      some && file(of("diagnostics.csv"), "diagnostics.csv", "energies, momenta, steps"),
      some && file(of("diagnostics"), "diagnostics.json", "the same"),
      job.integrator === "implicit" && some && file(of("solver.csv"), "solver.csv", "a row for each implicit step"),
      state && file(of("state.npz"), "state.npz", ["the last state; ", from]),
      hasEnded(job) && some && file(of("thumbnail.png"), "thumbnail.png", "the last frame"),
      file(of("scene"), "scene.json", "as it was run"),
      file(of("log"), "log.txt", "what happened"),
    ),
  ];
}

/** Links to viewers, and what they need. */
export function viewers(job) {
  if (hasEnded(job) && !job.progress.frames_written) {
    return [h("p", { class: "note" }, "The job ended before its first frame, so there is no recording.")];
  }
  if (job.status === "queued") return [h("p", { class: "note" }, "Viewers show the run once it has begun.")];
  if (!hasEnded(job)) {
    const live = new URL(`/v1/jobs/${job.id}/live`, location.href.replace(/^http/, "ws")).href;
    return [
      h("p", { class: "note" }, "The run as it goes; the recording is there once the job has ended."),
      buttons(LIVE, live),
      h(
        "p",
        { class: "note" },
        "They are pages of other sites, in a new tab. This server lets them watch if it was started with ",
        h("code", {}, "--cors-origin https://app.foxglove.dev"),
        " or the origin of the other; the programs themselves need nothing.",
      ),
      h("p", { class: "note" }, "Address of the messages: ", h("code", { class: "address" }, live)),
    ];
  }
  const url = new URL(`/v1/jobs/${job.id}/recording.mcap`, location.href).href;
  const local = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
  const reach =
    location.protocol === "https:" || local
      ? "Your browser fetches the recording from this server; it is sent nowhere else."
      : "Browsers let these pages (https) read from other machines by https only: put this server behind https, or " +
        "download the file and open it there.";
  return [
    buttons(VIEWERS, url),
    h(
      "p",
      { class: "note" },
      "They are pages of other sites, in a new tab. ",
      reach,
      " Any page may read recordings here (CORS).",
    ),
    h("p", { class: "note" }, "Where Rerun opens no MCAP by its address, download the file and drop it there."),
    h("p", { class: "note" }, "Address of the recording: ", h("code", { class: "address" }, url)),
  ];
}
