// The 3-D view: the assembly, or a simple wall in its place, and the spheres before it.

import { cameraOf } from "./camera.js";
import { LINES } from "./lines.js";
import { cross, dot, outline, triangles, unit } from "./mesh.js";
import { rgb } from "./theme.js";
import { wallOf } from "./wall.js";

const SURFACE = {
  vertex: `#version 300 es
    in vec3 position; in float size;
    uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix;
    out vec3 place; out float amount;
    void main() {
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      place = seen.xyz; amount = size;
      gl_Position = projectionMatrix * seen;
    }`,
  fragment: `#version 300 es
    precision highp float;
    in vec3 place; in float amount;
    uniform vec3 ramp[4]; uniform float most;
    out vec4 colour;
    void main() {
      vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
      float light = 0.42 + 0.58 * abs(dot(normal, normalize(vec3(0.25, 0.45, 1.0))));
      float s = 3.0 * clamp(amount / most, 0.0, 1.0);
      vec3 base = s < 1.0 ? mix(ramp[0], ramp[1], s)
        : s < 2.0 ? mix(ramp[1], ramp[2], s - 1.0) : mix(ramp[2], ramp[3], s - 2.0);
      colour = vec4(light * base, 1.0);
    }`,
};

const SPHERES = {
  vertex: `#version 300 es
    in vec3 position; in vec3 normal; in vec4 sphere; in float speed;
    uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix; uniform mat3 normalMatrix;
    out vec3 out_normal; out float amount;
    void main() {
      out_normal = normalMatrix * normal; amount = speed;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(sphere.xyz + sphere.w * position, 1.0);
    }`,
  fragment: `#version 300 es
    precision highp float;
    in vec3 out_normal; in float amount;
    uniform vec3 towards; uniform vec3 rest; uniform vec3 away; uniform float most;
    out vec4 colour;
    void main() {
      vec3 normal = normalize(out_normal);
      float light = 0.4 + 0.6 * max(0.0, dot(normal, normalize(vec3(0.25, 0.45, 1.0))));
      float s = clamp(amount / most, -1.0, 1.0);
      float share = sign(s) * sqrt(abs(s)); // small velocities are seen as well
      vec3 base = mix(rest, share > 0.0 ? towards : away, abs(share));
      float shine = pow(max(0.0, dot(normal, normalize(vec3(0.2, 0.5, 1.0)))), 40.0);
      colour = vec4(light * base + 0.35 * shine, 1.0);
    }`,
};

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/** What draws it in this browser, null where nothing does. */
export function drawnBy() {
  try {
    const gl = document.createElement("canvas").getContext("webgl2");
    return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
  } catch {
    return null;
  }
}

/** The view on a canvas; assembly and chain may each be absent, points are from the contact on. Reach
    is how far either moves [m], as drawn. */
export function stageOf(canvas, { assembly, chain, crystal, wall, direction, up, reach }) {
  const software = SOFTWARE.test(drawnBy());
  // pixels of the canvas for one of the page, at rest and in motion; a processor smooths edges no faster
  const full = software ? 1.5 : Math.min(devicePixelRatio, 2);
  let moving = software ? 0.6 : full;
  const renderer = new OGL.Renderer({
    canvas, webgl: 2, alpha: true, antialias: !software, preserveDrawingBuffer: true, dpr: full,
  });
  const gl = renderer.gl;
  const scene = new OGL.Transform();
  const solid = assembly && solidOf(gl, scene, assembly);
  const balls = crystal
    ? crystalOf(gl, scene, crystal)
    : chain && ballsOf(gl, scene, chain, direction);
  const simple = !assembly && chain && wall ? wallOf(gl, scene, wall, chain, { LINES, SURFACE }) : null;
  const eye = cameraOf(gl, canvas, draw, up);
  let shown = "all";

  function draw() {
    renderer.render({ scene, camera: eye.camera });
  }

  /** What is to be seen, with how far it moves as drawn. */
  function parts() {
    const found = [];
    if (solid) found.push({ points: solid.rest, reach: reach.solid });
    if (simple) found.push({ points: simple.corners, reach: 0 });
    if (balls && shown === "all") found.push({ points: balls.corners, reach: reach.balls });
    return found;
  }

  /** Stand so that all is seen: obliquely from before the contact, and above. */
  function fit() {
    const upright = Math.abs(dot(direction, up)) > 0.8;
    const level = unit(cross(Math.abs(up[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0], up));
    const aside = cross(up, level);
    const from = upright
      ? (i) => 0.55 * level[i] - aside[i] + 0.7 * up[i]
      : (i) => cross(direction, up)[i] - 0.62 * direction[i] + 0.5 * up[i];
    eye.fit(parts(), [0, 1, 2].map(from));
    draw();
  }

  function resize() {
    const { clientWidth, clientHeight } = canvas.parentElement;
    if (!clientWidth) return;
    renderer.setSize(clientWidth, clientHeight);
    eye.camera.perspective({ aspect: clientWidth / clientHeight });
    fit();
  }

  /** Fewer pixels while it moves, for a machine that is slow to draw. */
  function coarsen() {
    moving = Math.max(0.7 * moving, 0.5);
  }

  /** All pixels at rest, in motion those that are drawn in time. */
  function move(on) {
    const { clientWidth, clientHeight } = canvas.parentElement;
    const wanted = on ? moving : full;
    if (renderer.dpr === wanted) return;
    renderer.dpr = wanted;
    renderer.setSize(clientWidth, clientHeight);
  }

  function recolour() {
    solid?.recolour();
    balls?.recolour();
    simple?.recolour();
    if (canvas.clientWidth !== canvas.parentElement.clientWidth) resize();
    draw();
  }

  recolour();
  new ResizeObserver(resize).observe(canvas.parentElement);
  resize();
  return {
    draw, fit, recolour, coarsen, move, zoom: eye.zoom, direction,
    setSolid: solid?.set, setBalls: balls?.set, setWall: simple?.set,
    /** Show all, or the assembly alone. */
    only(what) {
      if (shown === what) return;
      shown = what;
      if (balls) balls.mesh.visible = what === "all";
      fit();
    },
  };
}

function solidOf(gl, scene, assembly) {
  const { rest, faces, width } = assembly;
  const position = Float32Array.from(rest);
  const size = new Float32Array(rest.length / 3);
  const edges = outline(rest, faces, width);
  const dynamic = { usage: gl.DYNAMIC_DRAW };
  const surface = new OGL.Geometry(gl, {
    position: { size: 3, data: position, ...dynamic },
    size: { size: 1, data: size, ...dynamic },
    index: { data: triangles(faces, width) },
  });
  const lines = new OGL.Geometry(gl, {
    position: { size: 3, data: position, ...dynamic },
    index: { data: edges },
  });
  const paint = new OGL.Program(gl, {
    ...SURFACE, cullFace: false, uniforms: { ramp: { value: [] }, most: { value: 1 } },
  });
  const ink = new OGL.Program(gl, { ...LINES, uniforms: { tint: { value: [0, 0, 0] } } });
  new OGL.Mesh(gl, { geometry: surface, program: paint, frustumCulled: false }).setParent(scene);
  new OGL.Mesh(gl, {
    geometry: lines, program: ink, mode: gl.LINES, frustumCulled: false,
  }).setParent(scene);

  /** Displacements u times a factor, coloured by their size over `most`. */
  function set(u, factor, most) {
    for (let i = 0; i < position.length; i++) position[i] = rest[i] + factor * u[i];
    for (let i = 0; i < size.length; i++) {
      size[i] = Math.hypot(u[3 * i], u[3 * i + 1], u[3 * i + 2]);
    }
    paint.uniforms.most.value = most || 1;
    for (const geometry of [surface, lines]) geometry.attributes.position.needsUpdate = true;
    surface.attributes.size.needsUpdate = true;
  }

  function recolour() {
    paint.uniforms.ramp.value = [0, 1, 2, 3].flatMap((i) => rgb(`ramp-${i}`));
    ink.uniforms.tint.value = rgb("edge");
  }

  return { rest, set, recolour };
}

const FINE = [24, 16]; // segments of a ball, of few balls
const COARSE = [10, 7]; // of more than MANY: 20,000 are three million triangles
const MANY = 1500;

/** Balls of radii (n), each at `place` (x, y, z, radius), coloured by its signed speed. */
function instancesOf(gl, scene, radius) {
  const n = radius.length;
  const [widthSegments, heightSegments] = n > MANY ? COARSE : FINE;
  const ball = new OGL.Sphere(gl, { radius: 1, widthSegments, heightSegments });
  const place = new Float32Array(4 * n);
  const speed = new Float32Array(n);
  const { position, normal, index } = ball.attributes;
  const geometry = new OGL.Geometry(gl, {
    position: { size: 3, data: position.data },
    normal: { size: 3, data: normal.data },
    index: { data: index.data },
    sphere: { size: 4, data: place, instanced: 1, usage: gl.DYNAMIC_DRAW },
    speed: { size: 1, data: speed, instanced: 1, usage: gl.DYNAMIC_DRAW },
  });
  const uniforms = Object.fromEntries(
    ["towards", "rest", "away", "most"].map((name) => [name, { value: 1 }]),
  );
  const program = new OGL.Program(gl, { ...SPHERES, uniforms });
  const mesh = new OGL.Mesh(gl, { geometry, program, frustumCulled: false });
  mesh.setParent(scene);
  for (let i = 0; i < n; i++) place[4 * i + 3] = radius[i];

  function changed(most) {
    uniforms.most.value = most || 1;
    geometry.attributes.sphere.needsUpdate = true;
    geometry.attributes.speed.needsUpdate = true;
  }

  function recolour() {
    for (const name of ["towards", "rest", "away"]) uniforms[name].value = rgb(`sphere-${name}`);
  }

  return { mesh, place, speed, changed, recolour };
}

/** Corners about balls of radii at centres (3 per ball), for the camera. */
function cornersOf(centre, radius) {
  const corners = [];
  for (let i = 0; i < radius.length; i++) {
    for (const [dx, dy, dz] of [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]) {
      const R = radius[i];
      corners.push(centre[3 * i] + dx * R, centre[3 * i + 1] + dy * R, centre[3 * i + 2] + dz * R);
    }
  }
  return corners;
}

/** A crystal's spheres: `rest` (3 per sphere) and radii. */
function crystalOf(gl, scene, { rest, radius }) {
  const { mesh, place, speed, changed, recolour } = instancesOf(gl, scene, radius);

  /** Displacements u (3 per sphere) times a factor, coloured by speeds v over `most`. */
  function set(u, factor, v, most) {
    for (let i = 0; i < radius.length; i++) {
      for (let j = 0; j < 3; j++) place[4 * i + j] = rest[3 * i + j] + factor * u[3 * i + j];
      speed[i] = v[i];
    }
    changed(most);
  }

  set(new Float32Array(rest.length), 0, speed, 1);
  return { mesh, set, recolour, corners: cornersOf(rest, radius) };
}

/** One chain along a direction: its last sphere touches the contact point, each lies before the
    next. */
function rowOf(radius, direction) {
  let before = 0;
  const centre = Array.from(radius);
  for (let i = radius.length - 1; i >= 0; i--) {
    centre[i] = -before - radius[i];
    before += 2 * radius[i];
  }
  return {
    rest: centre.flatMap((c) => direction.map((d) => d * c)), along: centre.flatMap(() => direction),
  };
}

/** Spheres that move along lines: of one chain, or where `rest` and `along` (3 per sphere) say. */
function ballsOf(gl, scene, chain, direction) {
  const radius = chain.radius;
  const n = radius.length;
  const { mesh, place, speed, changed, recolour } = instancesOf(gl, scene, radius);
  const { rest, along } = chain.rest ? chain : rowOf(radius, direction);

  /** Displacements x (n) towards the wall times a factor, coloured by velocities v over `most`. */
  function set(x, factor, v, most) {
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < 3; j++) {
        place[4 * i + j] = rest[3 * i + j] + factor * x[i] * along[3 * i + j];
      }
      speed[i] = v[i];
    }
    changed(most);
  }

  const corners = cornersOf(rest, radius);
  set(new Float32Array(n), 0, speed, 1);
  return { mesh, set, recolour, corners };
}
