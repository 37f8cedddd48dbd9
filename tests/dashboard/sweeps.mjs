// Sweeps: written, judged, submitted, followed, canceled.

import assert from "node:assert/strict";
import { block } from "./scenes.mjs";

const ready = (browser) => browser.until("the button", () => !document.querySelector(".judge .primary").disabled);

async function aSweepIsWritten(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.25, "stiffness"), null, 2));
  await browser.shows(".judged", "Valid");
  await page.focus(".sweep .actions button");
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement.id), "path-1");
  await browser.shows(".judged", "Something is missing");
  const known = await page.$$eval("#paths option", (list) => list.map((one) => one.value));
  assert.ok(
    known.includes("materials.jelly.youngs_modulus") && known.includes("bodies.0.angular_velocity.0"),
    known.join(),
  );
  await page.keyboard.type("materials.jelly.youngs_modulus");
  await page.select("#kind-1", "ratios");
  await browser.type("#from-1", "1e4");
  await browser.type("#to-1", "1e6");
  await browser.type("#count-1", "3");
  await browser.shows(".parameter .note", "3 values: 10000, 100000, 1000000. The scene has 100000.");
  await browser.shows(".judged", "Valid: 3 jobs");
  await browser.press("Add a parameter");
  await page.keyboard.type("solver.kernel");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Tab");
  await page.keyboard.type("compact, quadratic");
  await browser.shows("#sweep-total", "3 × 2 = 6 jobs");
  await browser.shows(".judged", "Valid: 6 jobs");
  await browser.shows(".cost", "together");
  await browser.shows(".judge .primary", "Submit 6 jobs");
  assert.equal((await page.$$(".verdict tbody tr")).length, 6);
  await browser.look("new-sweep");
  // A fault says of which job it is.
  await browser.type("#values-2", "compact, round");
  await browser.shows(".judged", "A job of the sweep has 1 fault");
  await browser.shows(".verdict", "round");
  await browser.type("#values-2", "compact, quadratic");
  await ready(browser);
  await page.focus(".judge .primary");
  await page.keyboard.press("Enter");
  await browser.shows("h1", "stiffness");
}

async function aSweepIsFollowed(browser) {
  const { page } = browser;
  await browser.shows(".far", "ended · 6 succeeded");
  await browser.until("all results", () => document.querySelectorAll(".of-sweep tbody tr").length === 6);
  await browser.shows(".of-sweep thead", "youngs_modulus");
  // A line for each kernel, a point for each stiffness.
  await browser.until("the plot", () => document.querySelectorAll(".results svg .dot").length === 6);
  await browser.shows(".results .legend", "kernel compact");
  assert.equal((await page.$$(".results .plot-area path.series")).length, 2);
  await browser.shows(".of-sweep thead", "max speed, largest (m/s)");
  const speeds = await page.$$eval(".of-sweep tbody td:nth-child(4)", (list) =>
    list.map((one) => Number(one.textContent)),
  );
  assert.ok(speeds.length === 6 && speeds.every((speed) => speed > 0.5), speeds.join());
  await page.focus(".results .plot-area");
  await page.keyboard.press("Home");
  await browser.shows(".results .values", "at 10000: kernel compact");
  await browser.look("sweep");
  // Another result, over words.
  await page.select("#result", "kinetic_j");
  await page.select("#taken", "last");
  await page.select("#over", "solver.kernel");
  await browser.shows(".of-sweep thead", "kinetic, at the end (J)");
  await browser.shows(".results .plot-area text", "quadratic");
  await page.select("#result", "run_s");
  await browser.shows(".of-sweep thead", "wall time (s)");
  // From a job back to its sweep.
  await page.click(".of-sweep tbody a");
  await browser.shows(".details dd", "youngs_modulus");
  await browser.press("its sweep", ".details");
  await browser.shows("h1", "stiffness");
  await browser.go("");
  await page.waitForSelector(".jobs a.of");
  await browser.go("#/sweeps");
  await browser.shows(".sweeps tbody", "6 succeeded");
}

async function aSweepIsCanceledAndDeleted(browser) {
  const { page } = browser;
  const grid = { seed: [1, 2, 3] };
  const { id } = await browser.api("POST", "/v1/sweeps", { scene: block(999, "endless sweep"), grid });
  await browser.go("#/sweeps");
  await browser.shows(".sweeps tbody", "endless sweep");
  await browser.shows(".sweeps tbody", "1 running");
  await browser.look("sweeps");
  await page.click(".sweeps tbody a");
  await browser.shows("h1", "endless sweep");
  await browser.shows(".of-sweep .badge", "running");
  await browser.press("Cancel all jobs");
  await page.waitForSelector("dialog[open]");
  await browser.press("Cancel now", "dialog");
  await browser.shows(".far", "ended · 3 canceled");
  await browser.shows("#announcer", "all jobs have ended");
  await browser.press("Delete all jobs");
  await page.waitForSelector("dialog[open]");
  await browser.press("Delete", "dialog");
  await browser.shows("h1", "Sweeps");
  await browser.shows(".sweeps tbody", "stiffness");
  await browser.until("the others", () => !document.querySelector(".sweeps tbody").textContent.includes("endless"));
  browser.quiet = true;
  for (const gone of [id, "01890000-0000-7000-8000-000000000000"]) {
    await browser.go(`#/sweeps/${gone}`);
    await browser.shows("h1", "There is no such sweep");
  }
  browser.quiet = false;
}

export const all = { aSweepIsWritten, aSweepIsFollowed, aSweepIsCanceledAndDeleted };
