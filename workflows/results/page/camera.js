// A camera that turns about a point, one direction stays upright: drag turns, with Shift moves, the
// wheel after a click zooms.

import { cross, dot, unit } from "./mesh.js";

const OPENING = 28; // degrees, of the shorter side

export function cameraOf(gl, canvas, redraw, upright) {
  const camera = new OGL.Camera(gl, { fov: OPENING, near: 0.001, far: 100 });
  const state = { away: [0, -1, 0], target: [0, 0, 0], distance: 1 };

  function place() {
    const { away, target, distance } = state;
    camera.position.set(...target.map((x, i) => x + distance * away[i]));
    camera.up.set(...upright);
    camera.lookAt(target);
    camera.perspective({ near: 0.05 * distance, far: 20 * distance });
  }

  /** Axes to the right and up on the screen. */
  function axes() {
    const right = unit(cross(upright, state.away));
    return [right, cross(state.away, right)];
  }

  /** Stand so that all points (3 each) are in view, looking from a direction. */
  function fit(points, away, margin = 1.06) {
    state.away = unit(away);
    const [right, up] = axes();
    const [width, height] = [camera.aspect, 1].map((x) => x * Math.tan((OPENING * Math.PI) / 360));
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < points.length; i += 3) {
      for (let j = 0; j < 3; j++) {
        low[j] = Math.min(low[j], points[i + j]);
        high[j] = Math.max(high[j], points[i + j]);
      }
    }
    state.target = low.map((x, j) => (x + high[j]) / 2);
    // a few steps towards the middle of what the picture shows
    for (let round = 0; round < 4; round++) {
      state.distance = 0;
      const sides = [Infinity, -Infinity, Infinity, -Infinity];
      for (let i = 0; i < points.length; i += 3) {
        const p = [0, 1, 2].map((j) => points[i + j] - state.target[j]);
        const [x, y, z] = [dot(p, right), dot(p, up), dot(p, state.away)];
        state.distance = Math.max(state.distance, Math.abs(x) / width + z, Math.abs(y) / height + z);
        sides[0] = Math.min(sides[0], x);
        sides[1] = Math.max(sides[1], x);
        sides[2] = Math.min(sides[2], y);
        sides[3] = Math.max(sides[3], y);
      }
      const [dx, dy] = [(sides[0] + sides[1]) / 2, (sides[2] + sides[3]) / 2];
      if (round < 3) state.target = state.target.map((c, j) => c + dx * right[j] + dy * up[j]);
    }
    state.distance *= margin;
    place();
  }

  function turn(dx, dy) {
    const [right, up] = axes();
    const moved = unit(state.away.map((x, i) => x - 0.008 * dx * right[i] + 0.008 * dy * up[i]));
    if (Math.abs(dot(moved, upright)) < 0.99) state.away = moved;
  }

  function move(dx, dy) {
    const [right, up] = axes();
    const step = (2 * state.distance * Math.tan((OPENING * Math.PI) / 360)) / canvas.clientHeight;
    state.target = state.target.map((x, i) => x - step * (dx * right[i] - dy * up[i]));
  }

  function zoom(factor) {
    state.distance *= factor;
    place();
    redraw();
  }

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.focus({ preventScroll: true });
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    (event.shiftKey || event.buttons & 2 ? move : turn)(event.movementX, event.movementY);
    place();
    redraw();
  });
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas) return; // else the page scrolls
      event.preventDefault();
      zoom(Math.exp(0.001 * event.deltaY));
    },
    { passive: false },
  );
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  const KEYS = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] };
  canvas.addEventListener("keydown", (event) => {
    if (KEYS[event.key]) {
      event.preventDefault();
      turn(...KEYS[event.key]);
      place();
      redraw();
    }
    if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 0.9 : 1.1);
  });
  return { camera, fit, zoom };
}
