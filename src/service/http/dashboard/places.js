// Where in a scene an uploaded file can go, and the edit that puts it there.

import { locate } from "./pointer.js";

const MESHES = ["stl", "obj", "ply", "gltf"];
const POINTS = ["ply", "npz"];

/** Places for an asset in the text of a scene: a label, and the edit: what to replace with what. The cursor comes
 * first; it is all there is in what is no scene yet. */
export function places(text, { id, kind }, cursor) {
  const asset = `{ "asset": "${id}" }`;
  const mesh = `{ "mesh": ${asset} }`;
  const here = { label: "at the cursor", edit: { ...cursor, text: MESHES.includes(kind) ? mesh : asset } };
  let scene;
  try {
    scene = JSON.parse(text);
  } catch {
    return [here];
  }
  if (scene === null || typeof scene !== "object") return [here];
  const found = [];
  const member = (pointer, name, value) => ({ ...span(text, pointer), text: `"${name}": ${value}` });
  const each = (list, what) => {
    if (!Array.isArray(scene[list])) return;
    scene[list].forEach((one, n) => {
      const shape = one?.shape !== undefined ? "shape" : one?.points !== undefined ? "points" : null;
      if (!shape) return;
      const at = `/${list}/${n}/${shape}`;
      const name = one.name ?? n;
      if (MESHES.includes(kind))
        found.push({ label: `as the shape of ${what} ${name}`, edit: member(at, "shape", mesh) });
      if (what === "body" && POINTS.includes(kind))
        found.push({ label: `as the points of body ${name}`, edit: member(at, "points", asset) });
    });
  };
  each("bodies", "body");
  each("colliders", "collider");
  if (kind === "npz") {
    const { start } = span(text, "/time");
    const before = { start, end: start, text: `"start": ${asset},\n  ` };
    if (scene.start !== undefined)
      found.push({ label: "as the state to start with", edit: member("/start", "start", asset) });
    else if (scene.time !== undefined) found.push({ label: "as the state to start with", edit: before });
  }
  return [...found, here];
}

const span = (text, pointer) => {
  const { start, end } = locate(text, pointer);
  return { start, end };
};
