// A server that asks for a key: signing in, plain links, signing out; and the API's reference under its policy.

import assert from "node:assert/strict";
import { block } from "./scenes.mjs";

const form = (browser) => browser.page.waitForSelector("#key");

async function peopleSignIn(browser) {
  const { page } = browser;
  // Chromium counts answers that refuse among the errors of a page.
  browser.quiet = true;
  await page.goto(`${browser.url}/`, { waitUntil: "load" });
  await form(browser);
  await browser.shows("h1", "Sign in");
  assert.equal(await page.evaluate(() => document.activeElement.id), "key", "the field is ready");
  await browser.look("signin");
  await page.type("#key", "gf_wrong");
  await page.keyboard.press("Enter");
  await browser.shows("[role=alert]", "The key is not good");
  await browser.look("signin-refused");
  await page.$eval("#key", (field) => (field.value = ""));
  await page.type("#key", process.env.GRIDFALL_API_KEY);
  await page.keyboard.press("Enter");
  await browser.shows("#session", "people");
  browser.quiet = false;
  await browser.go("#/");
  assert.equal(await page.evaluate(() => document.cookie), "", "no script can read the key");
  await browser.look("signed-in");
}

async function whatIsSignedInCanDoItAll(browser) {
  const { page } = browser;
  await browser.go("#/new");
  await browser.type("#scene", JSON.stringify(block(0.1, "of a key"), null, 2));
  await browser.until("the button", () => !document.querySelector(".judge .primary").disabled);
  await page.click(".judge .primary");
  await browser.shows("h1", "of a key");
  await browser.shows(".badge", "succeeded");
  // Pictures and files are plain links.
  await browser.until("the picture", () =>
    [...document.images].some(({ src, naturalWidth }) => src.includes("thumbnail.png") && naturalWidth > 0),
  );
  const recording = await page.$eval('a[href$="recording.mcap"]', (link) => link.href);
  const read = await page.evaluate(async (href) => (await fetch(href)).status, recording);
  assert.equal(read, 200);
}

async function theReferenceIsShownUnderItsPolicy(browser) {
  await browser.page.goto(`${browser.url}/docs/`, { waitUntil: "load" });
  await browser.page.waitForSelector("#operations-jobs-submit_job");
  await browser.page.screenshot({ path: `${browser.pictures}/reference.png` });
  await browser.page.goto(`${browser.url}/docs/errors`, { waitUntil: "load" });
  const font = await browser.page.$eval("body", (body) => getComputedStyle(body).maxWidth);
  assert.notEqual(font, "none", "its styles are let in");
}

async function peopleSignOut(browser) {
  browser.quiet = true;
  await browser.go("#/");
  await browser.press("Sign out");
  await form(browser);
  await browser.page.goto(`${browser.url}/#/new`, { waitUntil: "load" });
  await form(browser);
  browser.quiet = false;
}

export const all = { peopleSignIn, whatIsSignedInCanDoItAll, theReferenceIsShownUnderItsPolicy, peopleSignOut };
