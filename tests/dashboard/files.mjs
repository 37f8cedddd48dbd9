// Files that are uploaded for scenes, and the options of jobs.

import assert from "node:assert/strict";
import { mkdtempSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { block, tetrahedron } from "./scenes.mjs";

const folder = mkdtempSync(join(tmpdir(), "gridfall-dashboard-"));
const written = (name, content) => {
  writeFileSync(join(folder, name), content);
  return join(folder, name);
};
const scene = (browser) => browser.page.$eval("#scene", (text) => JSON.parse(text.value));
const ready = (browser) => browser.until("the button", () => !document.querySelector(".judge .primary").disabled);

async function aMeshIsUploadedAndUsed(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.5, "tetrahedron"), null, 2));
  const input = await page.$("#asset");
  await input.uploadFile(written("tetrahedron.obj", tetrahedron));
  await browser.shows(".uploads", "tetrahedron.obj obj");
  const id = (await browser.text(".uploads .address")).trim();
  assert.match(id, /^sha256:[0-9a-f]{64}$/);
  const places = await page.$$eval(".uploads select option", (list) => list.map((one) => one.textContent));
  assert.deepEqual(places, ["as the shape of body block", "at the cursor"]);
  await browser.press("Put into the scene", ".uploads");
  assert.deepEqual((await scene(browser)).bodies[0].shape, { mesh: { asset: id } });
  await browser.shows(".judged", "Valid");
  await browser.look("upload");
  // What is no mesh is refused with the reason.
  browser.quiet = true;
  await input.uploadFile(written("broken.stl", "this is no mesh"));
  await browser.shows(".uploads [role=alert]", "invalid_asset");
  browser.quiet = false;
  await browser.look("upload-refused");
  await browser.press("Take away", ".uploads");
  // Once more, dropped; the same file is the same asset.
  await page.evaluate((content) => {
    const dropped = new DataTransfer();
    dropped.items.add(new File([content], "dropped.obj"));
    const event = (name) => new DragEvent(name, { dataTransfer: dropped, bubbles: true, cancelable: true });
    const place = document.querySelector("#scene");
    ["dragenter", "dragover", "drop"].forEach((name) => place.dispatchEvent(event(name)));
  }, tetrahedron);
  await browser.shows(".uploads", "dropped.obj");
  assert.equal((await browser.text(".uploads .address")).trim(), id);
  await ready(browser);
  await page.focus(".judge .primary");
  await page.keyboard.press("Enter");
  await browser.shows("h1", "tetrahedron");
  await browser.shows(".badge", "succeeded");
  // It is there the next time.
  await browser.go("#/new");
  await page.click(".files-in summary");
  await browser.shows(".files-in details .address", id);
}

async function aJobStartsFromAnother(browser) {
  const { page } = browser;
  const first = { ...block(0.2, "first part"), output: { state: true } };
  const { id } = await browser.api("POST", "/v1/jobs", { scene: first });
  await browser.go(`#/jobs/${id}`);
  await browser.shows(".badge", "succeeded");
  await browser.shows(".files", "state.npz");
  await browser.press("start a job from it", ".files");
  await browser.shows("h1", "New job");
  await browser.shows(".judged", "Valid");
  assert.equal(await page.$eval("#start-from", (input) => input.value), id);
  await browser.look("options");
  await ready(browser);
  await browser.type("#name", "second part");
  await ready(browser);
  await page.click(".judge .primary");
  await browser.shows("h1", "second part");
  await browser.shows(".badge", "succeeded");
  const second = page.url().match(/jobs\/([0-9a-f-]{36})/)[1];
  assert.match((await browser.api("GET", `/v1/jobs/${second}/scene`)).start.asset, /^sha256:/);
  // One that is not there is said.
  browser.quiet = true;
  await browser.go(`#/new?job=${id}&start=01890000-0000-7000-8000-000000000000`);
  await browser.shows(".verdict", "01890000-0000-7000-8000-000000000000");
  browser.quiet = false;
}

async function optionsOfAJob(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.5), null, 2));
  await browser.shows(".judged", "Valid");
  await page.focus(".more summary");
  await page.keyboard.press("Enter");
  await browser.type("#max-cost", "0.0001");
  await browser.shows(".judged", "more than you allow");
  assert.ok(await page.$eval(".judge .primary", (button) => button.disabled));
  await browser.type("#max-cost", "1000");
  await browser.type("#priority", "7");
  await browser.type("#deadline", "2999-01-02T03:04:05");
  await browser.type("#name", "with wishes");
  await ready(browser);
  await page.click(".judge .primary");
  await browser.shows("h1", "with wishes");
  const id = page.url().match(/jobs\/([0-9a-f-]{36})/)[1];
  const job = await browser.api("GET", `/v1/jobs/${id}`);
  assert.equal(job.priority, 7);
  assert.equal(job.deadline.slice(0, 4), "2999");
  await browser.shows(".badge", "succeeded");
  // The same once more need not run.
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.5), null, 2));
  await page.focus(".more summary");
  await page.keyboard.press("Enter");
  await page.click("#reuse");
  await ready(browser);
  const { jobs } = await browser.api("GET", "/v1/jobs?limit=200");
  await page.click(".judge .primary");
  await browser.shows(".badge", "succeeded");
  assert.equal((await browser.api("GET", "/v1/jobs?limit=200")).jobs.length, jobs.length);
}

export const all = { aMeshIsUploadedAndUsed, aJobStartsFromAnother, optionsOfAJob };
