// Values of sweeps: lists and ranges as people write them, and the paths in a scene that can have them.

const MOST_PATHS = 2000;

/** The pieces between commas that are in no brackets or quotes. */
function pieces(text) {
  const parts = [""];
  let [depth, quoted] = [0, false];
  for (let at = 0; at < text.length; at += 1) {
    const c = text[at];
    if (c === '"' && text[at - 1] !== "\\") quoted = !quoted;
    if (!quoted && "[{".includes(c)) depth += 1;
    if (!quoted && "]}".includes(c)) depth -= 1;
    if (c === "," && depth === 0 && !quoted) parts.push("");
    else parts[parts.length - 1] += c;
  }
  return parts.map((part) => part.trim()).filter(Boolean);
}

/** JSON, or a word as it is. */
function value(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}

/** `0.1, 0.2, compact` */
export const listed = (text) => pieces(text).map(value);

/** Numbers from one to another: evenly, or by even ratios. Throws with the reason where there are none. */
export function ranged(from, to, count, ratios) {
  if (![from, to].every(Number.isFinite)) throw new Error("Give the first and the last value.");
  if (!Number.isInteger(count) || count < 2) throw new Error("Give a number of values, 2 or more.");
  if (ratios && !(from * to > 0)) throw new Error("Even ratios need two values of one sign that are not 0.");
  const share = (k) => k / (count - 1);
  const at = ratios ? (k) => from * (to / from) ** share(k) : (k) => from + (to - from) * share(k);
  return Array.from({ length: count }, (_, k) => Number(at(k).toPrecision(12)));
}

/** All paths in a scene that lead to a number, a word or a flag, with what is there. */
export function paths(scene) {
  const found = new Map();
  const walk = (node, steps) => {
    if (found.size >= MOST_PATHS) return;
    if (node !== null && typeof node === "object") {
      Object.entries(node).forEach(([name, inner]) => walk(inner, [...steps, name]));
    } else if (node !== null && !["gridfall", "name", "description", "$schema"].includes(steps.join("."))) {
      found.set(path(steps), node);
    }
  };
  walk(scene, []);
  return found;
}

/** As overrides have it: `solver.cfl`, or `/materials/wet.sand/density` where a name has dots. */
function path(steps) {
  if (!steps.some((step) => /[./~]/.test(step))) return steps.join(".");
  return `/${steps.map((step) => step.replaceAll("~", "~0").replaceAll("/", "~1")).join("/")}`;
}

/** A value in a few words. */
export const shown = (one) => (typeof one === "string" ? one : JSON.stringify(one));

/** Paths by the shortest of their ends that tells them apart. */
export function brief(all) {
  const steps = (path) => path.split(/[./]/).filter(Boolean);
  const end = (path, n) => steps(path).slice(-n).join(".");
  const longest = Math.max(1, ...all.map((path) => steps(path).length));
  const apart = (n) => new Set(all.map((path) => end(path, n))).size === all.length;
  // A number alone says nothing.
  const said = (n) => all.every((path) => !/^[0-9]+$/.test(end(path, n)));
  const n = Array.from({ length: longest }, (_, k) => k + 1).find((k) => apart(k) && said(k)) ?? longest;
  return new Map(all.map((path) => [path, end(path, n)]));
}
