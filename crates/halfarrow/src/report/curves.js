(() => {
  const place = document.getElementById("curves");
  const still = document.querySelector("figure.still");
  if (!place || !window.uPlot || !runs.panels.length) return;
  const colours = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#7a3e9d", "#8c8c2b"];
  const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const sync = uPlot.sync("t");
  const read = x => x == null ? "–" : Number(x).toPrecision(6);
  const same = (a, b) => a.every((x, i) => x === b[i]);
  const hint = document.createElement("p");
  hint.className = "hint";
  hint.textContent = "Drag over a stretch of time to zoom, double-click to see all; the legend shows the values at the pointer, and a click on a name hides its curve.";
  place.append(hint);
  let plots = [];
  const draw = () => {
    plots.forEach(p => p.destroy());
    const grid = { stroke: ink("--line"), width: 1 };
    const axis = { stroke: ink("--soft"), grid, ticks: grid };
    const plot = (panel, i) => new uPlot({
      width: place.clientWidth, height: i + 1 === runs.panels.length ? 235 : 205,
      cursor: { sync: { key: sync.key }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [
        { ...axis, label: i + 1 === runs.panels.length ? "t in s" : undefined, labelSize: 22 },
        { ...axis, label: panel.unit && panel.unit !== "1" ? "in " + panel.unit : " ", labelSize: 22, size: 68 }
      ],
      series: [{ label: "t", value: (u, x) => read(x) }].concat(panel.names.map((label, k) => ({
        label, stroke: colours[k % colours.length], width: 1.6, value: (u, x) => read(x),
        dash: k >= colours.length || panel.values.slice(0, k).some(v => same(v, panel.values[k])) ? [7, 7] : undefined
      })))
    }, [runs.t].concat(panel.values), place);
    plots = runs.panels.map(plot);
  };
  draw();
  if (still) still.style.display = "none";
  let width = place.clientWidth;
  addEventListener("resize", () => {
    if (place.clientWidth === width) return;
    width = place.clientWidth;
    plots.forEach(p => p.setSize({ width, height: p.height }));
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
})();
