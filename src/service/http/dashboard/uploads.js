// Files that scenes name: uploaded by dropping them or by a button, and put into the scene.

import { ApiError, get } from "./api.js";
import { announce, h, text, toast } from "./dom.js";
import { bytes, percent } from "./format.js";
import { places } from "./places.js";
import { failed } from "./problem.js";

const KINDS = ".stl,.obj,.ply,.gltf,.glb,.npz";
const MOST_SHOWN = 50;

/** Sends a file, and tells how far it is. Resolves to the asset. */
function send(file, progress, signal) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", "/v1/assets");
    request.setRequestHeader("content-type", "application/octet-stream");
    request.responseType = "text";
    request.upload.onprogress = (event) => event.lengthComputable && progress(event.loaded / event.total);
    request.upload.onload = () => progress(1);
    request.onload = () => {
      let answer = null;
      try {
        answer = JSON.parse(request.responseText);
      } catch {
        // What is no JSON is told by its status.
      }
      if (request.status < 300 && answer) resolve(answer);
      else reject(new ApiError(answer ?? { title: `The server answered ${request.status}`, detail: "" }));
    };
    request.onerror = () =>
      reject(new Error("The connection ended before the file was sent. Perhaps the server takes no file so large."));
    signal.addEventListener("abort", () => request.abort());
    request.onabort = () => reject(new DOMException("It was stopped.", "AbortError"));
    request.send(file);
  });
}

/** The part of the form. `editor` has the scene; `changed` is called when something was put into it, and `open` with
 * the text of a scene that was dropped. */
export function uploads(editor, changed, open, signal) {
  const file = h("input", { type: "file", id: "asset", accept: KINDS, multiple: true, class: "hidden-file" });
  const list = h("ul", { class: "uploads" });
  const earlier = h("ul", { class: "uploads" });
  const before = h("details", { ontoggle: recall }, h("summary", {}, "Earlier uploads"), earlier);
  const zone = h(
    "div",
    { class: "dropzone" },
    h("p", {}, "Drop meshes (STL, OBJ, PLY, glTF in one file) or points and states (PLY, npz) here."),
    h("label", { class: "button", for: "asset" }, "Choose files"),
    file,
  );
  const element = h(
    "section",
    { class: "card files-in", "aria-labelledby": "uploads-title" },
    h("h2", { id: "uploads-title" }, "Files of the scene"),
    zone,
    list,
    before,
  );
  file.addEventListener("change", () => {
    [...file.files].forEach(upload);
    file.value = "";
  });

  /** Takes what is dropped on an element. */
  function watch(target) {
    const carries = (event) => event.dataTransfer?.types.includes("Files");
    let inside = 0;
    const mark = () => zone.classList.toggle("over", inside > 0);
    const on = (name, what) =>
      target.addEventListener(name, (event) => {
        if (!carries(event)) return;
        event.preventDefault();
        what(event);
        mark();
      });
    on("dragenter", () => (inside += 1));
    on("dragleave", () => (inside -= 1));
    on("dragover", (event) => (event.dataTransfer.dropEffect = "copy"));
    on("drop", (event) => {
      inside = 0;
      [...event.dataTransfer.files].forEach(upload);
    });
  }

  async function upload(given) {
    if (/\.json$/i.test(given.name)) return open(await given.text());
    const bar = h("progress", { max: 1, value: 0, "aria-label": `Upload of ${given.name}` });
    const said = h("span", { class: "note" }, "waits …");
    const stopping = new AbortController();
    signal.addEventListener("abort", () => stopping.abort());
    const stop = h("button", { type: "button", class: "quiet", onclick: () => stopping.abort() }, "Stop");
    const item = h(
      "li",
      {},
      h("p", {}, h("strong", {}, given.name), " ", said),
      bar,
      h("div", { class: "actions" }, stop),
    );
    list.prepend(item);
    const progress = (share) => {
      bar.value = share;
      text(said, share < 1 ? `${percent(share)} of ${bytes(given.size)}` : `${bytes(given.size)}, being looked at …`);
    };
    try {
      const asset = await send(given, progress, stopping.signal);
      item.replaceChildren(...usable(asset, given.name));
      announce(`${given.name} was uploaded.`);
    } catch (error) {
      if (signal.aborted) return;
      const again = h("button", { type: "button", onclick: () => (item.remove(), upload(given)) }, "Try again");
      const away = h("button", { type: "button", class: "quiet", onclick: () => item.remove() }, "Take away");
      const why = error.name === "AbortError" ? h("p", {}, "The upload was stopped.") : failed(error);
      const name = h("p", {}, h("strong", {}, given.name), h("span", { class: "note" }, ` ${bytes(given.size)}`));
      item.replaceChildren(name, h("div", { role: "alert" }, why), h("div", { class: "actions" }, again, away));
    }
  }

  /** An asset, and what can be done with it. */
  function usable(asset, name) {
    const choice = h("select", { "aria-label": `Where to put ${name}` });
    let [found, cursor] = [[], { start: 0, end: 0 }];
    const look = () => {
      cursor = { start: editor.selectionStart, end: editor.selectionEnd };
      found = places(editor.value, asset, cursor);
      const labels = found.map(({ label }) => label);
      if (labels.join() === [...choice.options].map((one) => one.textContent).join()) return;
      choice.replaceChildren(...labels.map((label) => h("option", { value: label }, label)));
    };
    look();
    choice.addEventListener("focus", look);
    choice.addEventListener("pointerdown", look);
    const put = () => {
      const wanted = choice.value;
      look();
      const { edit, label } = found.find((one) => one.label === wanted) ?? found[0];
      editor.focus();
      editor.setSelectionRange(edit.start, edit.end);
      // So that it can be undone; where that is not known, it is only put there.
      if (!document.execCommand("insertText", false, edit.text)) editor.setRangeText(edit.text);
      editor.setSelectionRange(edit.start, edit.start + edit.text.length);
      announce(`${name} was put into the scene ${label}.`);
      changed();
    };
    const copy = async () => {
      try {
        await navigator.clipboard.writeText(asset.id);
        toast("The id was copied.");
      } catch {
        toast("This browser lets no page copy here; select the id and copy it yourself.", "bad");
      }
    };
    const about = h("span", { class: "note" }, ` ${asset.kind}, ${bytes(asset.bytes)}`);
    return [
      h("p", {}, h("strong", {}, name), about),
      h("code", { class: "address" }, asset.id),
      h(
        "div",
        { class: "actions" },
        choice,
        h("button", { type: "button", onclick: put }, "Put into the scene"),
        h("button", { type: "button", class: "quiet", onclick: copy }, "Copy the id"),
      ),
    ];
  }

  async function recall() {
    if (!before.open || earlier.childElementCount) return;
    try {
      const { assets } = await get("/v1/assets", signal);
      const items = assets.slice(0, MOST_SHOWN).map((asset) => h("li", {}, usable(asset, `${asset.id.slice(7, 19)}…`)));
      const rest = assets.length - items.length;
      if (rest > 0) items.push(h("li", { class: "note" }, `and ${rest} more; GET /v1/assets has all`));
      earlier.replaceChildren(...items);
      if (!assets.length) earlier.replaceChildren(h("li", { class: "note" }, "Nothing was uploaded yet."));
    } catch (error) {
      if (!signal.aborted) earlier.replaceChildren(h("li", {}, failed(error)));
    }
  }
  return { element, watch };
}
