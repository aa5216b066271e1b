// Warnings: large, and audible after one tap, which browsers ask for.

import { element, setText } from "./format.js";

const KINDS = {
  lift_warning: "Lift ahead",
  lift: "Wheel in the air",
  two_wheel_lift_warning: "ROLLOVER AHEAD",
  two_wheel_lift: "TWO WHEELS IN THE AIR",
};
// Time for which a warning is shown, ms.
const SHOWN_MS = 3000;

let audio = null;
let until = 0;

export function start() {
  const button = element("sound");
  button.addEventListener("click", () => {
    const on = audio === null;
    if (on) {
      audio = new AudioContext();
      tone(660, 0.1);
    } else {
      audio.close();
      audio = null;
    }
    button.setAttribute("aria-pressed", String(on));
    setText(button, on ? "Sound: on" : "Sound: off");
  });
}

function tone(frequency, seconds) {
  if (!audio) return;
  const oscillator = audio.createOscillator();
  const volume = audio.createGain();
  oscillator.frequency.value = frequency;
  volume.gain.value = 0.3;
  oscillator.connect(volume).connect(audio.destination);
  oscillator.start();
  oscillator.stop(audio.currentTime + seconds);
}

export function takeEvents(events) {
  for (const event of events) {
    const kind = typeof event.kind === "string" ? event.kind : Object.keys(event.kind)[0];
    const title = KINDS[kind];
    if (!title) continue;
    until = performance.now() + SHOWN_MS;
    setText(element("warning"), `⚠ ${title}: ${event.text}`);
    tone(kind.startsWith("two_wheel") ? 1320 : 880, 0.25);
  }
  element("warning").hidden = performance.now() > until;
}
