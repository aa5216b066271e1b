// Tyres from above, motion, and load transfer.

import { degrees, element, number, setText } from "./format.js";

const WHEELS = ["FL", "FR", "RL", "RR"];
const NAMES = ["front left", "front right", "rear left", "rear right"];
// Load of a full bar over the static load, and force of a full arrow over the static load.
const FULL_LOAD = 2;
const FULL_FORCE = 1;
// Warnings are shown for their lead time and this much longer, s.
const WARNING_S = 1;

const tyres = [];
const state = { warnedUntil: [0, 0, 0, 0] };
let motionRows = null;

const wheelIndex = (name) => ["front_left", "front_right", "rear_left", "rear_right"].indexOf(name);

function makeTyre(name, long) {
  const node = document.createElement("div");
  node.className = "tyre";
  node.dataset.wheel = name;
  node.innerHTML = `
    <header><span>${name}</span><span class="flag"></span></header>
    <div class="view">
      <div class="bar" role="img"><i></i><b></b></div>
      <svg viewBox="-50 -48 100 96" role="img" aria-label="horizontal force, ${long}">
        <g class="wheel"><rect class="rim" x="-11" y="-24" width="22" height="48" rx="6"></rect></g>
        <line class="force" x1="0" y1="0" x2="0" y2="0"></line><polygon class="head" points=""></polygon>
      </svg>
    </div>
    <p class="load"></p><p class="sigma"></p><p class="sides"></p>`;
  element("tyres").append(node);
  const part = (selector) => node.querySelector(selector);
  return {
    node, flag: part(".flag"), fill: part(".bar i"), bar: part(".bar"), load: part(".load"),
    sigma: part(".sigma"), sides: part(".sides"), wheel: part(".wheel"), line: part("line"),
    head: part("polygon"), long,
  };
}

// An arrow in the picture: vehicle x is up, vehicle y is left.
function drawArrow(tyre, x, y, fullN) {
  const known = x !== null && y !== null;
  const scale = 40 / fullN;
  let [dx, dy] = known ? [-y * scale, -x * scale] : [0, 0];
  const length = Math.hypot(dx, dy);
  if (length > 44) [dx, dy] = [dx * 44 / length, dy * 44 / length];
  tyre.line.setAttribute("x2", dx.toFixed(1));
  tyre.line.setAttribute("y2", dy.toFixed(1));
  const size = Math.hypot(dx, dy);
  if (size < 3) {
    tyre.head.setAttribute("points", "");
    return;
  }
  const [ux, uy] = [dx / size * 6, dy / size * 6];
  const corners = [[dx + ux, dy + uy], [dx - uy, dy + ux], [dx + uy, dy - ux]];
  tyre.head.setAttribute("points", corners.map((p) => p.map((v) => v.toFixed(1)).join(",")).join(" "));
}

export function takeEvents(events, nowS) {
  for (const event of events) {
    const [kind, value] = typeof event.kind === "string" ? [event.kind, null] : Object.entries(event.kind)[0];
    if (kind === "lift_warning") state.warnedUntil[wheelIndex(value[0])] = nowS + value[1] + WARNING_S;
  }
}

export function forget() {
  state.warnedUntil.fill(0);
}

export function show(values, nowS) {
  if (tyres.length === 0) WHEELS.forEach((name, n) => tyres.push(makeTyre(name, NAMES[n])));
  const carrier = values.carrier ?? [];
  const loads = WHEELS.map((_, n) => carrier[n]?.force_n[2] ?? null);
  const known = loads.filter((load) => load !== null);
  const mean = known.reduce((sum, load) => sum + load, 0) / Math.max(known.length, 1);
  tyres.forEach((tyre, n) => {
    const force = carrier[n];
    const [x, y, z] = force?.force_n ?? [null, null, null];
    const fixed = values.static_load_n?.[n] ?? Math.max(mean, 1);
    const part = z === null ? 0 : Math.min(Math.max(z / (FULL_LOAD * fixed), 0), 1);
    tyre.fill.style.height = `${(100 * part).toFixed(1)}%`;
    tyre.bar.setAttribute("aria-label", `load ${tyre.long}: ${number(z)} N`);
    setText(tyre.load, `${number(z)} N`);
    setText(tyre.sigma, `± ${number(force?.sigma_n[2])} N`);
    setText(tyre.sides, `x ${number(x)}, y ${number(y)}`);
    const steer = values.motion?.steer_rad?.[n] ?? 0;
    tyre.wheel.setAttribute("transform", `rotate(${(-steer * 180 / Math.PI).toFixed(1)})`);
    drawArrow(tyre, x, y, FULL_FORCE * fixed);
    const warned = state.warnedUntil[n] > nowS;
    // By the value and not by the event, which a page that was opened later has not received.
    const lifted = values.rollover?.time_to_lift_s[n] === 0;
    tyre.node.dataset.lifted = lifted ? "yes" : "no";
    tyre.node.dataset.warned = warned ? "yes" : "no";
    setText(tyre.flag, lifted ? "▲ in the air" : warned ? "! will lift" : "");
  });
  showMotion(values);
  showTransfer(values.rollover);
}

// A limit and its lower bound, or the bound alone.
function limit(found, text, decimals, unit) {
  const known = (value) => value !== null && value !== undefined;
  const least = known(found?.at_least) ? `at least ${text(found.at_least, decimals)} ${unit}` : "–";
  return known(found?.value) ? `${text(found.value, decimals)}, ${least}` : least;
}

// The class of ground that is named, with its probability; the most probable one where none is.
function ground(terrain) {
  if (!terrain) return "–";
  const names = ["asphalt", "gravel", "loam", "sand", "unknown"];
  const most = terrain.probability.reduce((best, p, k, all) => p > all[best] ? k : best, 0);
  const likely = `${names[most]} ${number(100 * terrain.probability[most])} %`;
  return terrain.class === names[most] ? likely : `unknown (${likely})`;
}

function spread(value, sigma) {
  return value === null || value === undefined ? "–" : `${number(value, 2)} ± ${number(sigma, 2)}`;
}

function showMotion(values) {
  const { motion, rollover, parameters, limits, terrain, next_lift: next } = values;
  const lift = next ? `${WHEELS[wheelIndex(next.wheel)]} in ${number(next.time_s, 1)} s` : rollover ? "none near" : "–";
  const grip = (axle) => parameters
    ? `${number(100 * axle.utilisation)} ± ${number(100 * axle.utilisation_sigma)} %` : "–";
  const least = (axle) => parameters && axle.friction_min !== null
    ? `at least ${number(axle.friction_min, 2)}` : "–";
  const rows = [
    ["Speed", `${number(motion?.velocity_x_m_s, 1)} m/s`],
    ["Roll", `${degrees(motion?.roll_rad)}°`],
    ["Pitch", `${degrees(motion?.pitch_rad)}°`],
    ["Load-transfer ratio", `${number(rollover?.load_transfer_ratio, 2)} ± ${number(rollover?.load_transfer_ratio_sigma, 2)}`],
    ["Lifts next", lift],
    ["Friction used, front", grip(parameters?.front)],
    ["Friction used, rear", grip(parameters?.rear)],
    ["Grip, front", least(parameters?.front)],
    ["Grip, rear", least(parameters?.rear)],
    ["Lateral acceleration left", limit(limits?.lateral_m_s2, number, 1, "m/s²")],
    ["Largest speed in this turn", limit(limits?.speed_m_s, number, 1, "m/s")],
    ["Largest speed in the set curve", limit(limits?.curve_speed_m_s, number, 1, "m/s")],
    ["Steepest side slope", limit(limits?.side_slope_rad, degrees, 0, "°")],
    ["Steepest grade", limit(limits?.grade_rad, degrees, 0, "°")],
    ["Limits", limits ? limits.reason ?? "known" : "–"],
    ["Ground", ground(terrain)],
    ["Rolling resistance", spread(terrain?.rolling_resistance, terrain?.rolling_resistance_sigma)],
  ];
  if (!motionRows) {
    motionRows = rows.map(([name]) => {
      const term = document.createElement("dt");
      term.textContent = name;
      const value = document.createElement("dd");
      element("motion").append(term, value);
      return value;
    });
  }
  rows.forEach(([, text], n) => setText(motionRows[n], text));
}

// 1: both left wheels off the ground, drawn towards the side that lifts.
function showTransfer(rollover) {
  const ratio = Math.min(Math.max(rollover?.load_transfer_ratio ?? 0, -1), 1);
  const fill = document.querySelector("#ltr i");
  fill.style.left = `${50 - 50 * Math.max(ratio, 0)}%`;
  fill.style.width = `${50 * Math.abs(ratio)}%`;
}
