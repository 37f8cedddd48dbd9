// Search of the guide. Its index is fetched when the field is first used. All words must be there, in any order.
// Down and up go through what was found, Enter opens it, Escape goes back, and / leads to the field.

const MOST = 12;
const form = document.querySelector("#search");
const field = form.querySelector("input");
const list = form.querySelector("ol");
const said = form.querySelector("[role=status]");
let sections = null;

async function load() {
  sections ??= fetch("/docs/guide/search.json").then(async (answer) => {
    if (!answer.ok) throw new Error(answer.statusText);
    const small = (section) => ({
      ...section,
      low: {
        heading: section.heading.toLowerCase(),
        page: section.page.toLowerCase(),
        text: section.text.toLowerCase(),
      },
    });
    return (await answer.json()).map(small);
  });
  try {
    return await sections;
  } catch (error) {
    sections = null;
    throw error;
  }
}

// How well a section has a word; 0 if it does not.
function rank({ low }, word) {
  const begins = (text) => text.split(/[^\p{L}\p{N}_]+/u).some((other) => other.startsWith(word));
  if (low.heading === word) return 40;
  if (low.heading.includes(word)) return begins(low.heading) ? 20 : 10;
  if (low.page.includes(word)) return 6;
  if (low.text.includes(word)) return begins(low.text) ? 3 : 1;
  return 0;
}

function find(all, words) {
  const judged = all.map((section) => {
    const ranks = words.map((word) => rank(section, word));
    return { section, score: ranks.includes(0) ? 0 : ranks.reduce((sum, each) => sum + each, 0) };
  });
  return judged.filter(({ score }) => score > 0).sort((a, b) => b.score - a.score);
}

// The text around the first word, with all words marked.
function excerpt({ text, low }, words) {
  const places = words.map((word) => low.text.indexOf(word)).filter((at) => at >= 0);
  const from = Math.max(0, (places.length ? Math.min(...places) : 0) - 40);
  const start = from === 0 ? 0 : text.indexOf(" ", from) + 1;
  const shown = text.slice(start, start + 140);
  const line = document.createElement("span");
  if (start > 0) line.append("… ");
  let rest = shown;
  while (rest) {
    const lower = rest.toLowerCase();
    const hits = words.map((word) => [lower.indexOf(word), word.length]).filter(([at]) => at >= 0);
    const [at, length] = hits.sort((a, b) => a[0] - b[0])[0] ?? [rest.length, 0];
    line.append(rest.slice(0, at));
    if (length) {
      const mark = document.createElement("mark");
      mark.textContent = rest.slice(at, at + length);
      line.append(mark);
    }
    rest = rest.slice(at + length);
  }
  if (start + 140 < text.length) line.append(" …");
  return line;
}

function row(section, words) {
  const link = document.createElement("a");
  link.href = section.href;
  const title = document.createElement("strong");
  title.textContent = section.heading;
  link.append(title);
  if (section.page !== section.heading) link.append(` · ${section.page}`);
  link.append(excerpt(section, words));
  const item = document.createElement("li");
  item.append(link);
  return item;
}

function close() {
  list.replaceChildren();
  list.hidden = true;
  said.textContent = "";
}

async function look() {
  const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
  if (words.join("").length < 2) return close();
  const asked = field.value;
  let found;
  try {
    found = find(await load(), words);
  } catch {
    close();
    said.textContent = "The server does not answer. Type again to try again.";
    return;
  }
  if (asked !== field.value) return;
  list.replaceChildren(...found.slice(0, MOST).map(({ section }) => row(section, words)));
  list.hidden = found.length === 0;
  const count = found.length === 1 ? "1 place" : `${found.length} places`;
  said.textContent = found.length === 0 ? `Nothing about “${field.value.trim()}”` : count;
}

function move(event) {
  const links = [...list.querySelectorAll("a")];
  const at = links.indexOf(document.activeElement);
  if (event.key === "Escape") {
    close();
    field.focus();
  } else if (event.key === "ArrowDown" && links.length) {
    links[Math.min(at + 1, links.length - 1)].focus();
  } else if (event.key === "ArrowUp" && at >= 0) {
    (at === 0 ? field : links[at - 1]).focus();
  } else {
    return;
  }
  event.preventDefault();
}

field.addEventListener("input", look);
field.addEventListener("focus", () => load().catch(() => {}), { once: true });
form.addEventListener("keydown", move);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  list.querySelector("a")?.click();
});
// A heading of this page is found without loading it again.
list.addEventListener("click", (event) => event.target.closest("a") && setTimeout(close));
document.addEventListener("keydown", (event) => {
  const elsewhere = !["INPUT", "TEXTAREA"].includes(document.activeElement?.tagName);
  if (event.key === "/" && elsewhere && !event.ctrlKey && !event.metaKey && !event.altKey) {
    event.preventDefault();
    field.focus();
  }
});
form.hidden = false;
