// Draws the figures and keeps the time axes of all of them on the same stretch.
(() => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const options = { responsive: true, displaylogo: false, scrollZoom: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const timed = [];
  let following = false;

  const follow = (source, change) => {
    if (following) return;
    const range = change["xaxis.range[0]"] !== undefined
      ? { "xaxis.range[0]": change["xaxis.range[0]"], "xaxis.range[1]": change["xaxis.range[1]"] }
      : change["xaxis.autorange"] ? { "xaxis.autorange": true } : null;
    if (!range) return;
    following = true;
    Promise.all(timed.filter((plot) => plot !== source).map((plot) => Plotly.relayout(plot, range)))
      .finally(() => { following = false; });
  };

  for (const figure of figures) {
    const place = document.getElementById(figure.id + "-plot");
    Plotly.newPlot(place, figure.data, figure.layout, options).then(() => {
      if (!figure.timed) return;
      timed.push(place);
      place.on("plotly_relayout", (change) => follow(place, change));
    });
  }
  window.addEventListener("beforeprint", () => {
    for (const figure of figures) Plotly.Plots.resize(document.getElementById(figure.id + "-plot"));
  });
})();
