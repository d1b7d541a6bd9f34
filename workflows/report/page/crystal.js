// A crystal in the 3-D view: its spheres at the play head.

import { stored } from "./arrays.js";
import { stageOf } from "./stage.js";
import { onTheme } from "./theme.js";
import { digits, rounded } from "./words.js";

const SPHERES = 0.9; // of a radius, that the largest displacement is drawn as

/** The view with its controls; returns what tests ask of it. */
export function crystalView(root, data, clock) {
  const { crystal } = data;
  const rest = stored(crystal.rest);
  const radius = stored(crystal.radius);
  const [k] = crystal.u.shape;
  const n = radius.length;
  const u = stored(crystal.u); // (k, 3 n) and (k, n), in units of `scale`
  const v = stored(crystal.v);
  const most = crystal.shown_speed / crystal.v_scale;
  const reach = { balls: SPHERES * Math.min(...radius) };
  const factor = crystal.most ? rounded(reach.balls / crystal.most) : 0;
  const stage = stageOf(root.querySelector("canvas"), {
    ...data, crystal: { rest, radius }, reach, chain: null, assembly: null,
  });
  const moved = new Float32Array(3 * n);
  const speed = new Float32Array(n);
  const scale = root.querySelector("input[name=scale]");
  let exaggeration = 1;

  /** Between two saved instants, into the arrays that are drawn. */
  function now(t) {
    const place = Math.min(Math.max(t / crystal.dt, 0), k - 1);
    const before = Math.min(Math.floor(place), Math.max(k - 2, 0));
    const part = place - before;
    const after = Math.min(before + 1, k - 1);
    for (let i = 0; i < 3 * n; i++) {
      const a = u[3 * n * before + i];
      moved[i] = crystal.u_scale * (a + part * (u[3 * n * after + i] - a));
    }
    for (let i = 0; i < n; i++) {
      const a = v[n * before + i];
      speed[i] = a + part * (v[n * after + i] - a);
    }
  }

  function draw() {
    stage.move(clock.playing);
    now(clock.time);
    stage.setBalls(moved, exaggeration * factor, speed, most);
    stage.draw();
  }

  function told() {
    const by = digits(exaggeration * factor, 3);
    root.querySelector(".factors").textContent = `displacements drawn spheres × ${by}`;
  }

  scale?.addEventListener("input", () => {
    exaggeration = 10 ** Number(scale.value);
    told();
    draw();
  });
  root.querySelector("button.fit")?.addEventListener("click", stage.fit);
  root.querySelector(".colour-bar").hidden = true;
  clock.onTime(draw);
  clock.onSlow(stage.coarsen);
  onTheme(stage.recolour);
  told();
  draw();
  return {
    draw,
    /** Displacement [m] of a sphere (number from 0) at a time. */
    displacement(sphere, t) {
      now(t);
      return Array.from(moved.subarray(3 * sphere, 3 * sphere + 3));
    },
  };
}
