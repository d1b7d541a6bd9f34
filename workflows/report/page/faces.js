// The faces of an assembly: a click on one shows the words of a scene that pick it.

import { cameraOf } from "./camera.js";
import { LINES } from "./lines.js";
import { outline } from "./mesh.js";
import { curveColour, onTheme } from "./theme.js";

const SURFACE = {
  vertex: `#version 300 es
    in vec3 position;
    uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix;
    out vec3 place;
    void main() {
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      place = seen.xyz;
      gl_Position = projectionMatrix * seen;
    }`,
  fragment: `#version 300 es
    precision highp float;
    in vec3 place; uniform vec3 tint; uniform float picked; out vec4 colour;
    void main() {
      vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
      float light = 0.5 + 0.5 * abs(dot(normal, normalize(vec3(0.25, 0.45, 1.0))));
      colour = vec4(mix(light * mix(tint, vec3(1.0), 0.35), vec3(0.95, 0.45, 0.1), picked), 1.0);
    }`,
};
const { faces } = JSON.parse(document.getElementById("data").textContent);
const panel = document.getElementById("picked");
const rows = [...document.querySelectorAll("tbody tr")];
const view = viewOf(document.getElementById("view"));

rows.forEach((row, i) => row.addEventListener("click", () => pick(i)));

/** Show the selectors of a face, and the face in orange. */
function pick(i) {
  rows.forEach((row, j) => row.classList.toggle("picked", i === j));
  view?.show(i);
  const { body, kind, selectors } = faces[i];
  panel.replaceChildren(element("h2", `${body}: ${kind}`));
  for (const { text, faces: n } of selectors) {
    const line = element("p", "");
    const button = element("button", "copy");
    button.addEventListener("click", () => {
      navigator.clipboard?.writeText(`"${text}"`);
      button.textContent = "copied";
    });
    const also = n === 1 ? "this face alone" : `this and ${n - 1} more face${n === 2 ? "" : "s"}`;
    line.append(element("code", `"${text}"`), " ", button, ` ${also}`);
    panel.append(line);
  }
}

function element(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

/** The 3-D view, null where the browser draws none. */
function viewOf(canvas) {
  let renderer;
  try {
    renderer = new OGL.Renderer({ canvas, webgl: 2, alpha: true, antialias: true, preserveDrawingBuffer: true, dpr: Math.min(devicePixelRatio, 2) });
  } catch {
    return null;
  }
  const gl = renderer.gl;
  const scene = new OGL.Transform();
  const bodies = [...new Set(faces.map((face) => face.body))];
  const solids = faces.map(({ body, points }) => {
    const position = new Float32Array(points);
    const corners = Uint32Array.from(position, (_, i) => i).subarray(0, points.length / 3);
    const uniforms = { tint: { value: [0, 0, 0] }, picked: { value: 0 } };
    const program = new OGL.Program(gl, { ...SURFACE, uniforms, cullFace: false });
    const geometry = new OGL.Geometry(gl, { position: { size: 3, data: position } });
    new OGL.Mesh(gl, { geometry, program }).setParent(scene);

    // edges of the face: those of its triangles that no other one has
    const [joined, merged] = together(position, corners);
    const index = outline(joined, merged, 3);
    const line = new OGL.Geometry(gl, { position: { size: 3, data: joined }, index: { data: index } });
    const black = new OGL.Program(gl, { ...LINES, uniforms: { tint: { value: [0.1, 0.13, 0.16] } } });
    new OGL.Mesh(gl, { mode: gl.LINES, geometry: line, program: black }).setParent(scene);
    return { position, uniforms, number: bodies.indexOf(body) };
  });
  const eye = cameraOf(gl, canvas, draw, [0, 0, 1]);

  function draw() {
    renderer.render({ scene, camera: eye.camera });
  }

  function paint() {
    for (const { uniforms, number } of solids) {
      const hex = curveColour(number).slice(1);
      uniforms.tint.value = [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
    }
    draw();
  }

  function resize() {
    renderer.setSize(canvas.parentElement.clientWidth, canvas.parentElement.clientHeight);
    eye.camera.aspect = canvas.clientWidth / canvas.clientHeight;
    eye.fit(solids.map(({ position }) => ({ points: position, reach: 0 })), [0.6, -0.75, 0.45]);
    draw();
  }

  /** The nearest face under a point of the canvas, in pixels; -1 for none. */
  function under(x, y) {
    const m = eye.camera.projectionViewMatrix;
    const [u, v] = [(2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight];
    let [nearest, found] = [Infinity, -1];
    solids.forEach(({ position }, number) => {
      for (let i = 0; i < position.length; i += 9) {
        const [a, b, c] = [0, 3, 6].map((j) => {
          const [px, py, pz] = position.subarray(i + j, i + j + 3);
          const [X, Y, Z, W] = [0, 1, 2, 3].map((k) => m[k] * px + m[4 + k] * py + m[8 + k] * pz + m[12 + k]);
          return [X / W, Y / W, Z / W];
        });
        const area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        const s = ((u - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (v - a[1])) / area;
        const t = ((b[0] - a[0]) * (v - a[1]) - (u - a[0]) * (b[1] - a[1])) / area;
        if (!(s >= 0 && t >= 0 && s + t <= 1)) continue;
        const depth = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]);
        if (depth < nearest) [nearest, found] = [depth, number];
      }
    });
    return found;
  }

  let pressed = null;
  canvas.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
  canvas.addEventListener("pointerup", (event) => {
    const moved = Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]);
    if (moved > 4) return; // the view was turned
    const box = canvas.getBoundingClientRect();
    const i = under(event.clientX - box.left, event.clientY - box.top);
    if (i >= 0) pick(i);
  });
  addEventListener("resize", resize);
  onTheme(paint);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  paint();
  resize();
  return {
    show(i) {
      solids.forEach(({ uniforms }, j) => (uniforms.picked.value = i === j ? 1 : 0));
      draw();
    },
  };
}

/** Points that each stand once, and the numbers of the corners among them. */
function together(position, corners) {
  const number = new Map();
  const points = [];
  const merged = corners.map((corner) => {
    const point = position.subarray(3 * corner, 3 * corner + 3);
    const key = point.join();
    if (!number.has(key)) {
      number.set(key, points.length / 3);
      points.push(...point);
    }
    return number.get(key);
  });
  return [new Float32Array(points), merged];
}
