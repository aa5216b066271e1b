// Tyres, uncertainty and a wheel in the air on the page, against the values of the log that is played.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

import { ATVREC, pause } from "./vehicle.mjs";

const WHEELS = ["fl", "fr", "rl", "rr"];
const DRIVE_S = 52;
// The left front wheel leaves the ground after 45.8 s by the estimate.
const DRIVE = ["simulate", "--manoeuvre", "circle", "--for", String(DRIVE_S), "-o", "drive.mcap"];
const ON_THE_GROUND_S = 20;
const BEFORE_THE_LIFT_S = 45;
const IN_THE_AIR_S = 50;
// Length of an arrow for a force as large as the static load, in units of the picture; longest arrow.
const ARROW = 40;
const ARROW_MAX = 44;
// Rounding of a text, of a length in the picture, and of a bar in percent of its height (a pixel of 92).
const [TEXT_N, ARROW_ERROR, BAR_PERCENT] = [0.51, 0.06, 1.2];

let directory;
let replay;
let browser;
let page;
let errors;
let staticLoad;

function run(...args) {
  const { status, stderr } = spawnSync(ATVREC, ["--quiet", ...args], { cwd: directory, encoding: "utf8" });
  assert.equal(status, 0, stderr);
}

const tables = new Map();

// Rows of a topic of the log, as objects.
function rows(topic) {
  if (!tables.has(topic)) tables.set(topic, read(topic));
  return tables.get(topic);
}

function read(topic) {
  const file = `${topic.split("/").pop()}.csv`;
  run("export", "drive.mcap", "--topic", topic, "-o", file);
  const [head, ...lines] = readFileSync(join(directory, file), "utf8").trim().split("\n");
  const names = head.split(",");
  return lines.map((line) => Object.fromEntries(line.split(",").map((value, n) => [names[n], value])));
}

// The row of an instant; numbers of JavaScript hold nanoseconds since 1970 to 256 ns.
function rowAt(table, timeNs) {
  const row = table.find((candidate) => Math.abs(Number(candidate.log_time_ns) - timeNs) < 1000);
  assert.ok(row, `the log has no estimate at ${timeNs} ns`);
  return row;
}

before(async () => {
  directory = mkdtempSync(join(tmpdir(), "atvrec-replay-"));
  run(...DRIVE);
  replay = spawn(ATVREC, ["replay", "drive.mcap", "--live", "--listen", "127.0.0.1:0"],
    { cwd: directory, stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((resolve) => {
    let text = "";
    replay.stdout.on("data", (data) => {
      text += data;
      const found = text.match(/live page: (\S+)/);
      if (found) resolve(found[1]);
    });
  });
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });
  page = await browser.newPage({ viewport: { width: 1400, height: 1000 } });
  errors = [];
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("websocket", (socket) => socket.on("framereceived", ({ payload }) => {
    staticLoad = JSON.parse(payload).static_load_n ?? staticLoad;
  }));
  await page.addInitScript(() => {
    const start = OscillatorNode.prototype.start;
    globalThis.tones = 0;
    OscillatorNode.prototype.start = function count(...args) {
      globalThis.tones += 1;
      return start.apply(this, args);
    };
  });
  await page.goto(address);
  await page.waitForFunction(() => document.body.dataset.timeNs > 0);
});

after(async () => {
  await browser?.close();
  replay?.kill("SIGKILL");
  rmSync(directory, { recursive: true, force: true });
});

async function playFrom(seconds, firstNs) {
  if (await page.textContent("#play") !== "Pause") await page.click("#play");
  await page.waitForFunction(() => document.getElementById("play").textContent === "Pause");
  await page.locator("#position").fill(String(Math.round(1000 * seconds / DRIVE_S)));
  const reached = (time) => page.waitForFunction(
    (ns) => document.body.dataset.timeNs >= ns, firstNs + 1e9 * time, { timeout: 120000 });
  await reached(seconds - 0.1);
  return reached;
}

// Plays from a position for the time in which parameters come, pauses, and returns what the page shows.
async function shownAt(seconds, firstNs) {
  const reached = await playFrom(seconds, firstNs);
  await reached(seconds + 1.2);
  await page.click("#play");
  await page.waitForFunction(() => document.getElementById("play").textContent === "Play");
  await pause(1000);
  return page.evaluate(() => ({
    timeNs: Number(document.body.dataset.timeNs),
    stale: document.body.dataset.stale,
    state: document.getElementById("state").textContent,
    motion: Object.fromEntries([...document.querySelectorAll("#motion dt")]
      .map((term) => [term.textContent, term.nextElementSibling.textContent])),
    tyres: [...document.querySelectorAll(".tyre")].map((tyre) => {
      const text = (selector) => tyre.querySelector(selector).textContent;
      const bar = tyre.querySelector(".bar");
      const line = tyre.querySelector("line");
      return {
        load: text(".load"), sigma: text(".sigma"), sides: text(".sides"), flag: text(".flag"),
        lifted: tyre.dataset.lifted,
        label: bar.getAttribute("aria-label"),
        barPercent: 100 * tyre.querySelector(".bar i").getBoundingClientRect().height / bar.clientHeight,
        arrow: [line.x2.baseVal.value, line.y2.baseVal.value],
        headed: tyre.querySelector("polygon").getAttribute("points") !== "",
        turn: tyre.querySelector(".wheel").transform.baseVal[0].angle,
      };
    }),
  }));
}

const number = (text) => Number(text.match(/-?\d+(\.\d+)?/)[0]);
const near = (found, expected, error, what) =>
  assert.ok(Math.abs(found - expected) <= error, `${what}: ${found} instead of ${expected}`);

function compare(shown) {
  const forces = rowAt(rows("/estimate/tyre_forces"), shown.timeNs);
  const motion = rowAt(rows("/estimate/motion"), shown.timeNs);
  const rollover = rowAt(rows("/estimate/rollover"), shown.timeNs);
  WHEELS.forEach((wheel, n) => {
    const tyre = shown.tyres[n];
    const [x, y, z, sigma] = ["x_n", "y_n", "z_n", "z_sigma_n"].map((field) => Number(forces[`${wheel}.${field}`]));
    near(number(tyre.load), z, TEXT_N, `${wheel} load`);
    assert.match(tyre.load, / N$/);
    near(number(tyre.label), z, TEXT_N, `${wheel} load for a screen reader`);
    assert.match(tyre.sigma, /^± \d+ N$/);
    near(number(tyre.sigma), sigma, TEXT_N, `${wheel} standard deviation`);
    const [, shownX, shownY] = tyre.sides.match(/x (-?\d+), y (-?\d+)/);
    near(Number(shownX), x, TEXT_N, `${wheel} x`);
    near(Number(shownY), y, TEXT_N, `${wheel} y`);
    // The bar is full at twice the static load.
    near(tyre.barPercent, Math.min(Math.max(50 * z / staticLoad[n], 0), 100), BAR_PERCENT, `${wheel} bar`);
    // Forward is up, and left is left.
    const full = Math.min(1, ARROW_MAX / Math.hypot(ARROW * x / staticLoad[n], ARROW * y / staticLoad[n]));
    near(tyre.arrow[0], -full * ARROW * y / staticLoad[n], ARROW_ERROR, `${wheel} arrow to the right`);
    near(tyre.arrow[1], -full * ARROW * x / staticLoad[n], ARROW_ERROR, `${wheel} arrow down`);
    assert.equal(tyre.headed, Math.hypot(...tyre.arrow) >= 3, `${wheel} head of the arrow`);
    near(tyre.turn, -Number(motion[`${wheel}.steer_rad`]) * 180 / Math.PI, ARROW_ERROR, `${wheel} steer angle`);
    assert.equal(tyre.lifted, Number(rollover[`${wheel}.time_to_lift_s`]) === 0 ? "yes" : "no", wheel);
  });
  near(number(shown.motion.Speed), Number(motion.velocity_x_m_s), 0.051, "speed");
  const [, ratio, sigma] = shown.motion["Load-transfer ratio"].match(/^(-?[\d.]+) ± ([\d.]+)$/);
  near(Number(ratio), Number(rollover.load_transfer_ratio), 0.0051, "load-transfer ratio");
  near(Number(sigma), Number(rollover.load_transfer_ratio_sigma), 0.0051, "its standard deviation");
  const parameters = rows("/estimate/parameters").findLast((row) => Number(row.log_time_ns) <= shown.timeNs);
  for (const axle of ["front", "rear"]) {
    const [, used, deviation] = shown.motion[`Friction used, ${axle}`].match(/^(\d+) ± (\d+) %$/);
    near(Number(used), 100 * parameters[`${axle}.utilisation`], TEXT_N, `friction used, ${axle}`);
    near(Number(deviation), 100 * parameters[`${axle}.utilisation_sigma`], TEXT_N, "its standard deviation");
    near(number(shown.motion[`Grip, ${axle}`]), Number(parameters[`${axle}.friction_min`]), 0.0051, `grip, ${axle}`);
  }
}

test("bars, arrows and texts are the values of the log", async () => {
  const firstNs = Number(rows("/estimate/motion")[0].log_time_ns);
  const shown = await shownAt(ON_THE_GROUND_S, firstNs);
  assert.equal(shown.stale, "no");
  assert.equal(shown.state, "Paused");
  assert.equal(shown.tyres.length, 4);
  assert.deepEqual(shown.tyres.map(({ lifted }) => lifted), ["no", "no", "no", "no"]);
  compare(shown);
});

test("a lift is shown large, listed with its time, and audible after a tap", async () => {
  const firstNs = Number(rows("/estimate/motion")[0].log_time_ns);
  await page.click("#sound");
  const tones = await page.evaluate(() => globalThis.tones);
  assert.equal(tones, 1, "the tap makes a sound");
  await playFrom(BEFORE_THE_LIFT_S, firstNs);
  await page.waitForFunction(() => /Wheel in the air: .*FL/.test(document.getElementById("warning").textContent));
  const warning = await page.evaluate(() => {
    const node = document.getElementById("warning");
    return { shown: node.checkVisibility(), px: parseFloat(getComputedStyle(node).fontSize), tones: globalThis.tones };
  });
  assert.ok(warning.shown && warning.px >= 24, JSON.stringify(warning));
  assert.ok(warning.tones > tones, `${warning.tones} tones`);
  assert.match(await page.textContent("#events li"), /^\d\d:\d\d:\d\d .*the FL wheel is off the ground/);
});

test("a wheel in the air is shown after a jump in the log", async () => {
  const firstNs = Number(rows("/estimate/motion")[0].log_time_ns);
  const shown = await shownAt(IN_THE_AIR_S, firstNs);
  compare(shown);
  assert.deepEqual(shown.tyres.map(({ lifted }) => lifted), ["yes", "no", "no", "no"]);
  assert.match(shown.tyres[0].flag, /in the air/);
  assert.deepEqual(shown.tyres.slice(1).map(({ flag }) => flag.includes("in the air")), [false, false, false]);
  assert.ok(shown.tyres[0].barPercent < 10, `${shown.tyres[0].barPercent} %`);
  assert.deepEqual(errors, []);
});
