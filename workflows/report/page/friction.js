// Friction at the wall: the loop of its force up to the play head, and the contact's disc.

import { between, largest, stored } from "./arrays.js";
import { colour, onTheme } from "./theme.js";
import { digits, power, prefixed, saveCsv, si } from "./words.js";

const PAD = { left: 62, right: 12, top: 10, bottom: 38 };
const STICKS = 0.999; // share of the area from which the contact sticks

/** Loop and disc in a holder; see `friction_of` of page_data.py for the arrays. */
export function frictionView(holder, clock, { dt, axis, bound, radius, ...packed }) {
  holder.querySelector(".still")?.remove();
  const box = document.createElement("div");
  const [loop, disc] = [0, 1].map(() => document.createElement("canvas"));
  const state = document.createElement("p");
  box.className = "friction";
  state.className = "state";
  box.append(loop, disc, state);
  holder.querySelector("h3").after(box);

  const [slip, force, stick] = ["slip", "force", "stick"].map((name) => stored(packed[name]));
  const cycle = packed.cycle && ["slip", "force"].map((name) => stored(packed.cycle[name]));
  const limit = stored(bound);
  const a = stored(radius);
  const widest = largest([a]) || 1;
  const spans = [cycle ? [slip, cycle[0]] : [slip], cycle ? [force, cycle[1]] : [force]].map(range);
  const exponent = spans.map(([low, high]) => power(Math.max(Math.abs(low), Math.abs(high)) || 1));

  holder.querySelector("button.csv").addEventListener("click", () =>
    saveCsv(
      "friction",
      ["time [s]", "slip [m]", "force [N]", "bound mu F [N]", "share that sticks", "contact radius [m]"],
      [Array.from(slip, (_, i) => Number((i * dt).toPrecision(10))), slip, force, limit, stick, a],
    ),
  );

  /** A canvas as wide as it stands in the page, ready to draw in its pixels. */
  function penOf(canvas) {
    const dpr = Math.min(devicePixelRatio, 2);
    canvas.width = canvas.clientWidth * dpr;
    canvas.height = canvas.clientHeight * dpr;
    const pen = canvas.getContext("2d");
    pen.scale(dpr, dpr);
    pen.font = "12px system-ui, sans-serif";
    return pen;
  }

  function drawLoop(place) {
    const pen = penOf(loop);
    const wide = loop.clientWidth - PAD.left - PAD.right;
    const tall = loop.clientHeight - PAD.top - PAD.bottom;
    const [[u0, u1], [f0, f1]] = spans;
    const x = (u) => PAD.left + (wide * (u - u0)) / (u1 - u0);
    const y = (f) => PAD.top + tall - (tall * (f - f0)) / (f1 - f0);

    // scales
    pen.fillStyle = colour("ink-soft");
    pen.strokeStyle = colour("grid");
    pen.textAlign = "center";
    for (const u of ticks(u0, u1, wide / 70)) {
      line(pen, [[x(u), PAD.top], [x(u), PAD.top + tall]]);
      pen.fillText(digits(u / 10 ** exponent[0]), x(u), PAD.top + tall + 15);
    }
    pen.fillText(`slip along ${axis} [${prefixed("m", exponent[0])}]`, PAD.left + wide / 2, loop.clientHeight - 4);
    pen.textAlign = "right";
    for (const f of ticks(f0, f1, tall / 40)) {
      line(pen, [[PAD.left, y(f)], [PAD.left + wide, y(f)]]);
      pen.fillText(digits(f / 10 ** exponent[1]), PAD.left - 6, y(f) + 4);
    }
    pen.save();
    pen.textAlign = "center";
    pen.translate(12, PAD.top + tall / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(`force on the wall [${prefixed("N", exponent[1])}]`, 0, 0);
    pen.restore();

    // the whole record, the cycle before it, what has passed, and the bound now
    const path = (us, fs, count) => Array.from({ length: count }, (_, i) => [x(us[i]), y(fs[i])]);
    pen.save();
    pen.beginPath();
    pen.rect(PAD.left, PAD.top, wide, tall);
    pen.clip();
    pen.lineWidth = 1.4;
    pen.strokeStyle = colour("line");
    line(pen, path(slip, force, slip.length));
    if (cycle) {
      pen.strokeStyle = colour("curve-4");
      pen.setLineDash([4, 3]);
      line(pen, path(...cycle, cycle[0].length));
    }
    pen.setLineDash([2, 3]);
    pen.strokeStyle = colour("curve-2");
    const now = between([limit], place, 0);
    for (const f of [now, -now]) line(pen, [[PAD.left, y(f)], [PAD.left + wide, y(f)]]);
    pen.setLineDash([]);
    pen.strokeStyle = colour("accent");
    pen.lineWidth = 2;
    const head = [between([slip], place, 0), between([force], place, 0)];
    line(pen, [...path(slip, force, Math.floor(place) + 1), [x(head[0]), y(head[1])]]);
    pen.restore();
    pen.fillStyle = colour("accent");
    pen.beginPath();
    pen.arc(x(head[0]), y(head[1]), 4.5, 0, 2 * Math.PI);
    pen.fill();
  }

  function drawDisc(place) {
    const pen = penOf(disc);
    const [wide, tall] = [disc.clientWidth, disc.clientHeight];
    const most = Math.min(wide, tall) / 2 - 14;
    const [edge, share] = [most * (between([a], place, 0) / widest), between([stick], place, 0)];
    const circle = (r) => {
      pen.beginPath();
      pen.arc(wide / 2, tall / 2, r, 0, 2 * Math.PI);
    };
    pen.strokeStyle = colour("line");
    circle(most);
    pen.stroke();
    pen.fillStyle = colour("curve-2");
    circle(edge);
    pen.fill();
    pen.fillStyle = colour("curve-1");
    circle(edge * Math.sqrt(share));
    pen.fill();
  }

  function follow(t) {
    const place = t / dt;
    drawLoop(place);
    drawDisc(place);
    const [share, size] = [between([stick], place, 0), between([a], place, 0)];
    const name = size <= 0 ? "open" : share >= STICKS ? "sticks" : share > 0 ? "partial slip" : "gross slip";
    state.textContent =
      `${digits(1e3 * t, 4)} ms: ${name}; ${si(between([force], place, 0), "N")} of up to ` +
      `${si(between([limit], place, 0), "N")}; ${digits(100 * share)} % of the area sticks; ` +
      `contact radius ${si(size, "m")}`;
  }

  const draw = () => follow(clock.time);
  clock.onTime(follow);
  onTheme(draw);
  new ResizeObserver(draw).observe(box);
}

function line(pen, points) {
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.stroke();
}

/** Least and largest value of some arrays, a twentieth wider. */
function range(arrays) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays) {
    for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  const margin = 0.05 * (high - low) || Math.abs(high) || 1e-9;
  return [low - margin, high + margin];
}

/** Round numbers from low to high, about `most` of them at the most. */
function ticks(low, high, most) {
  const wanted = (high - low) / Math.max(most, 2);
  const scale = 10 ** Math.floor(Math.log10(wanted));
  const step = [1, 2, 5, 10].map((one) => one * scale).find((one) => one >= wanted);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
}
