// The page of `make thesis` in a real browser. Without the page (make browser alone) the tests are skipped, except
// where ATVREC_REQUIRE_DATA is 1.

import assert from "node:assert/strict";
import { existsSync, statSync } from "node:fs";
import { resolve } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

// The tests run in target/browser.
const PAGE = resolve("../thesis/thesis.html");
const BYTES_MAX = 4e6;
const FIGURES = 38;
// Common area of two texts that still counts as beside each other, px^2: outlines of letters have margins.
const COMMON_PX2 = 8;
const wanted = existsSync(PAGE) || process.env.ATVREC_REQUIRE_DATA === "1";
const skip = wanted ? false : `${PAGE} does not exist: run make thesis first`;

let browser;

before(async () => {
  if (!skip) browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });
});

after(async () => browser?.close());

// Pairs of texts of the same figure that lie on each other, and figures wider than the page.
function faults(common) {
  const found = [];
  for (const svg of document.querySelectorAll("svg")) {
    const name = svg.getAttribute("aria-label");
    const boxes = [...svg.querySelectorAll("text")]
      .map((text) => ({ words: text.textContent.trim(), box: text.getBoundingClientRect() }))
      .filter(({ words }) => words !== "");
    for (const [i, a] of boxes.entries()) {
      for (const b of boxes.slice(i + 1)) {
        const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
        const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
        if (across > 0 && down > 0 && across * down > common) found.push(`${name}: "${a.words}" on "${b.words}"`);
      }
    }
  }
  const { scrollWidth } = document.documentElement;
  if (scrollWidth > innerWidth) found.push(`the page is ${scrollWidth} px wide in a window of ${innerWidth} px`);
  return found;
}

for (const [width, scheme] of [[400, "light"], [400, "dark"], [800, "light"], [1400, "dark"]]) {
  test(`the thesis page at ${width} px, ${scheme}, has no overlap and no request`, { skip }, async () => {
    const context = await browser.newContext({ viewport: { width, height: 1000 }, colorScheme: scheme });
    const page = await context.newPage();
    const problems = [];
    page.on("console", (message) => message.type() === "error" && problems.push(message.text()));
    page.on("pageerror", (error) => problems.push(error.message));
    page.on("request", (request) => request.url().startsWith("file:") || problems.push(request.url()));
    await page.goto(`file://${PAGE}`);
    assert.equal(await page.locator("section").count(), FIGURES);
    assert.deepEqual(await page.evaluate(faults, COMMON_PX2), []);
    assert.deepEqual(problems, []);
    const [ink, paper] = await page.evaluate(() => {
      const { color, backgroundColor } = getComputedStyle(document.body);
      return [color, backgroundColor].map((text) => text.match(/\d+/g).slice(0, 3).reduce((sum, one) => sum + Number(one), 0));
    });
    assert.ok(scheme === "dark" ? ink > paper + 300 : paper > ink + 300, `ink ${ink}, paper ${paper}`);
    await context.close();
  });
}

test("the thesis page is at most 4 MB", { skip }, () => {
  assert.ok(statSync(PAGE).size < BYTES_MAX, `${statSync(PAGE).size} bytes`);
});
