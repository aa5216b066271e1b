// Path of the vehicle from above.

import { element } from "./format.js";

const POINTS_MAX = 4000;
const SPACING_M = 0.5;
const points = [];
let place = null;

export function take(next) {
  if (!next) return;
  place = next;
  const last = points.at(-1);
  if (last && Math.hypot(next[0] - last[0], next[1] - last[1]) < SPACING_M) return;
  points.push([next[0], next[1]]);
  if (points.length > POINTS_MAX) points.splice(0, points.length - POINTS_MAX);
}

export function forget() {
  points.length = 0;
  place = null;
}

export function draw() {
  const canvas = element("map");
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  if (!place) return;
  const style = getComputedStyle(document.documentElement);
  const all = [...points, place];
  const [xs, ys] = [all.map((p) => p[0]), all.map((p) => p[1])];
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const span = Math.max(right - left, high - low, 10);
  const scale = (Math.min(width, height) - 40) / span;
  const x = (p) => width / 2 + (p[0] - (left + right) / 2) * scale;
  const y = (p) => height / 2 - (p[1] - (low + high) / 2) * scale;
  context.strokeStyle = style.getPropertyValue("--load");
  context.lineWidth = 3;
  context.beginPath();
  all.forEach((p, n) => (n ? context.lineTo(x(p), y(p)) : context.moveTo(x(p), y(p))));
  context.stroke();
  context.save();
  context.translate(x(place), y(place));
  context.rotate(-place[2]);
  context.fillStyle = style.getPropertyValue("--force");
  context.beginPath();
  context.moveTo(12, 0);
  context.lineTo(-8, 7);
  context.lineTo(-8, -7);
  context.fill();
  context.restore();
  const bar = 10 ** Math.floor(Math.log10(span / 2));
  context.fillStyle = style.getPropertyValue("--text");
  context.fillRect(10, height - 12, bar * scale, 3);
  context.font = "14px system-ui, sans-serif";
  context.fillText(`${bar} m`, 10, height - 18);
}
