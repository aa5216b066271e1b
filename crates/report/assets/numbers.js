// The numbers of the figures: see blob.rs for their code.
const data = JSON.parse(document.getElementById("data").textContent);
const decoded = new Map();
let bytes = new Uint8Array();

async function unpack() {
  const text = atob(document.getElementById("numbers").textContent);
  const packed = new Uint8Array(text.length);
  for (let n = 0; n < text.length; n++) packed[n] = text.charCodeAt(n);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  bytes = new Uint8Array(await new Response(stream).arrayBuffer());
}

// The values of a series; null where there is none.
function series(id) {
  if (decoded.has(id)) return decoded.get(id);
  const { o, n, l, s, t } = data.series[id];
  const values = new Array(n);
  let at = o;
  let sum = 0;
  let step = 0;
  for (let k = 0; k < n; k++) {
    let code = 0;
    let scale = 1;
    let byte;
    do {
      byte = bytes[at++];
      code += (byte & 127) * scale;
      scale *= 128;
    } while (byte > 127);
    if (!t && code === 0) {
      values[k] = null;
      continue;
    }
    if (!t) code -= 1;
    const signed = code % 2 ? -(code + 1) / 2 : code / 2;
    if (t) {
      step += signed;
      sum += step;
      values[k] = sum * 1e-6;
    } else {
      sum += signed;
      values[k] = l + sum * s;
    }
  }
  decoded.set(id, values);
  return values;
}

// Position of the last value of a rising list that is not above x.
function before(list, x) {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// The value of y at a place on rising x, by a straight line.
function between(x, y, at) {
  const n = before(x, at);
  if (n < 0) return y[0];
  if (n + 1 >= x.length || x[n + 1] === x[n]) return y[n];
  if (y[n] === null || y[n + 1] === null) return y[n];
  return y[n] + (y[n + 1] - y[n]) * (at - x[n]) / (x[n + 1] - x[n]);
}

// Times as the chosen abscissa, and back.
let byDistance = false;
function abscissa(times) {
  if (!byDistance) return times;
  const [x, y] = data.distance.map(series);
  return times.map((time) => between(x, y, time));
}
function timeAt(place) {
  if (!byDistance) return place;
  const [x, y] = data.distance.map(series);
  return between(y, x, place);
}

function short(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return value.toFixed(size >= 1000 ? 0 : size >= 100 ? 1 : size >= 1 ? 2 : 4);
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const penColour = (pen) => colour(pen.replace("points", "other"));

function make(tag, name, text) {
  const node = document.createElement(tag);
  if (name) node.className = name;
  if (text) node.textContent = text;
  return node;
}
