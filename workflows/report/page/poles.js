// A stability diagram whose numbered poles a click takes or leaves out, and the command for that.

import { colour, onTheme } from "./theme.js";

const REACH = 14; // pixels from a line within which a click is meant for it
const { frequency, response, orders, poles, command, reject, accept } = JSON.parse(document.getElementById("data").textContent);
const rejected = new Set(reject);
const accepted = new Set(accept);
const rows = new Map([...document.querySelectorAll("tbody tr")].map((row) => [Number(row.dataset.number), row]));
const plot = diagram(document.getElementById("diagram"));

for (const [number, row] of rows) row.addEventListener("click", () => toggle(number));
document.getElementById("copy").addEventListener("click", ({ target }) => {
  navigator.clipboard?.writeText(document.getElementById("command").textContent);
  target.textContent = "copied";
});
document.getElementById("reset").addEventListener("click", () => {
  for (const [mine, given] of [[rejected, reject], [accepted, accept]]) {
    mine.clear();
    given.forEach((number) => mine.add(number));
  }
  show();
});
show();

/** Whether a pole would be a mode: as it was found, unless the user says otherwise. */
function taken(pole) {
  return accepted.has(pole.number) || (pole.found && !rejected.has(pole.number));
}

function toggle(number) {
  const pole = poles.find((one) => one.number === number);
  if (taken(pole)) {
    accepted.delete(number);
    if (pole.found) rejected.add(number);
  } else {
    rejected.delete(number);
    if (!pole.found) accepted.add(number);
  }
  show();
}

/** The table and the command as the choice is now. */
function show() {
  for (const pole of poles) {
    const row = rows.get(pole.number);
    row.querySelector("button").textContent = taken(pole) ? "mode" : "left out";
    row.querySelector("button").setAttribute("aria-pressed", taken(pole));
    row.classList.toggle("changed", taken(pole) !== pole.taken);
  }
  const listed = (set) => [...set].sort((a, b) => a - b).join(",");
  const options = [["--reject", rejected], ["--accept", accepted]].filter(([, set]) => set.size);
  document.getElementById("command").textContent = [command, ...options.map(([name, set]) => `${name} ${listed(set)}`)].join(" ");
  document.getElementById("copy").textContent = "copy";
  plot.redraw(false, true);
}

/** The chart: poles and lines are drawn over the response. */
function diagram(box) {
  const top = Math.max(...orders.map(([order]) => order));
  const axis = (label) => ({
    label, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif",
    stroke: () => colour("ink-soft"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("grid"), width: 1 },
  });
  const size = () => ({ width: Math.max(box.clientWidth, 200), height: box.clientHeight });
  const made = new uPlot(
    {
      ...size(),
      legend: { show: false },
      scales: { x: { time: false }, y: { distr: 3 } },
      series: [{}, { stroke: () => colour("curve-1"), width: 1.4, points: { show: false } }],
      axes: [axis("frequency [Hz]"), { ...axis("sum of all responses"), size: 64 }],
      cursor: { points: { show: false }, drag: { x: true, y: false } },
      hooks: { draw: [drawn] },
    },
    [frequency, response],
    box,
  );
  // a drag ends in a click as well
  let from = null;
  made.over.addEventListener("pointerdown", (event) => (from = event.clientX));
  made.over.addEventListener("click", (event) => {
    if (from !== null && Math.abs(event.clientX - from) > 4) return;
    const at = event.clientX - made.over.getBoundingClientRect().left;
    const away = (pole) => Math.abs(made.valToPos(pole.hz, "x") - at);
    const nearest = poles.reduce((best, pole) => (best === null || away(pole) < away(best) ? pole : best), null);
    if (nearest && away(nearest) <= REACH) toggle(nearest.number);
  });
  new ResizeObserver(() => made.setSize(size())).observe(box);
  onTheme(() => made.redraw(false, true));
  return made;

  function drawn(chart) {
    const { ctx, bbox } = chart;
    const scale = devicePixelRatio;
    const x = (hz) => chart.valToPos(hz, "x", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const [order, hz, recurs] of orders) {
      const y = bbox.top + bbox.height * (1 - (0.9 * order) / top);
      for (const strong of [false, true]) {
        ctx.fillStyle = strong ? colour("curve-2") : colour("line");
        hz.forEach((one, i) => {
          if (Boolean(recurs[i]) === strong) ctx.fillRect(x(one) - 1.5 * scale, y - 1.5 * scale, 3 * scale, 3 * scale);
        });
      }
    }
    ctx.font = `${12 * scale}px system-ui, sans-serif`;
    ctx.textAlign = "center";
    let end = -Infinity; // end of the number before, in the upper of two rows
    for (const pole of poles) {
      const is = taken(pole);
      ctx.strokeStyle = ctx.fillStyle = pole.taken === is ? colour(is ? "ink" : "ink-soft") : colour("warn");
      ctx.lineWidth = (is ? 1.4 : 1) * scale;
      ctx.setLineDash(is ? [] : [4 * scale, 4 * scale]);
      ctx.beginPath();
      const half = ctx.measureText(pole.number).width / 2 + 2 * scale;
      const lower = x(pole.hz) - half < end;
      end = lower ? -Infinity : x(pole.hz) + half;
      ctx.moveTo(x(pole.hz), bbox.top + (lower ? 30 : 16) * scale);
      ctx.lineTo(x(pole.hz), bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillText(pole.number, x(pole.hz), bbox.top + (lower ? 26 : 12) * scale);
    }
    ctx.restore();
  }
}
