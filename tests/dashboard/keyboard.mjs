// By keyboard alone: submit, open, cancel, run again, select many, sweep. And a list of hundreds of jobs.

import assert from "node:assert/strict";
import { block } from "./scenes.mjs";

const MOST_TABS = 150;

/** Goes on with the tabulator until what has a name has the focus. */
async function tabTo(browser, name, back = false) {
  const { page } = browser;
  const passed = [];
  for (let n = 0; n < MOST_TABS; n += 1) {
    if (back) await page.keyboard.down("Shift");
    await page.keyboard.press("Tab");
    if (back) await page.keyboard.up("Shift");
    const at = await page.evaluate(() => {
      const element = document.activeElement;
      return element.getAttribute("aria-label") ?? element.labels?.[0]?.textContent ?? element.textContent;
    });
    passed.push(at.trim().slice(0, 40));
    if (at.trim().startsWith(name)) return;
  }
  assert.fail(`no way to ${name} by keyboard; there are ${passed.join(" | ")}`);
}

const press = async (browser, ...keys) => {
  for (const key of keys) await browser.page.keyboard.press(key);
};
const opened = (browser) => browser.page.waitForSelector("dialog[open]");

async function byKeyboardAlone(browser) {
  const { page } = browser;
  await browser.go("");
  // Submit: paste a scene, name it, send it.
  await tabTo(browser, "New job");
  await press(browser, "Enter");
  await browser.shows("h1", "New job");
  await tabTo(browser, "Scene");
  await page.keyboard.sendCharacter(JSON.stringify(block(999, "by hand")));
  await browser.shows(".judged", "Valid");
  await tabTo(browser, "Submit the job");
  await press(browser, "Enter");
  await browser.shows("h1", "by hand");
  await browser.shows(".badge", "running");
  // Cancel it.
  await tabTo(browser, "Cancel");
  await press(browser, "Enter");
  await opened(browser);
  await tabTo(browser, "Cancel now");
  await press(browser, "Enter");
  await browser.shows(".badge", "canceled");
  const first = page.url();
  // Run it again; the new job opens by itself.
  await tabTo(browser, "Run again");
  await press(browser, "Enter");
  await browser.until("another job", (old) => location.href !== old && location.hash.startsWith("#/jobs/"), first);
  await browser.shows(".badge", "running");
  // To the list, and open a job from there.
  await tabTo(browser, "Jobs", true);
  await press(browser, "Enter");
  await browser.shows("h1", "Jobs");
  await browser.until("jobs", () => document.querySelectorAll(".jobs tbody tr").length > 1);
  await tabTo(browser, "by hand");
  await press(browser, "Enter");
  await browser.shows("h1", "by hand");
  await page.goBack();
  await browser.until("jobs", () => document.querySelectorAll(".jobs tbody tr").length > 1);
  // Select the two, cancel them, run them again, cancel those.
  await tabTo(browser, "Select by hand");
  await press(browser, "Space");
  await page.keyboard.down("Shift");
  await press(browser, "ArrowDown");
  await page.keyboard.up("Shift");
  await browser.shows("#selected", "2 selected");
  await tabTo(browser, "Run again", true);
  await press(browser, "Enter");
  await browser.shows(".toast", "2 jobs submitted again");
  await browser.until("four", () => document.querySelectorAll(".jobs .badge:is(.queued, .running)").length === 3);
  await tabTo(browser, "Select all jobs");
  await press(browser, "Space");
  await tabTo(browser, "Cancel", true);
  await press(browser, "Enter");
  await opened(browser);
  await tabTo(browser, "Cancel now");
  await press(browser, "Enter");
  await browser.until("an end", () => !document.querySelector(".jobs .badge:is(.queued, .running)"));
  // A sweep.
  await tabTo(browser, "New job", true);
  await press(browser, "Enter");
  await browser.shows("h1", "New job");
  await tabTo(browser, "Scene");
  await page.keyboard.sendCharacter(JSON.stringify(block(0.1, "seeds")));
  await browser.shows(".judged", "Valid");
  await tabTo(browser, "Add a parameter");
  await press(browser, "Enter");
  await page.keyboard.type("seed");
  await press(browser, "Escape");
  await tabTo(browser, "Values");
  await page.keyboard.type("1, 2");
  await browser.shows(".judge .primary", "Submit 2 jobs");
  await browser.until("the button", () => !document.querySelector(".judge .primary").disabled);
  await tabTo(browser, "Submit 2 jobs");
  await press(browser, "Enter");
  await browser.shows("h1", "seeds");
  await browser.shows(".far", "2 succeeded");
}

async function hundredsOfJobs(browser) {
  const { page } = browser;
  await browser.api("POST", "/v1/jobs", { scene: block(999, "before all") });
  for (const name of ["crowd a", "crowd b"]) {
    const grid = { seed: Array.from({ length: 250 }, (_, seed) => seed + 1) };
    await browser.api("POST", "/v1/sweeps", { scene: block(999, name), grid });
  }
  await browser.go("");
  await browser.until("a page", () => document.querySelectorAll(".jobs tbody tr").length === 25);
  await browser.shows(".jobs .progress", "500th in the queue");
  await browser.look("crowd");
  for (let n = 2; n <= 21; n += 1) {
    const before = await browser.text(".jobs tbody a");
    await browser.press("Older");
    await browser.until("the next page", (old) => document.querySelector(".jobs tbody a").textContent !== old, before);
  }
  await browser.shows(".jobs", "before all");
  await browser.go("#/sweeps");
  await browser.shows(".sweeps tbody", "250 queued");
  await page.click(".sweeps tbody a");
  await browser.until("all rows", () => document.querySelectorAll(".of-sweep tbody tr").length === 250);
  await browser.look("crowd-sweep");
  await browser.go("#/?text=crowd");
  await browser.until("a page", () => document.querySelectorAll(".jobs tbody tr").length === 25);
  await browser.press("Cancel all that match…");
  await opened(browser);
  await browser.press("Cancel all", "dialog");
  await browser.shows(".toast", "500 jobs canceled");
  await browser.api("POST", "/v1/jobs:cancel", { status: ["running", "queued"] });
}

export const all = { byKeyboardAlone, hundredsOfJobs };
