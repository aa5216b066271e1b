// State of the recorder, marks, start and stop, and the controls of a replay.

import { duration, element, number, setText, size } from "./format.js";

const NO_TOKEN = "Marks, start and stop need the token: open this page once with ?token=TOKEN behind its address.";
let mayWrite = false;
let connection = null;
let playback = null;
let dragging = false;

async function post(path, body) {
  const answer = element("answer");
  setText(answer, "sending");
  try {
    const response = await fetch(path, { method: "POST", body: JSON.stringify(body) });
    const text = await response.text();
    let value;
    try {
      value = JSON.parse(text);
    } catch {
      value = { error: text };
    }
    return value;
  } catch (error) {
    return { error: `the server cannot be reached: ${error.message}` };
  }
}

export function start(link) {
  connection = link;
  element("mark").addEventListener("submit", async (event) => {
    event.preventDefault();
    const field = element("mark-text");
    const text = field.value.trim() || "mark";
    const value = await post("api/mark", { text });
    if (!value.error) field.value = "";
    setText(element("answer"), value.error ?? `Marked: ${text}`);
  });
  for (const command of ["start", "stop"]) {
    element(command).addEventListener("click", async () => {
      const value = await post(`api/${command}`, {});
      setText(element("answer"), value.error ?? `The recorder is ${value.writing}.`);
    });
  }
  const send = (play, seek = null) => connection.send({
    playback: { play, speed: Number(element("speed").value), seek_ns: seek },
  });
  element("play").addEventListener("click", () => send(!playback?.playing));
  element("speed").addEventListener("change", () => send(playback?.playing ?? true));
  const position = element("position");
  position.addEventListener("input", () => { dragging = true; });
  position.addEventListener("change", () => {
    dragging = false;
    const range = playback.last_ns - playback.first_ns;
    send(playback.playing, Math.round(playback.first_ns + range * position.value / 1000));
  });
}

export function show(message) {
  mayWrite = message.may_write;
  playback = message.playback;
  const { status } = message;
  const isReplay = playback !== null;
  element("playback").hidden = !isReplay;
  for (const id of ["start", "stop", "mark-text"]) element(id).disabled = !mayWrite || isReplay;
  element("mark").querySelector("button").disabled = !mayWrite || isReplay;
  if (!mayWrite && !isReplay) setText(element("answer"), NO_TOKEN);
  if (isReplay) {
    showPlayback();
    setText(element("recording"), "A log is played");
    setText(element("disk"), "");
    return;
  }
  if (!status || status.error) {
    setText(element("recording"), status?.error ?? "");
    return;
  }
  const since = status.since_s === null ? "" : ` for ${duration(status.since_s)}`;
  const mark = status.writing.startsWith("recording") ? "●" : "■";
  setText(element("recording"), `${mark} ${status.writing}${since}`);
  const lasts = status.disk.lasts_s === null ? "rate unknown" : `${number(status.disk.lasts_s / 3600, 1)} h left`;
  setText(element("disk"), `${size(status.disk.bytes)} written to ${status.directory}; disk: ${lasts}`);
  showSources(status);
}

function showPlayback() {
  const seconds = (ns) => (ns - playback.first_ns) / 1e9;
  setText(element("play"), playback.ended ? "Again" : playback.playing ? "Pause" : "Play");
  const part = (playback.time_ns - playback.first_ns) / Math.max(playback.last_ns - playback.first_ns, 1);
  if (!dragging) element("position").value = Math.round(1000 * part);
  setText(element("position-text"), `${number(seconds(playback.time_ns), 1)} of ${number(seconds(playback.last_ns), 1)} s`);
}

function showSources(status) {
  const body = element("sources").tBodies[0];
  const sources = status.sources.filter((source) => source.name !== "recorder");
  while (body.rows.length > sources.length) body.deleteRow(-1);
  sources.forEach((source, n) => {
    const row = body.rows[n] ?? body.insertRow();
    while (row.cells.length < 4) row.insertCell();
    const late = source.age_s === null || source.age_s > 1;
    const state = !source.open ? "✕ closed" : late ? "! silent" : "✓ open";
    [source.name, `${number(source.rate_hz)}/s`, duration(source.age_s), state]
      .forEach((text, cell) => setText(row.cells[cell], text));
  });
  const lost = Object.entries(status.lost).filter(([, count]) => count > 0);
  const texts = [
    ...status.faulty_sensors.map((name) => `excluded by the estimator: ${name}`),
    ...lost.map(([place, count]) => `${count} lost: ${place}`),
  ];
  const list = element("problems");
  const shown = texts.join("\n");
  if (list.dataset.shown !== shown) {
    list.dataset.shown = shown;
    list.replaceChildren(...texts.map((text) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }));
  }
}
