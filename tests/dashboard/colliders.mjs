// Colliders, the domain and the axes in the 3D view, and the exports of a frame.

import assert from "node:assert/strict";
import { obstacles, plane } from "./scenes.mjs";

const ended = async (browser, scene) => {
  const { id } = await browser.api("POST", "/v1/jobs", { scene });
  await browser.go(`#/jobs/${id}`);
  await browser.shows(".badge", "succeeded");
  return id;
};

/** The canvas, once it no longer changes. */
async function settled(browser) {
  for (let before = null; ;) {
    await new Promise((resolve) => setTimeout(resolve, 200));
    const now = await browser.painted(".view3d");
    if (before?.sum === now.sum) return now;
    before = now;
  }
}

let job = null;

async function collidersAreDrawn(browser) {
  const { page } = browser;
  job = await ended(browser, obstacles());
  await browser.until("the preview", () => !document.querySelector(".player button").disabled);
  await browser.go(`#/jobs/${job}/view`);
  await browser.shows("output", "frame 10 of 10");
  await browser.until("the choice", () => document.getElementById("colliders").closest("label").checkVisibility());
  const solid = await settled(browser);
  await page.select("#colliders", "through");
  const through = await settled(browser);
  await page.select("#colliders", "hidden");
  const hidden = await settled(browser);
  assert.ok(new Set([solid.sum, through.sum, hidden.sum]).size === 3, JSON.stringify([solid, through, hidden]));
  assert.ok(solid.share > hidden.share + 0.02, JSON.stringify([solid, hidden]));
  await page.select("#colliders", "solid");
  assert.deepEqual(await page.$$eval(".axes3d text", (list) => list.map((one) => one.textContent).sort()), [
    "x",
    "y",
    "z",
  ]);
  // The bodies are named by their colours.
  await page.select("#field", "body");
  await browser.shows(".legend3d .names", "block");
  await settled(browser);
  await browser.look("colliders");
  // At first there was no tube, and the plate was lower.
  await page.focus("#frame");
  await page.keyboard.press("Home");
  await browser.shows("output", "frame 0 of 10");
  const first = await settled(browser);
  assert.ok(first.sum !== solid.sum);
  const at = (frame) => browser.api("GET", `/v1/jobs/${job}/frames/${frame}/colliders`);
  const [start, end] = [await at(0), await at(10)];
  assert.deepEqual(
    [start, end].map(({ colliders }) => colliders.map(({ name }) => name)),
    [
      ["post", "plate"],
      ["post", "plate", "tube"],
    ],
  );
  assert.ok(start.edition !== end.edition && end.moves);
  assert.ok(Math.abs(end.colliders[1].position[2] - 0.25) < 1e-9, JSON.stringify(end));
  assert.ok(end.colliders[2].translucent && !end.colliders[0].translucent);
}

async function collidersInThePlane(browser) {
  const { page } = browser;
  const id = await ended(browser, plane());
  await browser.go(`#/jobs/${id}/view`);
  await browser.shows("output", "frame 4 of 4");
  const solid = await settled(browser);
  await page.select("#colliders", "hidden");
  const hidden = await settled(browser);
  assert.ok(solid.share > hidden.share + 0.005, JSON.stringify([solid, hidden]));
  await page.select("#colliders", "solid");
  await settled(browser);
  assert.equal(await page.$$eval(".axes3d text", (list) => list.length), 2);
  await browser.look("plane");
  // 2D scenes have no surface to export.
  await browser.go(`#/jobs/${id}`);
  await browser.shows(".exports dt", "Points");
  assert.ok(!(await browser.text(".exports")).includes("Surface"));
}

async function aFrameAsFiles(browser) {
  const { page } = browser;
  await browser.go(`#/jobs/${job}`);
  await browser.shows(".exports", "of 0 to 10");
  const links = () => page.$$eval(".exports a", (list) => list.map((one) => one.href));
  const all = await links();
  assert.equal(all.length, 9);
  for (const link of all) {
    const answer = await fetch(link);
    assert.ok(answer.status === 200 && link.includes("/frames/10/"), `${answer.status} ${link}`);
    assert.ok((await answer.arrayBuffer()).byteLength > 100, link);
  }
  await browser.type("#export-frame", "11");
  await browser.shows(".exports [role=alert]", "frames 0 to 10");
  await browser.type("#export-frame", "3");
  await browser.until("its links", () => document.querySelector(".exports a")?.href.includes("/frames/3/"));
  // The frame of the picture is the frame of the files.
  await browser.until("the picture", () => document.querySelector(".picture img")?.naturalWidth > 0);
  await page.focus("#drawn-frame");
  await page.keyboard.press("Home");
  await browser.until("frame 0", () => document.querySelector(".exports a").href.includes("/frames/0/"));
}

/** A recording without shapes, as old releases left them: points are seen without, and shapes are not asked for
 * again. */
async function recordingsWithoutShapes(browser) {
  const { page } = browser;
  const { jobs } = await browser.api("GET", "/v1/jobs");
  const missed = [];
  // The browser counts what is missing among the errors of the page.
  browser.quiet = true;
  page.on("response", (answer) => answer.url().includes("/colliders") && missed.push(answer.status()));
  await browser.go(`#/jobs/${jobs[0].id}`);
  await browser.shows(".exports dt", "Points");
  await browser.until("no link", () => !document.querySelector(".exports").textContent.includes("Colliders"));
  await browser.go(`#/jobs/${jobs[0].id}/view`);
  await browser.shows("output", "of 4");
  await page.focus("#frame");
  for (const key of ["Home", "ArrowRight", "ArrowRight", "ArrowRight"]) await page.keyboard.press(key);
  await browser.shows("output", "frame 3 of 4");
  const seen = await settled(browser);
  assert.ok(seen.share > 0.005, JSON.stringify(seen));
  assert.ok(await page.$eval("#colliders", (choice) => !choice.closest("label").checkVisibility()));
  assert.equal(await browser.text("[role=alert]"), "");
  assert.ok(missed.length > 0 && missed.length <= 3 && missed.every((status) => status === 404), `${missed}`);
  await browser.look("without-shapes");
}

export const old = { recordingsWithoutShapes };
export const all = { collidersAreDrawn, collidersInThePlane, aFrameAsFiles };
