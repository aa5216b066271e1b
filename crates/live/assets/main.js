// The page: passes messages of the server to its parts.

import { Connection } from "./connection.js";
import { element, setText } from "./format.js";
import * as map from "./map.js";
import * as plots from "./plots.js";
import * as recorder from "./recorder.js";
import * as vehicle from "./vehicle.js";
import * as warnings from "./warnings.js";

const EVENTS_MAX = 30;
const DRAW_MS = 200;
let lastNs = 0;
const listed = new Set();

function startScheme() {
  const root = document.documentElement;
  const button = element("scheme");
  const prefersLight = matchMedia("(prefers-color-scheme: light)").matches;
  const set = (scheme) => {
    root.dataset.scheme = scheme;
    localStorage.setItem("scheme", scheme);
    setText(button, scheme === "light" ? "Dark" : "Light");
  };
  set(localStorage.getItem("scheme") ?? (prefersLight ? "light" : "dark"));
  button.addEventListener("click", () => {
    set(root.dataset.scheme === "light" ? "dark" : "light");
    plots.recolour();
  });
}

// Lists events that are not listed yet; the newest is the first.
function listEvents(events) {
  for (const event of events) {
    const key = `${event.time} ${event.text}`;
    if (listed.has(key)) continue;
    listed.add(key);
    const item = document.createElement("li");
    const time = document.createElement("time");
    time.textContent = new Date(event.time / 1e6).toLocaleTimeString("en-GB");
    item.append(time, ` ${event.text}`);
    element("events").prepend(item);
  }
  while (element("events").children.length > EVENTS_MAX) element("events").lastChild.remove();
}

function take(message) {
  if ("topics" in message) plots.list(message.topics);
  else if ("may_write" in message) {
    recorder.show(message);
    // Events from before the page was opened.
    listEvents(message.status?.events ?? []);
  }
  else if ("time_ns" in message) {
    // A replay that begins again: what was shown belongs to another time.
    if (message.time_ns < lastNs) {
      [map, plots, vehicle].forEach((part) => part.forget());
      listed.clear();
      element("events").replaceChildren();
    }
    lastNs = message.time_ns;
    const nowS = message.now_ns / 1e9;
    vehicle.takeEvents(message.events, nowS);
    warnings.takeEvents(message.events);
    listEvents(message.events);
    vehicle.show(message, nowS);
    map.take(message.place);
    plots.take(message.plots);
    if (message.vehicle) setText(element("vehicle"), message.vehicle);
    document.body.dataset.timeNs = message.time_ns;
  }
}

startScheme();
warnings.start();
const connection = new Connection(take, ({ stale, text }) => {
  document.body.dataset.stale = stale ? "yes" : "no";
  setText(element("state"), text);
});
recorder.start(connection);
plots.start(connection);
connection.opened = () => plots.subscribe();
setInterval(() => {
  map.draw();
  plots.draw();
}, DRAW_MS);
