// A headless Chromium, and what every test needs of it.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import puppeteer from "puppeteer-core";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const PATIENCE = 30_000;

export const DESKTOP = { width: 1280, height: 800 };
export const PHONE = { width: 360, height: 740 };

export class Browser {
  /** What went wrong in pages, in their own words. */
  errors = [];
  quiet = false;

  static async open(url, pictures) {
    const made = Object.assign(new Browser(), { url, pictures });
    // Drawn in software, like all else here. Without a sandbox, because containers run as root.
    made.browser = await puppeteer.launch({
      executablePath: process.env.CHROMIUM,
      args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
    });
    made.page = await made.browser.newPage();
    made.page.setDefaultTimeout(PATIENCE);
    // Chromium counts refused scenes among the errors of a page.
    const note = (text) => made.quiet || text.includes("status of 422") || made.errors.push(text);
    made.page.on(
      "console",
      (message) => message.type() === "error" && note(`${message.text()} ${message.location().url}`),
    );
    made.page.on("pageerror", (error) => note(error.stack ?? error.message));
    await made.page.setViewport(DESKTOP);
    return made;
  }

  /** Goes to a view. */
  async go(hash) {
    const { page } = this;
    // A new document, so that no state of the last view is left.
    await page.goto("about:blank");
    await page.goto(`${this.url}/${hash}`, { waitUntil: "load" });
    await page.waitForSelector("main h1");
  }

  /** The API, without the browser. */
  async api(method, path, body) {
    const headers = { "content-type": "application/json" };
    const answer = await fetch(`${this.url}${path}`, { method, headers, body: body && JSON.stringify(body) });
    assert.ok(answer.ok, `${method} ${path}: ${answer.status} ${await answer.clone().text()}`);
    return answer.status === 204 ? null : answer.json();
  }

  text(selector) {
    return this.page.$eval(selector, (element) => element.textContent);
  }

  /** Waits until the page holds what is wanted, and says what it had instead. */
  async until(what, wanted, ...given) {
    try {
      return await this.page.waitForFunction(wanted, { polling: 50 }, ...given);
    } catch (error) {
      const main = await this.page.$eval("main", (element) => element.innerText);
      throw new Error(`${what} never came (${error.message}); the page says:\n${main}`);
    }
  }

  shows(selector, part) {
    const wanted = (selector, part) =>
      [...document.querySelectorAll(selector)].some((element) => element.textContent.includes(part));
    return this.until(`${selector} with “${part}”`, wanted, selector, part);
  }

  /** Clicks on what has a name. */
  async press(name, within = "body") {
    const found = await this.page.waitForSelector(`${within} ::-p-aria([name="${name}"])`);
    await found.click();
  }

  async type(selector, text) {
    await this.page.$eval(
      selector,
      (element, text) => {
        element.value = text;
        element.dispatchEvent(new Event("input", { bubbles: true }));
      },
      text,
    );
  }

  /** How many pixels of a canvas are painted, and a sum that tells pictures apart. */
  painted(selector) {
    return this.page.$eval(selector, (canvas) => {
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const context = copy.getContext("2d");
      context.drawImage(canvas, 0, 0);
      const { data } = context.getImageData(0, 0, copy.width, copy.height);
      let [painted, sum] = [0, 0];
      const colors = new Set();
      for (let at = 0; at < data.length; at += 4) {
        if (data[at + 3] < 128) continue;
        painted += 1;
        sum = (sum * 31 + data[at] + 7 * data[at + 1] + 13 * data[at + 2] + at) % 1_000_000_007;
        if (colors.size < 1000) colors.add((data[at] << 16) | (data[at + 1] << 8) | data[at + 2]);
      }
      return { share: painted / (data.length / 4), sum, colors: colors.size };
    });
  }

  /** Looks at a view in both schemes and on a phone: no serious finding of axe, nothing beside the page, pictures. */
  async look(name) {
    const { page } = this;
    await page.evaluate(() => scrollTo(0, 0));
    for (const scheme of ["light", "dark"]) {
      await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
      await page.evaluate(AXE);
      const findings = await page.evaluate(async () => {
        const { violations } = await window.axe.run(document, { resultTypes: ["violations"] });
        const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
        return serious.flatMap(({ id, nodes }) =>
          nodes.map(({ html, failureSummary }) => `${id}: ${html}\n${failureSummary}`),
        );
      });
      assert.deepEqual(findings, [], `${name}, ${scheme}`);
      await page.screenshot({ path: `${this.pictures}/${name}-${scheme}.png`, fullPage: true });
    }
    await page.setViewport(PHONE);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(wide <= PHONE.width, `${name} is ${wide} pixels wide on a phone`);
    await new Promise((resolve) => setTimeout(resolve, 300));
    await page.screenshot({ path: `${this.pictures}/${name}-phone.png`, fullPage: true });
    await page.setViewport(DESKTOP);
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }]);
  }
}
