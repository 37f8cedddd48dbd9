// What people do with the dashboard, in the order of a first day.

import { Browser } from "./browser.mjs";
import * as steps from "./steps.mjs";

const [url, pictures] = process.argv.slice(2);
const browser = await Browser.open(url, pictures);
const started = performance.now();
try {
  for (const [name, step] of Object.entries(steps.all)) {
    await step(browser);
    if (browser.errors.length) throw new Error(`the page had errors:\n${browser.errors.join("\n")}`);
    console.log(`${name} (${((performance.now() - started) / 1000).toFixed(1)} s)`);
  }
} catch (error) {
  await browser.page.screenshot({ path: `${pictures}/failed.png`, fullPage: true }).catch(() => {});
  throw error;
} finally {
  await browser.browser.close();
}
