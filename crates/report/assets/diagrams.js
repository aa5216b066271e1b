// Figures of two quantities, drawn on a canvas: points and lines, the track with colours.
const diagrams = [];

function extent(lists) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) {
    for (const value of list) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return [0, 1];
  const margin = (high - low || Math.abs(high) || 1) * 0.05;
  return [low - margin, high + margin];
}

// Round numbers within a range.
function ticks([low, high], count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((part) => part * power >= raw);
  const all = [];
  for (let n = Math.ceil(low / step); n * step <= high; n++) all.push(+(n * step).toPrecision(8));
  return all;
}

// From dark blue over green to yellow, for a part from 0 to 1.
function scale(part) {
  const stops = [[68, 1, 84], [49, 104, 142], [53, 183, 121], [253, 231, 37]];
  const at = Math.min(Math.max(part, 0), 1) * 3;
  const n = Math.min(Math.floor(at), 2);
  const mix = stops[n].map((from, k) => Math.round(from + (stops[n + 1][k] - from) * (at - n)));
  return `rgb(${mix.join(",")})`;
}

function diagram(figure, place) {
  const many = figure.panels.length > 1;
  const grid = make("div", many ? "panels" : "panel");
  for (const panel of figure.panels) {
    const cell = make("div", "cell");
    if (panel.h) cell.append(make("h3", "", panel.h));
    const canvas = make("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${figure.id} ${panel.h}`);
    const one = { figure, panel, canvas, cell, time: null, colouring: null, visible: false };
    if (figure.kind === "map" && data.colours?.length) cell.append(chooser(one));
    cell.append(canvas, key(panel));
    one.note = make("p", "caption readout");
    cell.append(one.note);
    grid.append(cell);
    diagrams.push(one);
    seen.observe(cell);
    if (panel.t.some((trace) => trace.time !== undefined)) {
      followers.push((time) => {
        one.time = time;
        if (one.visible) draw(one);
      });
    }
  }
  place.append(grid);
}

function key(panel) {
  const list = make("p", "key");
  for (const trace of panel.t) {
    const entry = make("span", "", trace.n);
    const mark = make("i");
    mark.style.background = penColour(trace.p);
    entry.prepend(mark);
    list.append(entry);
  }
  return list;
}

function chooser(one) {
  const label = make("label", "", "colour ");
  const select = make("select");
  data.colours.forEach(({ n }, index) => select.append(new Option(n, index)));
  select.addEventListener("change", () => { one.colouring = +select.value; draw(one); });
  one.colouring = 0;
  label.append(select);
  return label;
}

function frameOf(one, width, height) {
  const traces = one.panel.t.map((trace) => ({ trace, x: series(trace.x), y: series(trace.y) }));
  let xs = extent(traces.map(({ x }) => x));
  let ys = extent(traces.map(({ y }) => y));
  const box = { left: 66, top: 8, width: width - 76, height: height - 52 };
  if (one.figure.kind !== "plain") {
    // The same scale on both axes.
    const unit = Math.max((xs[1] - xs[0]) / box.width, (ys[1] - ys[0]) / box.height);
    const widen = ([low, high], pixels) => {
      const more = (unit * pixels - (high - low)) / 2;
      return [low - more, high + more];
    };
    [xs, ys] = [widen(xs, box.width), widen(ys, box.height)];
  }
  const toX = (value) => box.left + (value - xs[0]) / (xs[1] - xs[0]) * box.width;
  const toY = (value) => box.top + box.height - (value - ys[0]) / (ys[1] - ys[0]) * box.height;
  return { traces, xs, ys, box, toX, toY };
}

function draw(one) {
  const width = Math.max(one.cell.clientWidth, 240);
  const height = one.figure.kind === "plain" ? 300 : Math.min(width * 0.8, 460);
  const { canvas } = one;
  canvas.width = width * devicePixelRatio;
  canvas.height = height * devicePixelRatio;
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const ctx = canvas.getContext("2d");
  ctx.scale(devicePixelRatio, devicePixelRatio);
  const frame = frameOf(one, width, height);
  axes(ctx, one, frame, width, height);
  ctx.save();
  ctx.beginPath();
  ctx.rect(frame.box.left, frame.box.top, frame.box.width, frame.box.height);
  ctx.clip();
  if (one.figure.kind === "map") ground(ctx, frame);
  frame.traces.forEach((trace) => curve(ctx, one, frame, trace));
  ctx.restore();
}

// Tiles and picture below the track, each once it is decoded.
const pictures = (data.pictures ?? []).map(({ src, at, whole }) => {
  const image = new Image();
  image.addEventListener("load", redraw);
  image.src = src;
  return { image, at, whole };
});

function ground(ctx, { toX, toY }) {
  const [x, y] = [toX(1) - toX(0), toY(1) - toY(0)];
  for (const { image, at, whole } of pictures) {
    if (!image.complete || !image.naturalWidth) continue;
    const [column, row, east, columnNorth, rowNorth, north] = at;
    ctx.save();
    ctx.transform(x * column, y * columnNorth, x * row, y * rowNorth, toX(east), toY(north));
    // The place of a tile is that of the whole, and the place of a picture that of its pixels. Tiles overlap
    // by a part of a pixel, so that no line is between them.
    const part = whole ? 0.6 / Math.abs(x * column) : 0;
    if (whole) ctx.drawImage(image, 0, 0, 1 + part, 1 + part);
    else ctx.drawImage(image, 0, 0);
    ctx.restore();
  }
}

function axes(ctx, one, { xs, ys, box, toX, toY }, width, height) {
  ctx.font = "13px system-ui, sans-serif";
  ctx.strokeStyle = colour("line");
  ctx.fillStyle = colour("ink");
  ctx.textAlign = "center";
  for (const tick of ticks(xs, Math.max(box.width / 90, 2))) {
    ctx.strokeRect(toX(tick), box.top, 0, box.height);
    ctx.fillText(String(tick), toX(tick), box.top + box.height + 16);
  }
  ctx.textAlign = "right";
  for (const tick of ticks(ys, Math.max(box.height / 50, 2))) {
    ctx.strokeRect(box.left, toY(tick), box.width, 0);
    ctx.fillText(String(tick), box.left - 6, toY(tick) + 4);
  }
  ctx.textAlign = "center";
  ctx.fillText(one.figure.x, box.left + box.width / 2, height - 6);
  ctx.save();
  ctx.translate(14, box.top + box.height / 2);
  ctx.rotate(-Math.PI / 2);
  ctx.fillText(one.panel.y, 0, 0);
  ctx.restore();
}

function curve(ctx, one, { toX, toY }, { trace, x, y }) {
  const stroke = penColour(trace.p);
  const times = trace.time === undefined ? null : series(trace.time);
  const shade = one.colouring === null || !times ? null : shading(one, times);
  ctx.fillStyle = ctx.strokeStyle = stroke;
  if (times || trace.p.startsWith("points")) {
    ctx.globalAlpha = shade ? 1 : 0.5;
    for (let n = 0; n < x.length; n++) {
      if (x[n] === null || y[n] === null) continue;
      if (shade) ctx.fillStyle = shade(n);
      ctx.fillRect(toX(x[n]) - 1.5, toY(y[n]) - 1.5, 3, 3);
    }
    ctx.globalAlpha = 1;
  } else {
    ctx.lineWidth = 1.4;
    ctx.beginPath();
    let open = false;
    for (let n = 0; n < x.length; n++) {
      if (x[n] === null || y[n] === null) open = false;
      else if (open) ctx.lineTo(toX(x[n]), toY(y[n]));
      else {
        ctx.moveTo(toX(x[n]), toY(y[n]));
        open = true;
      }
    }
    ctx.stroke();
  }
  if (times && one.time !== null) {
    const n = Math.max(before(times, one.time), 0);
    if (x[n] === null || y[n] === null) return;
    ctx.fillStyle = colour("mark");
    ctx.strokeStyle = colour("paper");
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.arc(toX(x[n]), toY(y[n]), 6, 0, 2 * Math.PI);
    ctx.fill();
    ctx.stroke();
  }
}

// Colour of each point by the chosen value at its time; the note has the ends of the scale.
function shading(one, times) {
  const trace = data.colours[one.colouring];
  const [x, y] = [series(trace.x), series(trace.y)];
  const values = times.map((time) => between(x, y, time));
  const [low, high] = extent([values]);
  one.note.textContent = `${trace.n}: dark ${short(low)}, bright ${short(high)}`;
  return (n) => scale((values[n] - low) / (high - low));
}

const seen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    const one = diagrams.find(({ cell }) => cell === target);
    one.visible = isIntersecting;
    if (isIntersecting) draw(one);
  }
}, { rootMargin: "200px" });

function redraw() {
  for (const one of diagrams) {
    one.cell.querySelectorAll(".key i").forEach((mark, n) => { mark.style.background = penColour(one.panel.t[n].p); });
    if (one.visible) draw(one);
  }
}
