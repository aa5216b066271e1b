// The report in a real browser: of a simulated drive, and of a passenger car for an hour.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

import { ATVREC } from "./vehicle.mjs";
import { car } from "./car.mjs";

// The target is 200 ms; a loaded machine gets ten times as much.
const ZOOMED_WITHIN_MS = 2000;
const HOUR_S = 3600;

let directory;
let browser;

function run(...args) {
  const done = spawnSync(ATVREC, ["--quiet", ...args], { cwd: directory, encoding: "utf8" });
  assert.equal(done.status, 0, done.stderr);
  return done.stdout;
}

before(async () => {
  directory = mkdtempSync(join(tmpdir(), "atvrec-report-"));
  run("simulate", "--manoeuvre", "step-steer", "--for", "8", "-o", "drive.mcap");
  run("report", "drive.mcap", "-o", "drive.html");
  car(directory, "hour", HOUR_S);
  run("import", "csv", "hour.csv", "--columns", "map.toml", "--vehicle", "car.toml", "-o", "hour.mcap");
  run("report", "hour.mcap", "-o", "hour.html");
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });
});

after(async () => {
  await browser?.close();
  if (directory) rmSync(directory, { recursive: true, force: true });
});

async function open(name, { width = 1400, scheme = "light" } = {}) {
  const context = await browser.newContext({ viewport: { width, height: 1000 }, colorScheme: scheme });
  const page = await context.newPage();
  const errors = [];
  const requests = [];
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("request", (request) => /^(https?|wss?|ftp):/.test(request.url()) && requests.push(request.url()));
  await page.goto(`file://${join(directory, name)}`);
  await page.waitForFunction(() => document.body.dataset.ready === "yes", null, { timeout: 60000 });
  return { context, page, errors, requests };
}

// Scrolls through the page, so that all figures are drawn.
async function see(page) {
  const height = await page.evaluate(() => document.documentElement.scrollHeight);
  for (let y = 0; y < height; y += 700) {
    await page.evaluate((top) => scrollTo(0, top), y);
    await page.waitForTimeout(60);
  }
}

test("a drive is shown without an error and without a request", async () => {
  const { context, page, errors, requests } = await open("drive.html");
  await see(page);
  assert.ok(await page.locator(".uplot canvas").count() > 20, "figures over time");
  assert.match(await page.textContent("#verdict"), /^Recording complete, no loss; /);
  for (const id of ["lateral", "friction-circles", "gg", "handling", "track", "travel", "innovations"]) {
    assert.equal(await page.locator(`#${id}`).count(), 1, id);
  }
  assert.deepEqual(errors, []);
  assert.deepEqual(requests, []);
  await context.close();
});

test("no two texts intersect, and the page is not wider than the window", async () => {
  for (const scheme of ["light", "dark"]) {
    for (const width of [400, 800, 1400]) {
      const { context, page } = await open("drive.html", { width, scheme });
      await see(page);
      const found = await page.evaluate(intersections);
      assert.deepEqual(found.intersecting, [], `${width} px, ${scheme}`);
      assert.ok(found.wide <= width, `${scheme}: the page is ${found.wide} px wide, the window ${width} px`);
      await context.close();
    }
  }
});

// Runs in the page.
function intersections() {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const boxes = [];
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const parent = node.parentElement;
    // What scrolls sideways in its own box, and the line at the end of the window, cover other texts on purpose.
    if (!node.textContent.trim() || !parent.checkVisibility() || parent.closest("select, script, .wide, #now, pre")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) boxes.push({ box, text: node.textContent.trim().slice(0, 40) });
  }
  boxes.sort((a, b) => a.box.top - b.box.top);
  const intersecting = [];
  boxes.forEach((a, n) => {
    for (let k = n + 1; k < boxes.length && boxes[k].box.top < a.box.bottom; k++) {
      const b = boxes[k];
      const x = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const y = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      // Lines of one paragraph touch each other.
      if (x > 1 && y > 4) intersecting.push([a.text, b.text]);
    }
  });
  return { intersecting, wide: document.documentElement.scrollWidth };
}

test("an hour of a passenger car has no empty figure, and zooms to single samples", async () => {
  const { context, page, errors } = await open("hour.html");
  await see(page);
  assert.equal(await page.locator("#sideslip").count(), 1);
  assert.equal(await page.locator("#axle-forces").count(), 1);
  assert.equal(await page.locator("#travel").count(), 0, "a car without potentiometers has no travel");
  assert.match(await page.textContent("#lacking"), /Suspension travel/);
  await page.locator("#sideslip-plot .u-over").first().scrollIntoViewIfNeeded();
  await page.waitForTimeout(500);
  let took = 0;
  // Each drag shows a fiftieth of what was shown: an hour becomes some milliseconds.
  for (let n = 0; n < 4; n++) {
    const box = await page.locator("#sideslip-plot .u-over").first().boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + 40];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + box.width / 50, y, { steps: 3 });
    await page.evaluate(() => {
      document.body.dataset.begin = performance.now();
      document.body.dataset.range = "";
    });
    await page.mouse.up();
    await page.waitForFunction(() => document.body.dataset.range);
    took = Math.max(took, await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() =>
      requestAnimationFrame(() => resolve(performance.now() - document.body.dataset.begin))))));
  }
  console.log(`zoomed from an hour to single samples in ${took.toFixed(0)} ms`);
  assert.ok(took < ZOOMED_WITHIN_MS, `${took} ms`);
  const shown = await page.evaluate(() => document.body.dataset.range?.split(" ").map(Number));
  assert.ok(shown && shown[1] - shown[0] < HOUR_S / 1000, `shows ${shown}`);
  assert.deepEqual(errors, []);
  await context.close();
});

test("laps, a picture of the ground and the distance as abscissa are shown without an error", async () => {
  // A red picture of one pixel, and its world file in degrees around the end of the drive.
  const blank = await browser.newPage();
  const pixel = await blank.evaluate(() => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [1, 1];
    const ctx = canvas.getContext("2d");
    ctx.fillStyle = "#f00";
    ctx.fillRect(0, 0, 1, 1);
    return canvas.toDataURL("image/png").split(",")[1];
  });
  await blank.close();
  const rows = run("export", "drive.mcap", "--topic", "/gnss/novatel/position").trim().split("\n").map((row) => row.split(","));
  const column = (name) => rows[0].findIndex((head) => head.startsWith(name));
  const [latitude, longitude] = ["latitude_rad", "longitude_rad"].map((name) => rows.at(-1)[column(name)] * 180 / Math.PI);
  writeFileSync(join(directory, "ground.png"), Buffer.from(pixel, "base64"));
  writeFileSync(join(directory, "ground.pgw"), `0.01\n0\n0\n-0.01\n${longitude}\n${latitude}\n`);
  run("report", "drive.mcap", "-o", "laps.html", "--gate", `${latitude},${longitude}`, "--axis", "distance", "--map", "ground.png");
  const { context, page, errors, requests } = await open("laps.html");
  await see(page);
  assert.equal(await page.locator("#laps").count(), 1);
  assert.equal(await page.inputValue("#axis"), "distance");
  await page.locator("#track-plot canvas").scrollIntoViewIfNeeded();
  await page.waitForTimeout(200);
  const painted = await page.evaluate(() => {
    const canvas = document.querySelector("#track-plot canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let red = 0;
    for (let n = 0; n < data.length; n += 4) red += data[n] === 255 && data[n + 1] === 0 && data[n + 3] === 255;
    return red / (canvas.width * canvas.height);
  });
  assert.ok(painted > 0.3, `${painted} of the map is painted`);
  assert.deepEqual(errors, []);
  assert.deepEqual(requests, []);
  await context.close();
});

// Fills an MBTiles file with tiles of two colours, in a pattern as that of a chess board, at the zoom levels 17 to 19
// around a place. Python has SQLite.
const TILES = `
import base64, math, sqlite3, sys
path, latitude, longitude, green, blue = sys.argv[1], *map(float, sys.argv[2:4]), *sys.argv[4:6]
base = sqlite3.connect(path)
base.execute("CREATE TABLE metadata (name text, value text)")
base.execute("INSERT INTO metadata VALUES ('format', 'png')")
base.execute("CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob)")
for zoom in range(17, 20):
    column = int((longitude + 180) / 360 * 2 ** zoom)
    row = int((1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2 * 2 ** zoom)
    for x in range(column - 8, column + 9):
        for y in range(row - 8, row + 9):
            tile = base64.b64decode(green if (x + y) % 2 else blue)
            base.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (zoom, x, 2 ** zoom - 1 - y, tile))
base.commit()
`;

test("tiles of an MBTiles file are drawn below the track without gaps", async () => {
  const blank = await browser.newPage();
  const [green, blue] = await blank.evaluate(() => ["#0f0", "#00f"].map((colour) => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [256, 256];
    const ctx = canvas.getContext("2d");
    ctx.fillStyle = colour;
    ctx.fillRect(0, 0, 256, 256);
    return canvas.toDataURL("image/png").split(",")[1];
  }));
  await blank.close();
  const rows = run("export", "drive.mcap", "--topic", "/gnss/novatel/position").trim().split("\n").map((row) => row.split(","));
  const column = (name) => rows[0].findIndex((head) => head.startsWith(name));
  const [latitude, longitude] = ["latitude_rad", "longitude_rad"].map((name) => rows.at(-1)[column(name)] * 180 / Math.PI);
  const made = spawnSync("python3", ["-c", TILES, join(directory, "map.mbtiles"), latitude, longitude, green, blue], { encoding: "utf8" });
  assert.equal(made.status, 0, made.stderr);
  run("report", "drive.mcap", "-o", "tiles.html", "--tiles", "map.mbtiles");
  const bytes = (name) => statSync(join(directory, name)).size;
  assert.ok(bytes("tiles.html") - bytes("drive.html") < 600e3, `${bytes("tiles.html")} bytes`);
  const { context, page, errors, requests } = await open("tiles.html");
  await see(page);
  await page.locator("#track-plot canvas").scrollIntoViewIfNeeded();
  await page.waitForTimeout(200);
  const [painted, mixed] = await page.evaluate(() => {
    const canvas = document.querySelector("#track-plot canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const pixels = canvas.width * canvas.height;
    const has = (n, channel) => data[4 * n + channel] > 250 && data[4 * n] < 5;
    let [green, blue] = [0, 0];
    for (let n = 0; n < pixels; n++) {
      green += has(n, 1) && !has(n, 2);
      blue += has(n, 2) && !has(n, 1);
    }
    return [(green + blue) / pixels, Math.min(green, blue) / Math.max(green, blue)];
  });
  if (process.env.PICTURES) await page.locator("#track-plot").screenshot({ path: join(process.env.PICTURES, "tiles.png") });
  assert.ok(painted > 0.5, `${painted} of the map is painted`);
  assert.ok(mixed > 0.2, `tiles of both colours are seen: ${mixed}`);
  assert.deepEqual(errors, []);
  assert.deepEqual(requests, []);
  await context.close();
});

// Sheet and height above its lower edge of each heading of the printed page, in points. With the outline, the file
// states them in plain text.
async function printed(page, paper) {
  const file = (await page.pdf({ ...paper, outline: true, tagged: true, margin: { top: "15mm", bottom: "15mm" } })).toString("latin1");
  const places = file.matchAll(/\/Dest \[(\d+) 0 R\s*\/XYZ\s+([\d.]+)\s+([\d.]+)/g);
  return [...places].map(([, sheet, , y]) => [+sheet, +y]);
}

test("no heading of the printed page is the last thing on its sheet", async () => {
  // The lower margin of 15 mm, a heading, and a line below it, in points.
  const LOWEST = 42.5 + 21.6 + 12.4;
  const { context, page } = await open("drive.html");
  const orphans = async () => {
    const found = [];
    for (const paper of [{ format: "A4" }, { format: "Letter" }, { format: "A5" }, { format: "A4", landscape: true }]) {
      const places = await printed(page, paper);
      assert.ok(places.length > 15, `${places.length} headings`);
      found.push(...places.filter(([, y]) => y < LOWEST));
    }
    return found;
  };
  assert.deepEqual(await orphans(), []);
  // Without the style, headings are orphaned: the test can see them.
  await page.addStyleTag({ content: "section, h2, h3, .caption { break-inside: auto !important; break-after: auto !important }" });
  assert.ok((await orphans()).length > 0);
  await context.close();
});
