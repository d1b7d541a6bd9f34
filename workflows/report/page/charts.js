// Curves that answer to the mouse: values, zoom by dragging, curves on and off by their names.

import { largest, stored } from "./arrays.js";
import { colour, curveColour, onTheme } from "./theme.js";
import { digits, power, prefixed, saveCsv } from "./words.js";

const FONT = "12px system-ui, sans-serif";

function axis(label, more = {}) {
  return {
    label, labelSize: 20, size: 46, font: FONT, labelFont: FONT, gap: 4,
    stroke: () => colour("ink-soft"),
    grid: { stroke: () => colour("grid"), width: 1 },
    ticks: { stroke: () => colour("grid"), width: 1, size: 4 },
    ...more,
  };
}

/** A frame with heading buttons around a chart; returns its pieces. */
function mounted(holder, csv) {
  holder.querySelector(".still")?.remove();
  const box = document.createElement("div");
  box.className = "chart";
  holder.querySelector("h3").after(box);
  const button = holder.querySelector("button.csv");
  if (button) button.addEventListener("click", csv);
  return box;
}

function series(curves, more = () => ({})) {
  return curves.map((curve, i) => ({
    label: curve.name,
    width: 1.6,
    stroke: () => (curve.name === "sum" ? colour("ink") : curveColour(i)),
    dash: curve.dash,
    value: (_, value) => (value === null ? "–" : `${digits(value)} ${curve.shown}`),
    points: { show: false },
    ...more(curve, i),
  }));
}

/** A chart of uPlot that keeps the width of its box and follows the theme. */
function plotted(box, options, data, height) {
  const size = () => ({ width: Math.max(box.clientWidth, 200), height });
  const plot = new uPlot({ ...options, ...size() }, data, box);
  new ResizeObserver(() => plot.setSize(size())).observe(box);
  onTheme(() => {
    plot.setSize(size());
    plot.redraw(false, true);
  });
  return plot;
}

/** Curves over time with the play head; marks are { time, value, name } by curve. */
export function timeChart(holder, clock, dt, curves, { marks = [], height = 230 } = {}) {
  const values = curves.map((curve) => stored(curve.values));
  const exponent = power(largest(values) || 1);
  const seconds = Float64Array.from(values[0], (_, i) => i * dt);
  const unit = prefixed(curves[0].unit, exponent);
  const shown = curves.map((curve) => ({ ...curve, shown: unit }));
  const data = [
    Array.from(seconds, (t) => 1e3 * t),
    ...values.map((one) => Array.from(one, (value) => value / 10 ** exponent)),
  ];
  const box = mounted(holder, () =>
    saveCsv(
      holder.dataset.plot,
      ["time [s]", ...curves.map((curve) => `${curve.name} [${curve.unit}]`)],
      [seconds.map((t) => Number(t.toPrecision(10))), ...values],
    ),
  );
  const quantity = holder.dataset.quantity;
  const options = {
    scales: { x: { time: false } },
    series: [{ label: "time", value: (_, t) => (t === null ? "–" : `${digits(t, 4)} ms`) }, ...series(shown)],
    axes: [axis("time [ms]", { size: 34 }), axis(`${quantity} [${unit}]`, { size: 56 })],
    cursor: { sync: { key: "time" }, drag: { x: true, y: false }, points: { size: 7 } },
    hooks: {
      draw: [(plot) => named(plot, marks, exponent), () => follow(clock.time)],
      setCursor: [({ cursor }) => cursor.left < 0 && queueMicrotask(() => follow(clock.time))],
    },
  };
  const head = document.createElement("div");
  head.className = "head";

  function follow(t) {
    const x = plot.valToPos(1e3 * t, "x");
    const seen = x >= 0 && x <= plot.over.clientWidth;
    head.style.setProperty("transform", `translateX(${seen ? x : -10000}px)`);
    // without a mouse on them the names have the values at the play head, once it stands
    if (!clock.playing && !(plot.cursor.left >= 0)) plot.setLegend({ idx: Math.round(t / dt) }, false);
  }

  const plot = plotted(box, options, data, height);
  plot.over.append(head);
  clock.onTime(follow);
  plot.over.addEventListener("dblclick", () => clock.seek(plot.posToVal(plot.cursor.left, "x") / 1e3));
  return plot;
}

/** Names of waves at their crests. */
function named(plot, marks, exponent) {
  const { ctx } = plot;
  ctx.save();
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.fillStyle = colour("ink");
  for (const { time, value, name, curve } of marks) {
    if (!plot.series[curve + 1].show) continue;
    const x = plot.valToPos(1e3 * time, "x", true);
    const y = plot.valToPos(value / 10 ** exponent, "y", true);
    const { left, width } = plot.bbox;
    if (x < left || x > left + width) continue;
    ctx.fillText(name, x, y + (value > 0 ? -5 : 14) * devicePixelRatio);
  }
  ctx.restore();
}

/** Receptance over frequency, both logarithmic, with points where the full model was solved. */
export function responseChart(holder, response, height = 320) {
  const f = Array.from(stored(response.frequency_hz));
  const reduced = Array.from(stored(response.reduced));
  const finer = Array.from(stored(response.finer));
  const full = f.map(() => null);
  response.checked_hz.forEach((hz, i) => {
    const near = f.reduce((best, x, j) => (Math.abs(x - hz) < Math.abs(f[best] - hz) ? j : best), 0);
    full[near] = response.full[i];
  });
  const box = mounted(holder, () =>
    saveCsv(
      "frequency_response",
      ["frequency [Hz]", "reduced model [m/N]", "finer reduced model [m/N]", "full model [m/N]"],
      [f, reduced, finer, full],
    ),
  );
  const curves = [
    { name: "reduced model", shown: "m/N" },
    { name: "finer reduced model", shown: "m/N", dash: [3, 4] },
    { name: "full model", shown: "m/N" },
  ];
  const dots = (curve, i) =>
    i === 2
      ? { paths: () => null, points: { show: true, size: 9, fill: () => curveColour(i) } }
      : {};
  const plain = (plot, ticks) => ticks.map((value) => (value === null ? "" : hertz(value)));
  const options = {
    scales: { x: { time: false, distr: 3, range: (_, min, max) => [min, max] }, y: { distr: 3 } },
    series: [
      { label: "frequency", value: (_, hz) => (hz === null ? "–" : `${digits(hz, 4)} Hz`) },
      ...series(curves, dots),
    ],
    axes: [
      axis("frequency [Hz]", { size: 34, values: plain }),
      axis("receptance at the contact [m/N]", {
        size: 62,
        values: (_, ticks) => ticks.map((value) => (decade(value) ? `1e${decade(value) - 100}` : "")),
      }),
    ],
    cursor: { drag: { x: true, y: false } },
  };
  return plotted(box, options, [f, reduced, finer, full], height);
}

/** 100 and the power of ten of a value that is one, else 0. */
function decade(value) {
  const exponent = value === null ? NaN : Math.log10(value);
  return Math.abs(exponent - Math.round(exponent)) < 1e-9 ? 100 + Math.round(exponent) : 0;
}

function hertz(value) {
  const first = String(value)[0];
  if (!["1", "2", "5"].includes(first)) return "";
  return value >= 1000 ? `${value / 1000}k` : String(value);
}
