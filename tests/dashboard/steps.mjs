// The steps of a first day. Each begins at an address of its own.

import assert from "node:assert/strict";
import { block, faulty } from "./scenes.mjs";

const key = (browser, ...keys) =>
  keys.reduce((done, name) => done.then(() => browser.page.keyboard.press(name)), Promise.resolve());
const state = (browser, word) => browser.shows(".badge", word);
const id = (browser) => browser.page.url().match(/jobs\/([0-9a-f-]{36})/)[1];
let first = null;

async function nothingYet(browser) {
  await browser.go("");
  await browser.shows(".empty", "No jobs yet");
  await browser.shows(".devices", "Jobs run on CPU");
  await browser.look("empty");
  await browser.go("#/sweeps");
  await browser.shows(".empty", "No sweeps yet");
  await browser.look("no-sweeps");
}

async function faultsWhileTyping(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.shows("#verdict", "The cost of the run will be here");
  await browser.type("#scene", '{\n  "gridfall": 1,\n  "name" "x"\n}');
  await browser.shows("#verdict", "line 3, column 10");
  await browser.type("#scene", JSON.stringify(faulty, null, 2));
  await browser.shows(".judged", "2 faults");
  const faults = await page.$$eval(".fault", (list) => list.map((fault) => fault.innerText));
  assert.ok(
    faults.some((text) => text.startsWith("/materials/jelly/density")),
    faults.join("\n"),
  );
  assert.ok(
    faults.every((text) => text.includes("Remedy: ")),
    faults.join("\n"),
  );
  assert.ok(await page.$eval(".judge .primary", (button) => button.disabled));
  // A fault leads to its place in the text.
  await page.click(".fault .place");
  const chosen = await page.$eval("#scene", (text) => text.value.slice(text.selectionStart, text.selectionEnd));
  assert.match(chosen, /^"(density": -1|material": "jely")/);
  await browser.look("faults");
}

async function pasted(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.5), null, 2));
  await browser.shows(".judged", "Valid: 512 particles");
  await browser.shows(".cost", "on two cores");
  await browser.shows(".facts", "11 frames, 0.5 s");
  await browser.look("new");
  await browser.type("#tags", "first, pasted");
  await browser.until("the button", () => !document.querySelector(".judge .primary").disabled);
  await page.focus(".judge .primary");
  await key(browser, "Enter");
  await browser.shows("h1", "block");
  await state(browser, "succeeded");
  first = id(browser);
  assert.deepEqual((await browser.api("GET", `/v1/jobs/${first}`)).tags, ["first", "pasted"]);
}

async function jobPage(browser) {
  const { page } = browser;
  await browser.go(`#/jobs/${first}`);
  await browser.until("the picture", () => document.querySelector(".picture img")?.naturalWidth > 0);
  await browser.until("the plots", () => document.querySelectorAll(".plot path.series").length >= 10);
  await browser.shows(".log", "attempt 1: succeeded");
  // Other frames are drawn, in other colours.
  await browser.until("the fields", () => document.querySelectorAll("#drawn-colors option").length > 3);
  await page.select("#drawn-colors", "speed");
  await page.focus("#drawn-frame");
  await key(browser, "Home");
  await browser.until("frame 0", () => {
    const image = document.querySelector(".picture img");
    return image.src.includes("/frames/0/picture.png") && image.src.includes("color_by=speed") && image.complete;
  });
  await browser.until("no note", () => document.querySelector(".picture .note[role=status]").textContent === "");
  assert.equal(await browser.text(".picture output"), "frame 0");
  // The preview moves.
  await browser.until("the preview", () => !document.querySelector(".player button").disabled);
  const before = await browser.painted(".preview");
  assert.ok(before.share > 0.005 && before.colors > 20, JSON.stringify(before));
  await browser.until(
    "another frame",
    (text) => document.querySelector(".player .note").textContent !== text,
    await browser.text(".player .actions .note"),
  );
  await browser.press("Pause the preview");
  // Plots can be read by keyboard, as numbers, and without some of their series.
  await page.focus(".plot-area");
  await key(browser, "Home");
  assert.match(await browser.text(".plot .values"), /^at 0 s: kinetic .* J$/);
  await key(browser, "ArrowRight");
  assert.match(await browser.text(".plot .values"), /^at 0.05 s/);
  const lines = await page.$$eval(".plot:first-child path.series", (paths) => paths.length);
  await page.click(".plot .legend button");
  assert.equal(await page.$$eval(".plot:first-child path.series", (paths) => paths.length), lines - 1);
  await page.click(".plot .legend button");
  await page.click(".plot summary");
  await browser.until("numbers", () => document.querySelectorAll(".plot .numbers tbody tr").length >= 11);
  await page.click(".plot summary");
  for (const link of await page.$$eval(".files a", (links) => links.map((link) => link.href))) {
    assert.equal((await fetch(link)).status, 200, link);
  }
  const viewers = await page.$$eval(".viewers a", (links) => links.map((link) => link.href));
  const recording = encodeURIComponent(`${browser.url}/v1/jobs/${first}/recording.mcap`);
  assert.equal(viewers.length, 3);
  assert.ok(
    viewers.every((link) => link.startsWith("https://") && link.endsWith(recording)),
    viewers.join(),
  );
  await browser.look("job");
}

async function stillForWhoWantsIt(browser) {
  const { page } = browser;
  await page.emulateMediaFeatures([{ name: "prefers-reduced-motion", value: "reduce" }]);
  await browser.go(`#/jobs/${first}`);
  await browser.until("the preview", () => !document.querySelector(".player button").disabled);
  assert.equal(await browser.text(".player button"), "Play");
  const time = await browser.text(".player .actions .note");
  await new Promise((resolve) => setTimeout(resolve, 500));
  assert.equal(await browser.text(".player .actions .note"), time);
  await page.emulateMediaFeatures([]);
}

async function view3d(browser) {
  const { page } = browser;
  await browser.go(`#/jobs/${first}/view`);
  await browser.shows("output", "frame 10 of 10");
  const drawn = async () => {
    await new Promise((resolve) => setTimeout(resolve, 250));
    return browser.painted(".view3d");
  };
  const whole = await drawn();
  assert.ok(whole.share > 0.005 && whole.colors > 50, JSON.stringify(whole));
  await browser.shows(".legend3d", "m/s");
  await page.focus(".view3d");
  await key(browser, "ArrowLeft", "ArrowUp", "+");
  const turned = await drawn();
  assert.ok(turned.sum !== whole.sum && turned.share > whole.share, JSON.stringify([whole, turned]));
  await key(browser, ",");
  await browser.shows("output", "frame 9 of 10");
  const box = await (await page.$(".view3d")).boundingBox();
  await page.mouse.move(box.x + 200, box.y + 200);
  await page.mouse.down();
  await page.mouse.move(box.x + 300, box.y + 220, { steps: 4 });
  await page.mouse.up();
  await page.mouse.wheel({ deltaY: 300 });
  const dragged = await drawn();
  assert.notEqual(dragged.sum, turned.sum);
  const fields = await page.$$eval("#field option", (options) => options.map((option) => option.value));
  assert.deepEqual(fields.filter((name) => ["speed", "vx", ""].includes(name)).sort(), ["", "speed", "vx"]);
  await page.select("#field", "");
  await browser.until("no legend", () => document.querySelector(".legend3d").hidden);
  assert.notEqual((await drawn()).sum, dragged.sum);
  await page.select("#field", "speed");
  await browser.press("Play");
  await browser.shows("output", "frame 3 of 10");
  await browser.press("Pause");
  await browser.press("All");
  await drawn();
  await browser.look("view");
}

async function fromTheLibrary(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await page.waitForSelector("[data-scene]");
  await browser.type("#find", "bouncing-ball");
  await page.click('[data-scene="bouncing-ball"]');
  await browser.shows(".judged", "Valid: 7,616 particles");
  // Long enough to be watched.
  await page.$eval("#scene", (text) => {
    text.value = text.value.replace(/"end": \d+/, '"end": 500');
    text.dispatchEvent(new Event("input"));
  });
  await browser.shows(".facts", "500 s");
  await browser.until("the button", () => !document.querySelector(".judge .primary").disabled);
  await page.click(".judge .primary");
  await state(browser, "running");
  await browser.shows(".far", "left");
  const job = id(browser);
  await page.goto(`${browser.url}/#/jobs/${job}/view`);
  await browser.shows("output", "frame ");
  const frame = Number((await browser.text("output")).match(/frame (\d+)/)[1]);
  await browser.until(
    "newer frames",
    (before) => Number(document.querySelector("output").textContent.match(/frame (\d+)/)?.[1]) > before + 1,
    frame,
  );
  await page.goto(`${browser.url}/#/jobs/${job}`);
  await browser.shows(".far", "left");
  const live = encodeURIComponent(`${browser.url.replace("http", "ws")}/v1/jobs/${job}/live`);
  const viewers = await page.$$eval(".viewers a", (links) => links.map((link) => link.href));
  assert.ok(viewers.length === 2 && viewers.every((link) => link.endsWith(live)), viewers.join());
  await browser.look("running");
  await browser.press("Cancel");
  await page.waitForSelector("dialog[open]");
  await browser.press("Cancel now", "dialog");
  await state(browser, "canceled");
  await browser.shows("#announcer", "canceled");
}

async function again(browser) {
  await browser.go(`#/jobs/${first}`);
  await browser.press("Run again");
  await browser.until(
    "another job",
    (old) => location.hash.startsWith("#/jobs/") && !location.hash.includes(old),
    first,
  );
  await state(browser, "succeeded");
  await browser.go(`#/new?job=${first}`);
  await browser.shows(".judged", "Valid: 512 particles");
}

async function failure(browser) {
  const endless = await browser.api("POST", "/v1/jobs", { scene: block(999, "endless") });
  const deadline = new Date(Date.now() - 1000).toISOString();
  const late = await browser.api("POST", "/v1/jobs", { scene: block(1, "too late"), deadline });
  await browser.go(`#/jobs/${late.id}`);
  await state(browser, "failed");
  await browser.shows(".problem code", "deadline");
  await browser.shows(".problem .remedy", "higher");
  await browser.look("failed");
  await browser.api("POST", `/v1/jobs/${endless.id}/cancel`);
}

async function manyByKeyboard(browser) {
  const { page } = browser;
  await browser.api("POST", "/v1/jobs", { scene: block(999, "first of many") });
  const grid = { seed: Array.from({ length: 30 }, (_, seed) => seed + 1) };
  await browser.api("POST", "/v1/sweeps", { scene: block(999, "many"), grid, tags: ["many"] });
  await browser.go("#/?text=many");
  await browser.until("a page", () => document.querySelectorAll(".jobs tbody tr").length === 25);
  await browser.press("Older");
  await browser.until("the next page", () => document.querySelectorAll(".jobs tbody tr").length === 5);
  await browser.press("Newer");
  await browser.until("the first page", () => document.querySelectorAll(".jobs tbody tr").length === 25);
  await page.focus(".jobs tbody input");
  await key(browser, "Space", "ArrowDown", "ArrowUp");
  await page.keyboard.down("Shift");
  await key(browser, "ArrowDown", "ArrowDown");
  await page.keyboard.up("Shift");
  assert.equal(await browser.text("#selected"), "3 selected");
  await browser.look("jobs");
  // On to the buttons, by keyboard alone.
  await page.focus(".bulk .actions button");
  await key(browser, "Enter");
  await page.waitForSelector("dialog[open]");
  await key(browser, "Tab", "Enter");
  await browser.shows(".toast", "3 jobs canceled");
  await browser.until("three canceled", () => document.querySelectorAll(".jobs .badge.canceled").length === 3);
  await browser.type("#search", "#many");
  await browser.press("queued", ".filters");
  await browser.until("no canceled", () => !document.querySelector(".jobs .badge.canceled"));
  await browser.press("Cancel all that match…");
  await page.waitForSelector("dialog[open]");
  await browser.press("Cancel all", "dialog");
  await browser.shows(".toast", "27 jobs canceled");
  await browser.shows(".empty", "No job matches");
  await browser.press("Show all jobs");
  await browser.until("all jobs", () => document.querySelectorAll(".jobs tbody tr").length === 25);
  await browser.api("POST", "/v1/jobs:cancel", { status: ["running", "queued"] });
}

async function lostAndFound(browser) {
  const { page } = browser;
  await browser.go("");
  await browser.until("jobs", () => document.querySelectorAll(".jobs tbody tr").length > 0);
  browser.quiet = true;
  await page.setOfflineMode(true);
  await browser.shows("#connection", "is lost");
  await page.screenshot({ path: `${browser.pictures}/lost-light.png` });
  await page.setOfflineMode(false);
  await browser.press("Try now");
  await browser.until("the connection", () => document.getElementById("connection").hidden);
  browser.quiet = false;
}

async function focusIsSeen(browser) {
  const { page } = browser;
  for (const hash of ["", "#/new?scene=quickstart", `#/jobs/${first}`, `#/jobs/${first}/view`]) {
    await browser.go(hash);
    await new Promise((resolve) => setTimeout(resolve, 700));
    const passed = [];
    for (let n = 0; n < 30; n += 1) {
      await key(browser, "Tab");
      const at = await page.evaluate(() => {
        const element = document.activeElement;
        if (element === document.body) return null;
        const shown = [element, element.nextElementSibling, element.parentElement]
          .filter(Boolean)
          .map((one) => getComputedStyle(one));
        const seen = shown.some((style) => style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 1);
        const name =
          element.getAttribute("aria-label") ?? (element.textContent.trim() || element.labels?.[0]?.textContent);
        return { tag: element.tagName, name: name?.slice(0, 40), seen };
      });
      if (!at) break;
      passed.push(at);
    }
    assert.equal(passed[0].name, "Skip to the content");
    assert.ok(passed.length >= 10, JSON.stringify(passed));
    for (const at of passed) assert.ok(at.seen && at.name, `${hash}: ${JSON.stringify(at)}`);
  }
  // A choice of colours is kept.
  await page.select("#theme", "dark");
  await browser.go("");
  assert.equal(await page.$eval("html", (html) => html.dataset.theme), "dark");
  await page.select("#theme", "auto");
}

async function guide(browser) {
  const { page } = browser;
  await browser.go("docs/guide/");
  // By keyboard alone: to the field, words, the second of what was found, and there.
  await key(browser, "/");
  await page.keyboard.type("friction angle");
  await browser.until("places", () => document.querySelectorAll("#search li a").length >= 3);
  await browser.look("guide-search");
  await page.focus("#search input");
  await key(browser, "ArrowDown", "ArrowDown");
  const chosen = await page.evaluate(() => ({
    href: document.activeElement.href,
    found: [...document.querySelectorAll("#search li a")].map((link) => link.textContent.toLowerCase()),
  }));
  assert.ok(chosen.href.includes("/docs/guide/"), chosen.href);
  await Promise.all([page.waitForNavigation(), key(browser, "Enter")]);
  assert.equal(page.url(), chosen.href);
  const { hash } = new URL(chosen.href);
  assert.ok(await page.evaluate((hash) => document.getElementById(decodeURIComponent(hash.slice(1))), hash), hash);
  // The best place comes first, and Enter opens it.
  await browser.go("docs/guide/");
  await page.type("#search input", "von mises yield_stress");
  await browser.until("places", () => document.querySelectorAll("#search li a").length > 0);
  await Promise.all([page.waitForNavigation(), key(browser, "Enter")]);
  assert.match(page.url(), /\/docs\/guide\/(scene#von-mises|MATERIALS|NUMERICS|PRESETS)/);
  await browser.go("docs/guide/scene");
  await page.type("#search input", "xyzzy");
  await browser.shows("#search [role=status]", "Nothing about “xyzzy”");
  await key(browser, "Escape");
  assert.equal(await browser.text("#search [role=status]"), "");
  // Pictures of what the page describes.
  const broken = await page.$$eval("main img", async (images) => {
    await Promise.all(images.map((image) => image.decode().catch(() => {})));
    return images.filter((image) => image.naturalWidth === 0).map((image) => image.src);
  });
  assert.deepEqual(broken, []);
  await browser.look("guide-scene");
}

async function gone(browser) {
  browser.quiet = true;
  await browser.go("#/jobs/01890000-0000-7000-8000-000000000000");
  await browser.shows("h1", "There is no such job");
  browser.quiet = false;
  await browser.go("#/nowhere");
  await browser.shows("h1", "no such page");
}

export const all = {
  nothingYet,
  faultsWhileTyping,
  pasted,
  jobPage,
  stillForWhoWantsIt,
  view3d,
  fromTheLibrary,
  again,
  failure,
  manyByKeyboard,
  guide,
};

export const last = { lostAndFound, focusIsSeen, gone };
