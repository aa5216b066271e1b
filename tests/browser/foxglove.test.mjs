// Foxglove's own client, and what slow or wrong clients do to the recorder.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { after, before, test } from "node:test";
import foxglove from "@foxglove/ws-protocol";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor/index.js";
import WebSocket from "ws";

import { TOKEN, Vehicle, pause } from "./vehicle.mjs";

// Topics that have messages on occasions only.
const RARE = new Set(["/estimate/events", "/log", "/mark", "/utc_offset"]);
const { FoxgloveClient } = foxglove;
// `make test-all` sets 60 s.
const STALL_S = Number(process.env.STALL_S ?? 10);

let vehicle;

before(async () => {
  vehicle = await Vehicle.start();
});

after(async () => {
  await vehicle?.stop();
  vehicle?.remove();
});

async function connect(address = vehicle.address, token = TOKEN, options = {}) {
  const socket = new WebSocket(`${address.replace("http", "ws")}/?token=${token}`, ["foxglove.sdk.v1"], options);
  // The client knows the earlier name of the same protocol alone.
  Object.defineProperty(socket, "protocol", { get: () => FoxgloveClient.SUPPORTED_SUBPROTOCOL });
  const client = new FoxgloveClient({ ws: socket });
  const events = { channels: new Map(), messages: new Map(), status: [], parameters: [] };
  client.on("advertise", (channels) => channels.forEach((channel) => events.channels.set(channel.id, channel)));
  client.on("unadvertise", (ids) => ids.forEach((id) => events.channels.delete(id)));
  client.on("status", (status) => events.status.push(status.message));
  client.on("parameterValues", ({ parameters }) => events.parameters.push(...parameters));
  events.services = new Promise((resolve) => client.on("advertiseServices", resolve));
  events.info = await new Promise((resolve) => client.on("serverInfo", resolve));
  return { client, events, socket };
}

function decoder(channel) {
  assert.equal(channel.encoding, "protobuf");
  const bytes = Buffer.from(channel.schema, "base64");
  return protobuf.Root.fromDescriptor(bytes).lookupType(channel.schemaName);
}

async function until(condition, text, seconds = 20) {
  const end = Date.now() + 1000 * seconds;
  while (!condition()) {
    assert.ok(Date.now() < end, text());
    await pause(50);
  }
}

test("a client gets decoded messages of every topic, and only of those it subscribed to", async () => {
  const { client, events } = await connect();
  assert.equal(events.info.name, "atvrec");
  await until(() => events.channels.size > 20, () => `${events.channels.size} channels`);
  await pause(1500);
  const byId = new Map();
  for (const channel of events.channels.values()) {
    byId.set(client.subscribe(channel.id), { channel, type: decoder(channel), count: 0 });
  }
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const entry = byId.get(subscriptionId);
    entry.last = entry.type.toObject(entry.type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength)));
    entry.time = timestamp;
    entry.count += 1;
  });
  const missing = () => [...byId.values()].filter(({ channel, count }) => count === 0 && !RARE.has(channel.topic));
  await until(() => missing().length === 0, () => `no message of ${missing().map((e) => e.channel.topic)}`);
  const topic = (name) => [...byId.values()].find(({ channel }) => channel.topic === name);
  assert.ok(topic("/estimate/tyre_forces").last.wheels[0].zN > 100);
  assert.equal(topic("/tf").last.transforms.length, 5);
  assert.ok(topic("/scene").last.entities.some((entity) => entity.arrows?.length > 0));
  assert.ok(Math.abs(Number(topic("/tf").time / 1000000n) - Date.now()) < 5000, "log time is UTC");

  for (const id of byId.keys()) client.unsubscribe(id);
  await pause(500);
  const counts = [...byId.values()].map(({ count }) => count);
  await pause(500);
  assert.deepEqual([...byId.values()].map(({ count }) => count), counts, "nothing after the end");
  client.close();
});

test("marks are a service, parameters are read-only, and a mark that is too long is refused", async () => {
  const { client, events } = await connect();
  const [service] = await events.services;
  assert.equal(service.name, "/mark");
  const call = (text) => new Promise((resolve) => {
    const respond = (response) => resolve(JSON.parse(new TextDecoder().decode(response.data)));
    client.on("serviceCallResponse", respond);
    client.on("serviceCallFailure", (failure) => resolve(failure));
    const data = new TextEncoder().encode(JSON.stringify({ text }));
    client.sendServiceCallRequest({ serviceId: service.id, callId: 7, encoding: "json", data: new DataView(data.buffer) });
  });
  assert.ok((await call("mark of Foxglove")).time_ns > 0);
  const failure = await call("x".repeat(1 << 20));
  assert.match(failure.message, /1048576 characters; the limit is 1000/);
  client.getParameters([], "first");
  await until(() => events.parameters.length >= 3, () => "no parameters");
  assert.match(events.parameters.find(({ name }) => name === "configuration").value, /\[source\.imu\]/);
  client.setParameters([{ name: "vehicle", value: "other" }], "second");
  await until(() => events.status.includes("parameters are read-only"), () => `${events.status}`);
  client.close();
});

test("a wrong token, another subprotocol and a flood of clients are refused", async () => {
  const refused = (address, protocols) => new Promise((resolve) => {
    const socket = new WebSocket(address, protocols);
    socket.on("unexpected-response", (_, response) => resolve(response.statusCode));
    socket.on("open", () => resolve("open"));
    socket.on("error", () => resolve("closed"));
  });
  const address = `${vehicle.address.replace("http", "ws")}/`;
  assert.equal(await refused(`${address}?token=wrong`, ["foxglove.sdk.v1"]), 401);
  assert.equal(await refused(address, ["other.v9"]), 400);
  const sockets = [];
  for (let n = 0; n < 100; n += 1) sockets.push(new WebSocket(address, ["foxglove.sdk.v1"]));
  const results = await Promise.all(sockets.map((socket) => new Promise((resolve) => {
    socket.on("open", () => resolve("open"));
    socket.on("unexpected-response", (_, response) => resolve(response.statusCode));
    socket.on("error", () => resolve("closed"));
  })));
  const open = results.filter((result) => result === "open").length;
  assert.ok(open > 0 && open <= 16, `${open} of 100 are open`);
  sockets.forEach((socket) => socket.terminate());
  await pause(1000);
  (await connect()).client.close();
  assert.deepEqual(lostOf(vehicle.status()), []);
});

const lostOf = (status) => Object.entries(status.lost).filter(([, count]) => count > 0);

// The recorder went on in the time between two states.
function assertWentOn(before, after) {
  assert.deepEqual(lostOf(after), []);
  const seconds = (after.now_ns - before.now_ns) / 1e9;
  for (const source of after.sources.filter(({ name }) => name !== "recorder")) {
    const earlier = before.sources.find(({ name }) => name === source.name);
    const rate = (source.items - earlier.items) / seconds;
    assert.ok(source.age_s < 1 && rate > 0, `${source.name}: ${rate} items/s`);
  }
  assert.ok(after.estimate.time - before.estimate.time > 0.95e9 * seconds, "estimates went on");
  assert.equal(after.disk.waiting < 4000, true, `${after.disk.waiting} wait for the disk`);
}

test(`a client that is stopped for ${STALL_S} s costs neither the recorder nor other clients anything`, async () => {
  const address = `${vehicle.address.replace("http", "ws")}/?token=${TOKEN}`;
  const reader = spawn(process.execPath, ["reader.mjs", address], { stdio: ["ignore", "pipe", "inherit"] });
  let read = "";
  reader.stdout.on("data", (data) => { read += data; });
  await until(() => read.includes("reads"), () => "the client did not start");
  const { client, events } = await connect();
  await until(() => events.channels.size > 20, () => "no channels");
  const forces = [...events.channels.values()].find(({ topic }) => topic === "/estimate/tyre_forces");
  let count = 0;
  client.subscribe(forces.id);
  client.on("message", () => { count += 1; });
  await pause(500);
  const before = vehicle.status();
  reader.kill("SIGSTOP");
  const begun = count;
  await pause(1000 * STALL_S);
  const after = vehicle.status();
  assert.ok(count - begun > 50 * STALL_S, `${count - begun} messages for the other client`);
  assertWentOn(before, after);
  assert.equal(after.tap.lost, before.tap.lost, "the live process went on");
  reader.kill("SIGCONT");
  // A client that neither reads nor answers for 30 s is dropped.
  if (STALL_S >= 45) await until(() => read.includes("closed"), () => "the stopped client was not dropped");
  reader.kill("SIGKILL");
  client.close();
});

test(`a live process that is stopped for ${STALL_S} s costs the recorder nothing`, async () => {
  const { client, events } = await connect();
  await until(() => events.channels.size > 20, () => "no channels");
  for (const id of events.channels.keys()) client.subscribe(id);
  await pause(1000);
  const before = vehicle.status();
  vehicle.live.kill("SIGSTOP");
  await pause(1000 * STALL_S);
  const after = vehicle.status();
  vehicle.live.kill("SIGCONT");
  assertWentOn(before, after);
  if (STALL_S >= 20) assert.ok(after.tap.lost > 0, "records for the stopped process are dropped and counted");
  client.close();
});

test("late data is no fault", async () => {
  const driver = vehicle.processes[0];
  for (let n = 0; n < 12; n += 1) {
    driver.kill("SIGSTOP");
    await pause(n % 2 ? 36 : 53);
    driver.kill("SIGCONT");
    await pause(700);
  }
  if (vehicle.isOverloaded()) return;
  const { events, faulty_sensors: faulty } = vehicle.status();
  assert.deepEqual(events.filter(({ kind }) => kind.sensor_fault).map(({ text }) => text), []);
  assert.deepEqual(faulty, []);
});

test("a log is played with pause, position and speed", async () => {
  const isOverloaded = vehicle.isOverloaded();
  await vehicle.stop();
  if (!isOverloaded) assert.deepEqual(vehicle.faults(), [], "no fault in the whole recording");
  const replay = vehicle.run("replay", vehicle.logs()[0], "--live", "--rate", "1",
    "--listen", `127.0.0.1:${vehicle.port}`);
  await until(() => replay.text.includes("live page"), () => replay.text);
  const socket = new WebSocket(`ws://127.0.0.1:${vehicle.port}/ws`);
  const seen = [];
  socket.on("message", (data) => {
    const message = JSON.parse(data);
    if ("time_ns" in message) seen.push(message);
    else if ("may_write" in message) seen.playback = message.playback;
  });
  const send = (message) => socket.send(JSON.stringify({ playback: message }));
  await until(() => seen.at(-1)?.time_ns > 0 && seen.playback, () => "no estimates");
  const { first_ns: first, last_ns: last } = seen.playback;
  send({ play: false, speed: 1, seek_ns: null });
  await pause(700);
  const paused = seen.at(-1).time_ns;
  await pause(700);
  assert.equal(seen.at(-1).time_ns, paused, "paused");
  send({ play: true, speed: 1, seek_ns: Math.round((first + last) / 2) });
  await until(() => seen.at(-1).time_ns >= (first + last) / 2, () => "the position was not reached", 60);
  assert.ok(seen.at(-1).time_ns < (first + last) / 2 + 8e9);
  send({ play: true, speed: 4, seek_ns: first });
  await until(() => seen.at(-1).time_ns < (first + last) / 2, () => "it did not go back", 60);
  const [begin, began] = [seen.at(-1).time_ns, Date.now()];
  await pause(2000);
  const speed = (seen.at(-1).time_ns - begin) / 1e6 / (Date.now() - began);
  assert.ok(speed > 2 && speed < 6, `speed ${speed}`);
  socket.close();
});
