// The impact and the modes in the 3-D view: what is drawn at the play head, and the controls.

import { between, column, columns, largest, stored } from "./arrays.js";
import { largestNode, motionOf } from "./motion.js";
import { stageOf } from "./stage.js";
import { onTheme } from "./theme.js";
import { digits, rounded, si } from "./words.js";

const SHARE = 0.06; // of the assembly's size that its largest displacement is drawn as
const SPHERES = 0.9; // of a radius, the same for spheres
const SWING = 1.6; // s of a mode's period, as shown

/** The assembly's arrays as the view takes them, from the contact point on. */
function solidOf(assembly) {
  const points = columns(assembly.points);
  const rest = new Float32Array(3 * points[0].length);
  points.forEach((values, j) => values.forEach((value, i) => (rest[3 * i + j] = value)));
  return {
    rest, faces: stored(assembly.faces), width: assembly.faces.shape[1],
  };
}

/** The view with its controls; returns what tests and the table of modes ask of it. */
export function impactView(root, data, clock) {
  const { assembly, chain } = data;
  const solid = assembly && solidOf(assembly);
  const motion = assembly && motionOf(assembly);
  const size = solid && extent(solid.rest);
  const reach = { solid: SHARE * size, balls: chain && SPHERES * Math.min(...chain.radius) };
  const stage = stageOf(root.querySelector("canvas"), { ...data, assembly: solid, reach });
  const moving = chain && Boolean(!assembly || assembly.q);
  const u = solid && new Float32Array(solid.rest.length);
  const x = chain && columns(chain.x);
  const v = chain && columns(chain.v);
  const wall = chain && column(chain.wall_x, 0);
  const most = {
    u: assembly?.q ? motion.peak(clock.duration) : 0, x: chain && largest(x), v: chain && largest(v),
    wall: chain && largest([wall]),
  };
  const factor = {
    u: most.u ? rounded(reach.solid / most.u) : 0,
    x: most.x ? rounded(reach.balls / most.x) : 0,
    wall: most.wall ? rounded((0.6 * chain.radius.at(-1)) / most.wall) : 0,
  };
  const state = { exaggeration: 1, mode: null, swing: 0, swinging: true };
  const scale = root.querySelector("input[name=scale]");
  const factors = root.querySelector(".factors");
  const bar = root.querySelector(".colour-bar");
  let last = 0;

  function spheres(t) {
    const place = t / chain.dt;
    const now = (series) => series.map((_, i) => between(series, place, i));
    stage.setBalls(now(x), state.exaggeration * factor.x, now(v), most.v);
    stage.setWall?.(state.exaggeration * factor.wall * between([wall], place, 0));
  }

  function drawImpact(t) {
    if (chain) spheres(t);
    if (assembly?.q) stage.setSolid(motion.atTime(t, u), state.exaggeration * factor.u, most.u);
    stage.draw();
  }

  function drawMode() {
    const amplitude = Math.sin(2 * Math.PI * state.swing);
    motion.inMode(assembly.of_mode[state.mode], amplitude, u);
    stage.setSolid(u, state.exaggeration * reach.solid, Math.max(Math.abs(amplitude), 1e-6));
    stage.draw();
  }

  function draw() {
    stage.move(clock.playing || state.mode !== null);
    if (state.mode === null) drawImpact(clock.time);
    else drawMode();
  }

  function swing(now) {
    if (state.mode === null || !state.swinging) return;
    if (last) state.swing += (now - last) / 1000 / SWING;
    last = now;
    drawMode();
    requestAnimationFrame(swing);
  }

  function told() {
    const by = (value) => `× ${digits(state.exaggeration * value, 3)}`;
    if (state.mode !== null) factors.textContent = "shape, arbitrary amplitude";
    else {
      const parts = [];
      if (factor.u) parts.push(`assembly ${by(factor.u)}`);
      if (factor.wall && !assembly) parts.push(`wall ${by(factor.wall)}`);
      if (factor.x) parts.push(`spheres ${by(factor.x)}`);
      factors.textContent = `displacements drawn ${parts.join(", ")}`;
    }
    if (bar) {
      bar.hidden = !assembly;
      const top = state.mode === null ? si(most.u, "m") : "largest";
      bar.querySelector(".most").textContent = top;
    }
  }

  /** Show a mode by its row in the table, or the impact where it is null. */
  function show(mode) {
    if (mode === null && !moving) return;
    const before = state.mode;
    Object.assign(state, { mode, swing: 0.25, swinging: true });
    stage.only(mode === null ? "all" : "assembly");
    if (mode !== null) clock.play(false);
    root.classList.toggle("in-mode", mode !== null);
    for (const button of root.querySelectorAll("button[data-mode]")) {
      const own = button.dataset.mode === "" ? null : Number(button.dataset.mode);
      button.setAttribute("aria-pressed", String(own === mode));
    }
    told();
    draw();
    last = 0;
    if (mode !== null && before === null) requestAnimationFrame(swing);
  }

  root.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-mode]");
    if (button) show(button.dataset.mode === "" ? null : Number(button.dataset.mode));
  });
  scale?.addEventListener("input", () => {
    state.exaggeration = 10 ** Number(scale.value);
    told();
    draw();
  });
  root.querySelector("button.fit")?.addEventListener("click", stage.fit);
  clock.onTime(() => {
    if (state.mode === null) draw();
    else if (clock.playing) show(null);
  });
  clock.onSlow(stage.coarsen);
  onTheme(stage.recolour);
  told();
  draw();
  if (!moving && assembly) show(assembly.of_mode.findIndex((place) => place >= 0));
  return {
    show, draw,
    /** w . u(t), and the displacement of a node, both from rest. */
    atContact: motion?.atContact,
    displacement(node, t) {
      const moved = motion.atTime(t, new Float32Array(u.length));
      return Array.from(moved.subarray(3 * node, 3 * node + 3));
    },
  };
}

function extent(points) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  points.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  return Math.hypot(...low.map((value, j) => high[j] - value)) || largestNode(points);
}
