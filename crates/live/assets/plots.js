// Plots of chosen signals over the last 60 s.

import uPlot from "./uplot/uPlot.esm.js";
import { element } from "./format.js";

const SPAN_S = 60;
const HEIGHT = 180;
const PLOTS_MAX = 8;
// Width of a plot with half of the ticks, px.
const NARROW = 480;
// Colours are not the only difference: each plot has one curve and its name.
const FIRST = [["/estimate/tyre_forces", "fl.z_n"], ["/estimate/motion", "velocity_x_m_s"]];

const charts = [];
let topics = {};
let connection = null;

export function start(link) {
  connection = link;
  const stored = JSON.parse(localStorage.getItem("plots") ?? "null");
  (stored ?? FIRST).forEach(([topic, field]) => add(topic, field));
  element("topic").addEventListener("change", listFields);
  element("add").addEventListener("click", () => {
    const [topic, field] = [element("topic").value, element("field").value];
    if (topic && field && charts.length < PLOTS_MAX) {
      add(topic, field);
      store();
    }
  });
  new ResizeObserver(() => charts.forEach((chart) => fit(chart))).observe(element("charts"));
}

function store() {
  localStorage.setItem("plots", JSON.stringify(charts.map(({ topic, field }) => [topic, field])));
  subscribe();
}

export function subscribe() {
  connection.send({ plot: charts.map(({ topic, field }) => [topic, field]) });
}

export function list(next) {
  topics = next;
  const select = element("topic");
  const chosen = select.value;
  select.replaceChildren(...Object.keys(topics).map((name) => new Option(name, name)));
  if (chosen in topics) select.value = chosen;
  listFields();
}

function listFields() {
  const select = element("field");
  const chosen = select.value;
  const fields = topics[element("topic").value] ?? [];
  select.replaceChildren(...fields.map((name) => new Option(name, name)));
  if (fields.includes(chosen)) select.value = chosen;
}

// Ticks at whole tens of seconds before now.
function splits(chart, _, __, high) {
  const step = chart.width < NARROW ? 20 : 10;
  return Array.from({ length: SPAN_S / step + 1 }, (___, n) => high - SPAN_S + n * step);
}

function options(width) {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour("--text"), grid: { stroke: colour("--line"), width: 0.5 }, font: "14px system-ui, sans-serif" };
  return {
    width, height: HEIGHT, legend: { show: false }, cursor: { show: false },
    scales: { x: { time: false, range: (_, low, high) => [high - SPAN_S, high] } },
    axes: [{ ...axis, splits, values: (chart, ticks) => ticks.map((t) => `${Math.round(t - chart.scales.x.max)} s`) },
      { ...axis, size: 70 }],
    series: [{}, { stroke: colour("--load"), width: 2 }],
  };
}

function add(topic, field) {
  const node = document.createElement("div");
  node.className = "chart";
  const head = document.createElement("header");
  const title = document.createElement("h3");
  title.textContent = `${topic} ${field}`;
  const remove = document.createElement("button");
  remove.textContent = "Remove";
  remove.setAttribute("aria-label", `Remove the plot of ${topic} ${field}`);
  head.append(title, remove);
  node.append(head);
  element("charts").append(node);
  const chart = { topic, field, node, times: [], values: [], plot: null };
  charts.push(chart);
  build(chart);
  remove.addEventListener("click", () => {
    charts.splice(charts.indexOf(chart), 1);
    chart.plot.destroy();
    node.remove();
    store();
  });
}

function build(chart) {
  chart.plot?.destroy();
  const width = widthOf(chart);
  chart.plot = new uPlot(options(width), [chart.times, chart.values], chart.node);
}

const widthOf = (chart) => Math.max(chart.node.clientWidth, 200);

function fit(chart) {
  const width = widthOf(chart);
  if (chart.plot.width !== width) chart.plot.setSize({ width, height: HEIGHT });
}

export const recolour = () => charts.forEach(build);

export function forget() {
  for (const chart of charts) chart.times.length = chart.values.length = 0;
}

export function take(plots) {
  plots.forEach((values, n) => {
    const chart = charts[n];
    if (!chart) return;
    for (const [time, value] of values) {
      chart.times.push(time);
      chart.values.push(value);
    }
    const first = (chart.times.at(-1) ?? 0) - SPAN_S;
    const old = chart.times.findIndex((time) => time >= first);
    if (old > 200) {
      chart.times.splice(0, old);
      chart.values.splice(0, old);
    }
  });
}

export function draw() {
  for (const chart of charts) chart.plot.setData([chart.times, chart.values]);
}
