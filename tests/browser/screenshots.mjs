// Pictures of the live page for the documentation. Look at them before they are committed.

import { join } from "node:path";
import { chromium } from "playwright-core";

import { TOKEN, Vehicle, pause } from "./vehicle.mjs";

const docs = process.argv[2];
const vehicle = await Vehicle.start("mixed-driving");
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });
try {
  for (const [name, width, height, colorScheme] of [["live", 1400, 1330, "dark"], ["live-phone", 400, 900, "light"]]) {
    const context = await browser.newContext({ viewport: { width, height }, colorScheme });
    const page = await context.newPage();
    await page.goto(`${vehicle.address}/?token=${TOKEN}`);
    await page.waitForFunction(() => document.body.dataset.stale === "no");
    await pause(20000);
    await page.screenshot({ path: join(docs, `${name}.png`) });
    await context.close();
  }
} finally {
  await browser.close();
  await vehicle.stop();
  vehicle.remove();
}
