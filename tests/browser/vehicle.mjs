// A virtual vehicle, a recorder and its live server, each a process of its own.

import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const ATVREC = process.env.ATVREC;
export const TOKEN = "0123456789abcdef0123456789abcdef";

// Longer than the tests take.
const DRIVE_S = "1800";
// Part of the messages of a source that may be too late to be used, percent.
const TOO_LATE_PERCENT = 0.5;

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

async function until(condition, text, seconds = 60) {
  const end = Date.now() + 1000 * seconds;
  while (!condition()) {
    if (Date.now() > end) throw new Error(text);
    await pause(50);
  }
}

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  return port;
}

export class Vehicle {
  // `live` is a table for the configuration of the live server.
  static async start({ live = "" } = {}) {
    const vehicle = new Vehicle();
    vehicle.directory = mkdtempSync(join(tmpdir(), "atvrec-browser-"));
    vehicle.processes = [];
    vehicle.ports = join(vehicle.directory, "ports");
    vehicle.config = join(vehicle.ports, "atvrec.toml");
    vehicle.token = join(vehicle.directory, "token");
    writeFileSync(vehicle.token, `${TOKEN}\n`);
    vehicle.run("virtual", "--manoeuvre", "mixed-driving", "--for", DRIVE_S, "--directory", vehicle.ports);
    await until(() => existsSync(vehicle.config), "the virtual vehicle made no ports");
    vehicle.liveConfig = join(vehicle.ports, "live.toml");
    writeFileSync(vehicle.liveConfig, `${readFileSync(vehicle.config)}\n${live}`);
    const recorder = vehicle.run("record", "--config", vehicle.config);
    await until(() => recorder.text.includes("opened the control socket"), "the recorder did not start");
    await pause(1000);
    vehicle.port = await freePort();
    vehicle.address = `${live.includes("certificate") ? "https" : "http"}://127.0.0.1:${vehicle.port}`;
    vehicle.live = vehicle.startLive();
    await until(() => vehicle.live.text.includes("live page"), "the server did not start");
    await pause(500);
    return vehicle;
  }

  startLive() {
    return this.run("live", "--config", this.liveConfig, "--listen", `127.0.0.1:${this.port}`,
      "--token-file", this.token);
  }

  run(...args) {
    const child = spawn(ATVREC, args, { cwd: this.directory, stdio: ["ignore", "pipe", "pipe"] });
    child.text = "";
    for (const stream of [child.stdout, child.stderr]) {
      stream.on("data", (data) => { child.text += data; });
    }
    this.processes.push(child);
    return child;
  }

  status() {
    const { stdout } = spawnSync(ATVREC, ["status", "--json", "--config", this.config], { encoding: "utf8" });
    return JSON.parse(stdout);
  }

  // Logs of the recorder, after its end.
  logs() {
    const directory = join(this.ports, "logs");
    return readdirSync(directory).filter((name) => name.endsWith(".mcap")).sort().map((name) => join(directory, name));
  }

  // Whether the machine is so busy that many messages come too late to be used: the estimator lacks them,
  // and can then exclude good sensors (docs/estimator.md).
  isOverloaded() {
    const shares = this.status().sources.filter(({ items }) => items > 0)
      .map(({ name, items, too_late: late }) => [name, 100 * late / items]);
    const overloaded = shares.filter(([, percent]) => percent > TOO_LATE_PERCENT);
    for (const [name, percent] of overloaded) {
      console.log(`the machine is overloaded: ${percent.toFixed(1)} % of ${name} came too late; faults are not judged`);
    }
    return overloaded.length > 0;
  }

  // Faults of sensors and restarts of filters in the logs: the vehicle has none, whatever is done to the
  // processes.
  faults() {
    const events = this.logs().flatMap((log) => {
      const { stdout, stderr, status } = spawnSync(ATVREC, ["events", "--json", log], { encoding: "utf8" });
      if (status !== 0) throw new Error(stderr);
      return JSON.parse(stdout).events;
    });
    return events.filter(({ kind }) => /fault|recovered|reset/.test(kind)).map(({ at_s: at, text }) => `${at} s: ${text}`);
  }

  // Ends everything; the logs stay until `remove`.
  async stop() {
    for (const child of this.processes.reverse()) {
      if (child.exitCode !== null || child.signalCode !== null) continue;
      child.kill("SIGTERM");
      await Promise.race([once(child, "exit"), pause(15000)]);
      child.kill("SIGKILL");
    }
  }

  remove() {
    rmSync(this.directory, { recursive: true, force: true });
  }
}
