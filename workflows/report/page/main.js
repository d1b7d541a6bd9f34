// The page: what stands in it as text and pictures becomes charts and views where they can be.

import { columns } from "./arrays.js";
import { responseChart, timeChart } from "./charts.js";
import { clockOf } from "./clock.js";
import { crystalView } from "./crystal.js";
import { frictionView } from "./friction.js";
import { heatMap } from "./heat.js";
import { impactView } from "./impact.js";
import { drawnBy } from "./stage.js";
import { startTheme } from "./theme.js";
import { digits, saveTable } from "./words.js";

const data = JSON.parse(document.getElementById("data").textContent);
const root = document.documentElement;

function durationOf({ chain, crystal }) {
  if (crystal) return (crystal.u.shape[0] - 1) * crystal.dt;
  return chain ? (chain.x.shape[0] - 1) * chain.dt : 1;
}

function marksOf(curves, marks) {
  return curves.flatMap(({ name }, curve) =>
    (marks[name.replace("sphere ", "")] ?? [])
      .filter((arrival) => arrival.name)
      .map((arrival) => ({
        curve, time: arrival.time_s, value: arrival.peak_velocity_m_s,
        name: arrival.name.replace("incident", "i").replace("reflected ", ""),
      })),
  );
}

function startCharts(clock) {
  for (const holder of document.querySelectorAll("figure[data-plot]")) {
    const plot = holder.dataset.plot;
    const source = [data.curves, data.signals].find((one) => one?.plots[plot]);
    if (!source) continue;
    const curves = source.plots[plot];
    const marks = plot === "velocity" ? marksOf(curves, data.waves.marks) : [];
    timeChart(holder, clock, source.dt, curves, { marks });
  }
  const friction = document.querySelector("figure[data-friction]");
  if (friction && data.friction) frictionView(friction, clock, data.friction);
  const response = document.querySelector("figure[data-response]");
  if (response && data.response) responseChart(response, data.response);
  const heat = document.querySelector("figure[data-heat]");
  if (heat && data.chain) {
    const { dt, first } = data.chain;
    heatMap(heat, clock, { v: columns(data.chain.v), dt, first, tracks: data.waves.tracks, wall: data.wall });
  }
}

function startControls(view, clock) {
  const play = view.querySelector("button.play");
  const seek = view.querySelector("input[name=time]");
  const speed = view.querySelector("select[name=speed]");
  const told = view.querySelector(".time");
  play.addEventListener("click", () => clock.play(!clock.playing));
  seek.addEventListener("input", () => {
    clock.play(false);
    clock.seek((Number(seek.value) / 1000) * clock.duration);
  });
  speed.addEventListener("change", () => {
    clock.speed = Number(speed.value);
    clock.seek(clock.time);
  });
  clock.onTime((t) => {
    seek.value = String((1000 * t) / clock.duration);
    play.textContent = clock.playing ? "Pause" : "Play";
    told.textContent = `${(1e3 * t).toFixed(3)} ms, shown ${digits(clock.slowness(), 2)} times slower`;
  });
}

function startTables() {
  for (const button of document.querySelectorAll("button[data-table]")) {
    const table = document.getElementById(button.dataset.table);
    button.addEventListener("click", () => saveTable(button.dataset.table, table));
  }
}

/** Play when the view is first scrolled to, unless the reader wants little motion. */
function playOnceSeen(section, clock) {
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) return;
  const seen = new IntersectionObserver(
    ([entry]) => {
      if (!entry.isIntersecting) return;
      seen.disconnect();
      clock.play(true);
    },
    { threshold: 0.6 },
  );
  seen.observe(section.querySelector(".view"));
}

function start() {
  startTheme(document.getElementById("theme"));
  startTables();
  const clock = clockOf(durationOf(data));
  const section = document.getElementById("impact");
  const drawn = section && (data.chain || data.assembly || data.crystal) && drawnBy() !== null;
  root.classList.add(drawn ? "with-view" : "without-view");
  startCharts(clock);
  if (drawn) {
    const view = (data.crystal ? crystalView : impactView)(section, data, clock);
    if (data.chain || data.crystal) startControls(section, clock);
    window.beadwave = { clock, view };
  }
  clock.seek(0.25 * clock.duration);
  if (drawn && (data.chain || data.crystal)) playOnceSeen(section, clock);
}

start();
