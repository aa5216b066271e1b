// Pictures of the live page and of the report for the documentation. Look at them before they are committed.

import { spawnSync } from "node:child_process";
import { join } from "node:path";
import { chromium } from "playwright-core";

import { ATVREC, TOKEN, Vehicle, pause } from "./vehicle.mjs";

const docs = process.argv[2];
const vehicle = await Vehicle.start();
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
  await report(vehicle.directory);
} finally {
  await browser.close();
  await vehicle.stop();
  vehicle.remove();
}

// The forces of a trail: the figure with bands, truth and error, below the verdict.
async function report(directory) {
  for (const args of [["simulate", "--manoeuvre", "trail", "--for", "25", "-o", "trail.mcap"],
    ["report", "trail.mcap", "-o", "trail.html"]]) {
    const { status, stderr } = spawnSync(ATVREC, ["--quiet", ...args], { cwd: directory, encoding: "utf8" });
    if (status !== 0) throw new Error(stderr);
  }
  const context = await browser.newContext({ viewport: { width: 1300, height: 1150 }, colorScheme: "light" });
  const page = await context.newPage();
  await page.goto(`file://${join(directory, "trail.html")}`);
  await page.waitForFunction(() => document.body.dataset.ready === "yes");
  // The tables are as long as the picture; they are left out of it.
  await page.addStyleTag({ content: "#wheels, #wheels ~ .wide, #wheels + .caption, #vehicle, #lacking, nav { display: none; }" });
  await pause(1000);
  await page.mouse.move(400, 420);
  await pause(500);
  await page.screenshot({ path: join(docs, "report.png") });
  await context.close();
}
