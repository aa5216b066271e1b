// The live page and the Foxglove protocol over TLS, with a certificate that the test makes.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { get as getPlain } from "node:http";
import { get as getTls } from "node:https";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";
import WebSocket from "ws";

import { ATVREC, TOKEN, Vehicle } from "./vehicle.mjs";

let directory;
let vehicle;

const path = (name) => join(directory, name);

function openssl(...args) {
  const { status, stderr } = spawnSync("openssl", args, { encoding: "utf8" });
  assert.equal(status, 0, stderr);
}

function makeCertificate(name) {
  openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
    "-subj", "/CN=vehicle.local", "-addext", "subjectAltName=IP:127.0.0.1",
    "-keyout", path(`${name}.key`), "-out", path(`${name}.pem`));
}

const table = (certificate, key) => `[live]\ncertificate = "${path(certificate)}"\nkey = "${path(key)}"\n`;

before(async () => {
  directory = mkdtempSync(join(tmpdir(), "atvrec-tls-"));
  makeCertificate("vehicle");
  makeCertificate("other");
  vehicle = await Vehicle.start({ live: table("vehicle.pem", "vehicle.key") });
});

after(async () => {
  await vehicle?.stop();
  vehicle?.remove();
  rmSync(directory, { recursive: true, force: true });
});

function answer(get, address, options) {
  return new Promise((resolve, reject) => {
    get(address, options, async (response) => {
      let text = "";
      for await (const part of response) text += part;
      resolve({ status: response.statusCode, text });
    }).on("error", reject);
  });
}

test("a browser shows the page over TLS, and its cookie is sent over TLS only", async () => {
  assert.match(vehicle.live.text, /live page: https:/);
  assert.match(vehicle.live.text, /Lichtblick: wss:/);
  const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox"] });
  const context = await browser.newContext({ ignoreHTTPSErrors: true });
  const page = await context.newPage();
  const errors = [];
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("pageerror", (error) => errors.push(error.message));
  await page.goto(`${vehicle.address}/?token=${TOKEN}`);
  await page.waitForFunction(() => document.body.dataset.stale === "no", null, { timeout: 20000 });
  assert.equal(page.url(), `${vehicle.address}/`);
  await page.fill("#mark-text", "over TLS");
  await page.click("#mark button");
  await page.waitForFunction(() => document.getElementById("answer").textContent.startsWith("Marked"));
  const [cookie] = await context.cookies();
  assert.equal(cookie.secure, true);
  assert.deepEqual(errors, []);
  await browser.close();
});

test("a client that checks the certificate gets the page and the Foxglove protocol", async () => {
  const ca = readFileSync(path("vehicle.pem"));
  const page = await answer(getTls, `${vehicle.address}/`, { ca });
  assert.equal(page.status, 200);
  assert.match(page.text, /<html/);
  await assert.rejects(answer(getTls, `${vehicle.address}/`, { ca: readFileSync(path("other.pem")) }), /certificate/);
  const socket = new WebSocket(`${vehicle.address.replace("http", "ws")}/?token=${TOKEN}`, ["foxglove.sdk.v1"], { ca });
  const first = await new Promise((resolve, reject) => {
    socket.on("message", (data) => resolve(JSON.parse(data)));
    socket.on("error", reject);
  });
  assert.equal(first.op, "serverInfo");
  socket.close();
});

test("a client without TLS gets the hint to use https", async () => {
  const { status, text } = await answer(getPlain, vehicle.address.replace("https", "http"), {});
  assert.equal(status, 400);
  assert.match(text, /this server uses TLS: begin the address with https:/);
  const refused = await new Promise((resolve) => {
    const socket = new WebSocket(vehicle.address.replace("https", "ws"));
    socket.on("unexpected-response", (_, response) => resolve(response.statusCode));
    socket.on("open", () => resolve("open"));
    socket.on("error", (error) => resolve(error.message));
  });
  assert.equal(refused, 400);
});

test("files that are no certificate and its key are refused with the reason", () => {
  writeFileSync(path("empty.pem"), "");
  writeFileSync(path("damaged.key"), readFileSync(path("vehicle.key"), "utf8").replace(/-----END[^]*/, ""));
  openssl("pkey", "-in", path("vehicle.key"), "-aes256", "-passout", "pass:secret", "-out", path("locked.key"));
  for (const [certificate, key, expected] of [
    ["absent.pem", "vehicle.key", /cannot use \S*absent\.pem: No such file/],
    ["vehicle.pem", "absent.key", /cannot use \S*absent\.key: No such file/],
    ["empty.pem", "vehicle.key", /empty\.pem: the file contains no certificate/],
    ["vehicle.key", "vehicle.key", /vehicle\.key: the file contains no certificate/],
    ["vehicle.pem", "vehicle.pem", /vehicle\.pem: the file contains no private key without password/],
    ["vehicle.pem", "locked.key", /locked\.key: the file contains no private key without password/],
    ["vehicle.pem", "damaged.key", /damaged\.key: the file is damaged/],
    ["vehicle.pem", "other.key", /other\.key: the key is not that of the certificate \S*vehicle\.pem/],
  ]) {
    const config = join(vehicle.ports, "wrong.toml");
    writeFileSync(config, `${readFileSync(vehicle.config)}\n${table(certificate, key)}`);
    const { status, stderr } = spawnSync(ATVREC, ["live", "--config", config, "--listen", "127.0.0.1:0"],
      { encoding: "utf8", timeout: 20000 });
    assert.equal(status, 1, `${certificate}, ${key}: ${stderr}`);
    assert.match(stderr, expected);
    assert.match(stderr, /PEM files/);
  }
});
