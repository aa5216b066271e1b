// Figures over the time of the drive: one uPlot for each panel, built when it comes into view.
const HEIGHT = 200;
const ERROR_HEIGHT = 110;
const charts = [];
let range = null;
let zooming = false;
let cursorAt = null;
const followers = [];

const lines = () => (data.lines ?? []).map(([from, to, kind, text]) => {
  const places = abscissa(to === null ? [from] : [from, to]);
  return { from: places[0], to: places[1] ?? null, kind, text };
});
let eventLines = [];

// Columns of a panel for uPlot, and how each is drawn.
function columns(panel) {
  const tables = new Map();
  const specs = [];
  for (const trace of panel.t) {
    if (!tables.has(trace.x)) tables.set(trace.x, { x: abscissa(series(trace.x)), y: [], specs: [] });
    const table = tables.get(trace.x);
    const stroke = penColour(trace.p);
    const add = (values, spec) => {
      table.y.push(values);
      table.specs.push(spec);
    };
    const fill = `${stroke}33`;
    if (trace.lo !== undefined) {
      add(series(trace.hi), { label: `${trace.n}, max`, stroke, width: 1, band: fill });
      add(series(trace.lo), { label: `${trace.n}, min`, stroke, width: 1 });
      continue;
    }
    const values = series(trace.y);
    const points = trace.p.startsWith("points");
    add(values, {
      label: trace.n, stroke, width: points ? 0 : 1.3,
      points: points ? { show: true, size: 5, fill: stroke } : { show: false },
      dash: trace.p === "truth" ? [4, 3] : undefined,
      paths: points ? () => null : undefined,
    });
    if (trace.s !== undefined) {
      const sigma = series(trace.s);
      const shifted = (sign) => values.map((value, n) =>
        (value === null || sigma[n] === null ? null : value + sign * sigma[n]));
      add(shifted(1), { label: "+σ", helper: true, band: fill });
      add(shifted(-1), { label: "−σ", helper: true });
    }
  }
  const all = [...tables.values()];
  all.forEach((table) => specs.push(...table.specs));
  const joined = all.length === 1 ? [all[0].x, ...all[0].y] : uPlot.join(all.map((table) => [table.x, ...table.y]));
  return { joined, specs };
}

function drawBands(chart) {
  const { ctx, bbox } = chart;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  let last = null;
  for (const line of eventLines) {
    const from = chart.valToPos(line.from, "x", true);
    const to = line.to === null ? from : chart.valToPos(line.to, "x", true);
    if (to < bbox.left || from > bbox.left + bbox.width) continue;
    ctx.fillStyle = ctx.strokeStyle = colour(`at-${line.kind}`);
    if (line.to !== null) {
      ctx.globalAlpha = 0.22;
      ctx.fillRect(from, bbox.top, Math.max(to - from, 2), bbox.height);
    } else if (last === null || from - last >= 1) {
      ctx.globalAlpha = 0.8;
      ctx.fillRect(from, bbox.top, Math.max(1, devicePixelRatio), bbox.height);
      last = from;
    }
  }
  ctx.restore();
}

function chartOptions(chart, specs, width) {
  const font = "13px system-ui, sans-serif";
  const axis = { stroke: colour("ink"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") }, font };
  const bands = [];
  const list = specs.map(({ band, helper, ...spec }, n) => {
    if (band) bands.push({ series: [n + 1, n + 2], fill: band });
    if (helper) return { label: spec.label, width: 0, points: { show: false }, class: "helper" };
    return { spanGaps: false, ...spec, value: (_, value) => short(value) };
  });
  return {
    width, height: chart.height, bands, padding: [8, 8, 0, 0],
    legend: { live: true },
    scales: { x: { time: false, range: (_, low, high) => (high > low ? [low, high] : [low, low + 1]) } },
    axes: [{ ...axis, size: 30 }, { ...axis, size: 62, label: chart.panel.y, labelFont: font, labelSize: 20,
      values: (_, ticks) => ticks.map((tick) => String(+tick.toPrecision(6))) }],
    series: [{ label: byDistance ? "m" : "s", value: (_, value) => short(value) }, ...list],
    cursor: {
      drag: { x: true, y: false, setScale: true },
      sync: { key: "time", setSeries: false, filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } },
      bind: { dblclick: () => () => { zoom(null); return null; } },
    },
    hooks: {
      drawClear: [drawBands],
      setScale: [(plot, key) => key === "x" && !zooming && plot.status && zoom([plot.scales.x.min, plot.scales.x.max])],
      setCursor: [(plot) => follow(plot)],
    },
  };
}

function fullRange() {
  const [from, to] = abscissa(data.span ?? [0, 1]);
  return [from, to > from ? to : from + 1];
}

// Shows the instant under the cursor in the diagrams and in the line at the end of the page.
function follow(plot) {
  if (plot.cursor.left < 0) return;
  const place = plot.posToVal(plot.cursor.left, "x");
  const time = timeAt(place);
  if (time === cursorAt) return;
  cursorAt = time;
  const near = (plot.scales.x.max - plot.scales.x.min) / 100;
  const texts = eventLines
    .filter(({ from, to }) => place >= from - near && place <= (to ?? from) + near)
    .map(({ text }) => text);
  const now = document.getElementById("now");
  now.textContent = `${short(time)} s${texts.length ? ` · ${texts.slice(0, 3).join(" · ")}` : ""}`;
  followers.forEach((follower) => follower(time));
}

// Moves the abscissas of all figures; those out of view follow when they come into view.
function zoom(next) {
  if (zooming) return;
  zooming = true;
  range = next;
  const [min, max] = range ?? fullRange();
  document.body.dataset.range = `${min} ${max}`;
  for (const chart of charts) {
    chart.stale = true;
    if (chart.visible) refresh(chart, min, max);
  }
  zooming = false;
}

function refresh(chart, min, max) {
  chart.stale = false;
  chart.plot?.batch(() => chart.plot.setScale("x", { min, max }));
}

function build(chart) {
  chart.plot?.destroy();
  const { joined, specs } = columns(chart.panel);
  const width = Math.max(chart.node.clientWidth, 240);
  zooming = true;
  chart.plot = new uPlot(chartOptions(chart, specs, width), joined, chart.node);
  refresh(chart, ...(range ?? fullRange()));
  zooming = false;
}

const inView = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const chart = charts.find(({ node }) => node === target);
    chart.visible = isIntersecting;
    if (isIntersecting && !chart.plot) build(chart);
    else if (isIntersecting && chart.stale) {
      zooming = true;
      refresh(chart, ...(range ?? fullRange()));
      zooming = false;
    }
  }
}, { rootMargin: "200px" });

const sizes = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    const chart = charts.find(({ node }) => node === target);
    const width = Math.max(target.clientWidth, 240);
    if (chart.plot && Math.abs(chart.plot.width - width) > 1) chart.plot.setSize({ width, height: chart.height });
  }
});

function timeFigure(figure, place) {
  const grid = make("div", figure.panels.filter((panel) => !panel.e).length > 1 ? "panels" : "panel");
  let cell = null;
  for (const panel of figure.panels) {
    if (!panel.e || !cell) {
      cell = make("div", "cell");
      if (panel.h) cell.append(make("h3", "", panel.h));
      grid.append(cell);
    }
    const node = make("div", "chart");
    const height = panel.e ? ERROR_HEIGHT : HEIGHT;
    node.style.minHeight = `${height + 30}px`;
    cell.append(node);
    charts.push({ panel, node, height, timed: true, plot: null, visible: false, stale: false });
    inView.observe(node);
    sizes.observe(node);
  }
  place.append(grid);
}

function rebuild() {
  eventLines = lines();
  for (const chart of charts) {
    if (!chart.plot) continue;
    chart.plot.destroy();
    chart.plot = null;
    if (chart.visible) build(chart);
  }
}
