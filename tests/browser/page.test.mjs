// The live page in a real browser.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

import { ATVREC, TOKEN, Vehicle, pause } from "./vehicle.mjs";

// The target is 200 ms; a loaded machine gets ten times as much.
const SHOWN_WITHIN_MS = 2000;
const STALE_WITHIN_MS = 1000;
const TEXT_CONTRAST = 7;
const BAR_CONTRAST = 3;
const TEXT_PX = 14;

let vehicle;
let browser;

before(async () => {
  vehicle = await Vehicle.start();
  browser = await chromium.launch({
    executablePath: process.env.CHROMIUM,
    args: ["--no-sandbox", "--autoplay-policy=user-gesture-required"],
  });
});

after(async () => {
  await browser?.close();
  await vehicle?.stop();
  vehicle?.remove();
});

// A page that shows estimates; errors and requests are noted.
async function open({ width = 1400, height = 1000, scheme = "dark", token = TOKEN } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: scheme });
  const page = await context.newPage();
  const errors = [];
  const hosts = new Set();
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("request", (request) => hosts.add(new URL(request.url()).host));
  await page.goto(`${vehicle.address}/${token ? `?token=${token}` : ""}`);
  await page.waitForFunction(() => document.body.dataset.stale === "no", null, { timeout: 20000 });
  return { context, page, errors, hosts };
}

test("the page shows estimates, asks no other host and has no errors", async () => {
  const { context, page, errors, hosts } = await open();
  assert.equal(page.url(), `${vehicle.address}/`, "the token left the address");
  await pause(3000);
  const load = await page.locator(".tyre .load").first().textContent();
  assert.match(load, /^\d+ N$/);
  for (const text of ["Speed", "Load-transfer ratio", "Grip, front", "Friction used, rear"]) {
    assert.ok(await page.locator("#motion").getByText(text, { exact: true }).isVisible(), text);
  }
  assert.match(await page.locator("#motion").textContent(), /at least \d/);
  assert.match(await page.locator("#sources").textContent(), /imu\d+\/s/);
  assert.match(await page.locator("#recording").textContent(), /● recording for/);
  assert.match(await page.locator("#disk").textContent(), /disk: /);
  if (!vehicle.isOverloaded()) assert.deepEqual(await page.locator("#problems li").allTextContents(), []);
  assert.ok(await page.locator(".chart canvas").count() >= 2, "plots");
  assert.ok(await page.locator("#topic option").count() > 5, "topics to choose");
  assert.deepEqual(errors, []);
  assert.deepEqual([...hosts], [new URL(vehicle.address).host]);
  await context.close();
});

test("a load is shown soon after its estimate", async () => {
  const { context, page } = await open();
  const ages = await page.evaluate(async () => {
    const found = [];
    let last = document.body.dataset.timeNs;
    while (found.length < 60) {
      await new Promise(requestAnimationFrame);
      const now = document.body.dataset.timeNs;
      if (now !== last) found.push(Date.now() - Number(now) / 1e6);
      last = now;
    }
    return found.sort((a, b) => a - b);
  });
  const median = ages[ages.length / 2];
  console.log(`shown ${median.toFixed(0)} ms after the estimate (median), ${ages.at(-1).toFixed(0)} ms at most`);
  assert.ok(median > 0 && median < SHOWN_WITHIN_MS, `${median} ms`);
  await context.close();
});

test("no texts intersect, texts are large enough and have contrast", async () => {
  for (const scheme of ["dark", "light"]) {
    for (const width of [400, 800, 1400]) {
      const { context, page } = await open({ width, scheme });
      await page.evaluate(() => {
        const warning = document.getElementById("warning");
        warning.textContent = "⚠ ROLLOVER AHEAD: both right wheels lift in 0.4 s";
        warning.hidden = false;
      });
      const where = `${width} px, ${scheme}`;
      const found = await page.evaluate(examine);
      assert.deepEqual(found.intersecting, [], where);
      assert.deepEqual(found.small.filter(([, px]) => px < TEXT_PX), [], where);
      assert.deepEqual(found.text.filter(([, contrast]) => contrast < TEXT_CONTRAST), [], where);
      assert.deepEqual(found.bars.filter(([, contrast]) => contrast < BAR_CONTRAST), [], where);
      assert.ok(found.wide <= width, `${where}: the page is ${found.wide} px wide`);
      await context.close();
    }
  }
});

// Runs in the page: boxes of texts that intersect, sizes, contrasts.
function examine() {
  const colour = (text) => {
    const [r, g, b, a = 1] = text.match(/[\d.]+/g).map(Number);
    return { r, g, b, a };
  };
  const luminance = ({ r, g, b }) => {
    const linear = [r, g, b].map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const contrast = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (element) => {
    for (let node = element; node; node = node.parentElement) {
      const back = colour(getComputedStyle(node).backgroundColor);
      if (back.a > 0) return back;
    }
    return { r: 255, g: 255, b: 255 };
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const boxes = [];
  const [small, text] = [[], []];
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const parent = node.parentElement;
    if (!node.textContent.trim() || !parent.checkVisibility() || parent.closest("select")) continue;
    const style = getComputedStyle(parent);
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) boxes.push({ box, text: node.textContent.trim() });
    small.push([node.textContent.trim(), parseFloat(style.fontSize)]);
    text.push([node.textContent.trim(), contrast(colour(style.color), behind(parent))]);
  }
  const intersecting = [];
  boxes.forEach((a, n) => boxes.slice(n + 1).forEach((b) => {
    const x = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
    const y = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
    // Lines of one paragraph touch each other.
    if (x > 1 && y > 3) intersecting.push([a.text, b.text]);
  }));
  const bars = [...document.querySelectorAll(".bar i, #ltr i")].map((bar) =>
    [bar.className, contrast(colour(getComputedStyle(bar).backgroundColor), behind(bar.parentElement))]);
  return { intersecting, small, text, bars, wide: document.documentElement.scrollWidth };
}

test("a mark of the page is in the log, and needs the token", async () => {
  const { context, page, errors } = await open();
  await page.fill("#mark-text", "gravel from the page");
  await page.click("#mark button");
  await page.waitForFunction(() => document.getElementById("answer").textContent.startsWith("Marked"));
  assert.deepEqual(errors, []);
  await context.close();

  const reader = await open({ token: null });
  assert.ok(await reader.page.locator("#mark button").isDisabled());
  const answer = await reader.page.evaluate(async () => {
    const response = await fetch("api/mark", { method: "POST", body: '{"text":"no"}' });
    return [response.status, await response.text()];
  });
  assert.equal(answer[0], 403);
  assert.match(answer[1], /token/);
  await reader.context.close();
});

test("a page of another server cannot connect", async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.route("http://other.example/", (route) =>
    route.fulfill({ contentType: "text/html", body: "<p>other</p>" }));
  await page.goto("http://other.example/");
  const opened = await page.evaluate((address) => new Promise((resolve) => {
    const socket = new WebSocket(`${address.replace("http", "ws")}/ws`);
    socket.onopen = () => resolve("open");
    socket.onerror = () => resolve("refused");
  }), vehicle.address);
  assert.equal(opened, "refused");
  await context.close();
});

test("sound starts with a tap, and start and stop work", async () => {
  const { context, page, errors } = await open();
  await page.click("#sound");
  assert.equal(await page.textContent("#sound"), "Sound: on");
  await page.click("#stop");
  await page.waitForFunction(() => document.getElementById("recording").textContent.includes("stopped"));
  assert.equal(await page.getAttribute("body", "data-stale"), "no", "the view goes on");
  await page.click("#start");
  await page.waitForFunction(() => document.getElementById("recording").textContent.includes("recording"));
  assert.deepEqual(errors, []);
  await context.close();
});

test("the page shows within 1 s that it is stale, and connects again", async () => {
  const { context, page } = await open();
  vehicle.live.kill("SIGSTOP");
  const begin = Date.now();
  await page.waitForFunction(() => document.body.dataset.stale === "yes");
  const took = Date.now() - begin;
  assert.ok(took <= STALE_WITHIN_MS + 200, `${took} ms`);
  vehicle.live.kill("SIGCONT");
  await page.waitForFunction(() => document.body.dataset.stale === "no", null, { timeout: 15000 });
  vehicle.live.kill("SIGKILL");
  await page.waitForFunction(() => document.body.dataset.stale === "yes");
  vehicle.live = vehicle.startLive();
  await page.waitForFunction(() => document.body.dataset.stale === "no", null, { timeout: 20000 });
  await context.close();
});

test("the recording is complete and has the mark; the token is in no message; no sensor is faulty", async () => {
  const { page, context } = await open();
  await page.waitForFunction(() => document.querySelector("#sources td"));
  const isOverloaded = vehicle.isOverloaded();
  if (!isOverloaded) assert.deepEqual(await page.locator("#problems li").allTextContents(), []);
  await context.close();
  const { lost } = vehicle.status();
  assert.deepEqual(Object.entries(lost).filter(([, count]) => count > 0), []);
  await vehicle.stop();
  for (const child of vehicle.processes) assert.ok(!child.text.includes(TOKEN), child.spawnargs.join(" "));
  if (!isOverloaded) assert.deepEqual(vehicle.faults(), []);
  const marks = vehicle.logs().map((file) =>
    spawnSync(ATVREC, ["export", file, "--topic", "/mark"], { encoding: "utf8", cwd: vehicle.directory }).stdout);
  assert.match(marks.join(""), /gravel from the page/);
});
