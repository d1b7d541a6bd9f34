// A camera that turns about a point, one direction stays upright: drag turns, with Shift moves, the
// wheel after a click zooms.

import { cross, dot, unit } from "./mesh.js";

const OPENING = 28; // degrees, of the height
const WORDS = 36; // pixels of the view above and below

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

  /** Stand as near as all parts are in view from a direction, each of points (3 numbers each) that
      move as far as its reach: each side of the view is a plane through the eye, which the farthest
      point out touches. Above and below is room for words. */
  function fit(parts, away) {
    state.away = unit(away);
    const [right, up] = axes();
    const opening = Math.tan((OPENING * Math.PI) / 360);
    const free = 1 - (2 * WORDS) / Math.max(canvas.clientHeight, 4 * WORDS);
    const [width, height] = [0.97 * camera.aspect * opening, free * opening];
    const most = { right: -Infinity, left: -Infinity, up: -Infinity, down: -Infinity };
    const depth = [Infinity, -Infinity];
    for (const { points, reach } of parts) {
      for (let i = 0; i < points.length; i += 3) {
        const p = [points[i], points[i + 1], points[i + 2]];
        const [x, y, z] = [dot(p, right), dot(p, up), dot(p, state.away)];
        most.right = Math.max(most.right, x + width * z + reach);
        most.left = Math.max(most.left, width * z - x + reach);
        most.up = Math.max(most.up, y + height * z + reach);
        most.down = Math.max(most.down, height * z - y + reach);
        depth[0] = Math.min(depth[0], z);
        depth[1] = Math.max(depth[1], z);
      }
    }
    const [x, y] = [(most.right - most.left) / 2, (most.up - most.down) / 2];
    const [eye, z] = [
      Math.max((most.right + most.left) / (2 * width), (most.up + most.down) / (2 * height)),
      (depth[0] + depth[1]) / 2,
    ];
    state.target = [0, 1, 2].map((j) => x * right[j] + y * up[j] + z * state.away[j]);
    state.distance = eye - z;
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
