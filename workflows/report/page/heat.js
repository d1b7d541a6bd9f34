// Velocity of every sphere over time as colours, with the waves that were followed.

import { largest } from "./arrays.js";
import { colour, onTheme, rgb } from "./theme.js";
import { digits, si } from "./words.js";

const LINEAR = 0.05; // of the largest velocity: below, the scale is linear, beyond logarithmic
const PAD = { left: 42, right: 10, top: 44, bottom: 34 };
const BAR = { high: 8, top: 4, share: 0.62 }; // the colour bar above the map, of its width

/** From −1 to 1, small values seen as well. */
function spread(share) {
  const size = Math.abs(share);
  const value = size < LINEAR ? size / LINEAR : 1 + Math.log(size / LINEAR);
  return (Math.sign(share) * value) / (1 + Math.log(1 / LINEAR));
}

/** The map in a holder; v holds velocities [m/s] by sphere, the first of number `first`. */
export function heatMap(holder, clock, { v, dt, first, tracks, wall }) {
  holder.querySelector(".still")?.remove();
  const box = document.createElement("div");
  box.className = "heat";
  const canvas = document.createElement("canvas");
  const head = document.createElement("div");
  const tip = document.createElement("div");
  head.className = "head";
  tip.className = "tip";
  box.append(canvas, head, tip);
  holder.prepend(box);
  const n = v.length;
  const k = v[0].length;
  const most = largest(v) || 1;
  const duration = (k - 1) * dt;

  const place = (t) => PAD.left + ((box.clientWidth - PAD.left - PAD.right) * t) / duration;
  const rows = () => box.clientHeight - PAD.top - PAD.bottom;
  const level = (sphere) => PAD.top + (rows() * (sphere - first + 0.5)) / n;

  function image() {
    const wide = Math.min(k, 1400);
    const found = new ImageData(wide, n);
    const [towards, rest, away] = ["sphere-towards", "paper", "sphere-away"].map(rgb);
    for (let j = 0; j < n; j++) {
      for (let i = 0; i < wide; i++) {
        const s = spread(v[j][Math.floor((i * k) / wide)] / most);
        const end = s > 0 ? towards : away;
        for (let c = 0; c < 3; c++) {
          found.data[4 * (j * wide + i) + c] = 255 * (rest[c] + Math.abs(s) * (end[c] - rest[c]));
        }
        found.data[4 * (j * wide + i) + 3] = 255;
      }
    }
    const small = document.createElement("canvas");
    small.width = wide;
    small.height = n;
    small.getContext("2d").putImageData(found, 0, 0);
    return small;
  }

  function draw() {
    const dpr = Math.min(devicePixelRatio, 2);
    canvas.width = box.clientWidth * dpr;
    canvas.height = box.clientHeight * dpr;
    const pen = canvas.getContext("2d");
    pen.scale(dpr, dpr);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(image(), PAD.left, PAD.top, place(duration) - PAD.left, rows());
    pen.font = "12px system-ui, sans-serif";
    bar(pen);
    scales(pen);
    followed(pen);
    follow(clock.time);
  }

  /** The colour bar: every colour stands at its velocity on the scale of the map. */
  function bar(pen) {
    const wide = BAR.share * (place(duration) - PAD.left);
    const left = PAD.left;
    const [towards, rest, away] = ["sphere-towards", "paper", "sphere-away"].map(rgb);
    for (let x = 0; x < wide; x++) {
      const share = (2 * x) / wide - 1;
      const end = share > 0 ? towards : away;
      const mixed = rest.map((c, i) => Math.round(255 * (c + Math.abs(share) * (end[i] - c))));
      pen.fillStyle = `rgb(${mixed.join(",")})`;
      pen.fillRect(left + x, BAR.top, 1.5, BAR.high);
    }
    pen.fillStyle = colour("ink-soft");
    const marks = wide > 260 ? [-1, -0.2, -LINEAR, 0, LINEAR, 0.2, 1] : [-1, 0, 1];
    for (const share of marks) {
      const x = left + (wide * (1 + spread(share))) / 2;
      pen.textAlign = share === -1 ? "left" : "center";
      pen.fillText(digits(share * most, 2), x, BAR.top + BAR.high + 14);
    }
    pen.textAlign = "left";
    pen.fillText("velocity [m/s]", left + wide + 24, BAR.top + BAR.high + 1);
  }

  function scales(pen) {
    pen.fillStyle = colour("ink-soft");
    pen.textAlign = "right";
    const every = Math.max(1, Math.ceil(n / 9));
    for (let s = first; s < first + n; s += every) pen.fillText(s, PAD.left - 6, level(s) + 4);
    pen.textAlign = "center";
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((x) => (1e3 * duration) / x <= 8) ?? 100;
    for (let t = 0; t <= 1e3 * duration + 1e-9; t += step) {
      pen.fillText(digits(t), place(t / 1e3), box.clientHeight - 18);
    }
    pen.fillText("time [ms]", (PAD.left + place(duration)) / 2, box.clientHeight - 3);
    pen.save();
    pen.translate(11, PAD.top + rows() / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(wall ? "sphere (1 = striker; wall below)" : "sphere (1 = striker)", 0, 0);
    pen.restore();
  }

  function followed(pen) {
    pen.strokeStyle = pen.fillStyle = colour("ink");
    pen.lineWidth = 1;
    const names = [];
    for (const track of tracks) {
      const ends = [[track.start_s, track.from_contact + 0.5], [track.end_s, track.to_contact + 0.5]];
      pen.setLineDash([4, 3]);
      pen.beginPath();
      for (const [t, s] of ends) pen.lineTo(place(t), level(s));
      pen.stroke();
      pen.setLineDash([]);
      // where the wave ends, or before the edge of the map if that is cut
      const [t, s] = ends[1];
      const late = t > 0.85 * duration;
      pen.textAlign = late ? "right" : "left";
      label(pen, names, track.name, place(Math.min(t, duration)) + (late ? -4 : 4), level(s));
    }
  }

  /** A name at x, below those that stand in its way, or above. */
  function label(pen, names, text, x, y) {
    const lowest = PAD.top + rows() - 4;
    let inside = Math.min(Math.max(y, PAD.top + 10), lowest);
    const wide = pen.measureText(text).width;
    const from = pen.textAlign === "right" ? x - wide : x;
    const meets = (other) => Math.abs(other.y - inside) < 13 && other.from < from + wide && from < other.to;
    // below those in its way, above them where the map ends
    const wanted = inside;
    while (names.some(meets) && inside + 14 <= lowest) inside += 14;
    if (names.some(meets)) inside = wanted;
    while (names.some(meets) && inside > PAD.top + 24) inside -= 14;
    names.push({ from, to: from + wide, y: inside });
    pen.lineWidth = 3;
    pen.strokeStyle = colour("paper");
    pen.strokeText(text, x, inside);
    pen.fillText(text, x, inside);
    pen.lineWidth = 1;
    pen.strokeStyle = colour("ink");
  }

  function follow(t) {
    head.style.setProperty("transform", `translateX(${place(t)}px)`);
  }

  function timeAt(event) {
    const x = event.clientX - box.getBoundingClientRect().left;
    return Math.min(Math.max(((x - PAD.left) / (place(duration) - PAD.left)) * duration, 0), duration);
  }

  box.addEventListener("pointermove", (event) => {
    const t = timeAt(event);
    const y = event.clientY - box.getBoundingClientRect().top - PAD.top;
    const j = Math.min(Math.max(Math.floor((y / rows()) * n), 0), n - 1);
    const value = v[j][Math.round(t / dt)];
    tip.textContent = `sphere ${first + j}, ${digits(1e3 * t, 4)} ms: ${si(value, "m/s")}`;
    if (event.buttons) clock.seek(t);
  });
  box.addEventListener("pointerdown", (event) => clock.seek(timeAt(event)));
  box.addEventListener("pointerleave", () => (tip.textContent = ""));
  clock.onTime(follow);
  onTheme(draw);
  new ResizeObserver(draw).observe(box);
}
