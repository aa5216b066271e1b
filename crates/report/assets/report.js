// Builds the page when its numbers are there.
await unpack();
eventLines = lines();
const now = make("div");
now.id = "now";
document.body.append(now);
for (const figure of data.figures) {
  const place = document.getElementById(`${figure.id}-plot`);
  (figure.kind === "time" ? timeFigure : diagram)(figure, place);
}

document.getElementById("all")?.addEventListener("click", () => zoom(null));
const axisLabel = document.getElementById("axis-label");
if (axisLabel && data.distance) {
  axisLabel.hidden = false;
  const axis = document.getElementById("axis");
  const choose = () => {
    byDistance = axis.value === "distance";
    range = null;
    rebuild();
  };
  axis.addEventListener("change", choose);
  if (data.over_distance) {
    axis.value = "distance";
    choose();
  }
}
// A row of the table of events shows its instant in the figures.
for (const row of document.querySelectorAll("tr[data-at]")) {
  row.addEventListener("click", () => {
    const at = +row.dataset.at;
    zoom(abscissa([at - 5, at + 5]));
    document.querySelector("section figure")?.scrollIntoView({ behavior: "smooth", block: "center" });
  });
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { rebuild(); redraw(); });
addEventListener("resize", redraw);
addEventListener("beforeprint", () => {
  for (const chart of charts) if (!chart.plot) build(chart);
  diagrams.forEach(draw);
});
document.body.dataset.ready = "yes";
