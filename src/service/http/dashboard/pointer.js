// Where in a JSON text the value of a JSON pointer is.

/** Skips blanks from a place. */
function skip(text, at) {
  while (at < text.length && " \t\r\n".includes(text[at])) at += 1;
  return at;
}

/** The end of the string that begins at a place. */
function stringEnd(text, at) {
  for (at += 1; at < text.length && text[at] !== '"'; at += 1) if (text[at] === "\\") at += 1;
  return at + 1;
}

/** The end of the value that begins at a place. */
function valueEnd(text, at) {
  if (text[at] === '"') return stringEnd(text, at);
  if (text[at] === "{" || text[at] === "[") return members(text, at).end;
  while (at < text.length && !" \t\r\n,]}".includes(text[at])) at += 1;
  return at;
}

/** The members of the object or list that begins at a place, and where it ends. */
function members(text, at) {
  const isObject = text[at] === "{";
  const list = [];
  at = skip(text, at + 1);
  while (at < text.length && text[at] !== "}" && text[at] !== "]") {
    const start = at;
    let name = String(list.length);
    if (isObject) {
      at = stringEnd(text, at);
      name = JSON.parse(text.slice(start, at));
      at = skip(text, skip(text, at) + 1);
    }
    const value = at;
    const end = valueEnd(text, at);
    list.push({ name, start, value, end });
    at = skip(text, end);
    if (text[at] === ",") at = skip(text, at + 1);
  }
  return { list, end: at + 1 };
}

/** Start, end and line of what a pointer names, or of the nearest part around it that is there. */
export function locate(text, pointer) {
  const parts = pointer
    .split("/")
    .slice(1)
    .map((part) => part.replaceAll("~1", "/").replaceAll("~0", "~"));
  let [best, at] = [{ start: 0, end: 0 }, skip(text, 0)];
  for (const part of parts) {
    const inside = text[at] === "{" || text[at] === "[";
    const found = inside && members(text, at).list.find(({ name }) => name === part);
    if (!found) break;
    best = { start: found.start, end: found.end };
    at = found.value;
  }
  return { ...best, line: text.slice(0, best.start).split("\n").length };
}

/** The place that the browser's message about a JSON text names. */
export function errorPlace(text, message) {
  const position = /position (\d+)/.exec(message);
  const byLine = /line (\d+) column (\d+)/.exec(message);
  let at = position ? Number(position[1]) : null;
  if (at === null && byLine) {
    const lines = text.split("\n").slice(0, Number(byLine[1]) - 1);
    at = lines.reduce((sum, line) => sum + line.length + 1, 0) + Number(byLine[2]) - 1;
  }
  // Some messages name no place: then the text ended too early.
  at ??= text.length;
  const before = text.slice(0, at).split("\n");
  return { start: at, end: Math.min(at + 1, text.length), line: before.length, column: before.at(-1).length + 1 };
}
