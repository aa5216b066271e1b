// A virtual vehicle, a recorder and its live server, each a process of its own.

import { spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const ATVREC = process.env.ATVREC;
export const TOKEN = "0123456789abcdef0123456789abcdef";

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
  // `live` is a table for the configuration of the live server. Mixed driving ends as it begins, so that
  // the vehicle can drive it again and again.
  static async start({ manoeuvre = "mixed-driving", live = "" } = {}) {
    const vehicle = new Vehicle();
    vehicle.directory = mkdtempSync(join(tmpdir(), "atvrec-browser-"));
    vehicle.processes = [];
    vehicle.ports = join(vehicle.directory, "ports");
    vehicle.config = join(vehicle.ports, "atvrec.toml");
    vehicle.token = join(vehicle.directory, "token");
    writeFileSync(vehicle.token, `${TOKEN}\n`);
    vehicle.run("virtual", "--manoeuvre", manoeuvre, "--repeat", "--directory", vehicle.ports);
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
