// What people do with the dashboard, in the order of a first day.

import { Browser } from "./browser.mjs";
import * as colliders from "./colliders.mjs";
import * as files from "./files.mjs";
import * as keyboard from "./keyboard.mjs";
import * as keys from "./keys.mjs";
import * as steps from "./steps.mjs";
import * as sweeps from "./sweeps.mjs";

// The names of steps limit what is done to these; most of them need no others.
const [url, pictures, ...chosen] = process.argv.slice(2);
const all = { ...steps.all, ...colliders.all, ...sweeps.all, ...files.all, ...keyboard.all, ...steps.last };
// Steps of `keys` and of `colliders.old` are for other servers: one that asks for keys, and one whose recordings were
// made those of an old release.
const wanted = Object.entries(chosen.length ? { ...all, ...keys.all, ...colliders.old } : all).filter(
  ([name]) => !chosen.length || chosen.includes(name),
);
const browser = await Browser.open(url, pictures);
const started = performance.now();
try {
  for (const [name, step] of wanted) {
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
