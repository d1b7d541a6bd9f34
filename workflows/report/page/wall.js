// What stands for a wall without a shape of its own: a slab, moving or not, and what holds it.

import { rgb } from "./theme.js";

const TURNS = 7; // of the spring

/** The wall of a kind before a chain along x; its set(x) moves it. */
export function wallOf(gl, scene, kind, chain, { LINES, SURFACE }) {
  const R = chain.radius[chain.radius.length - 1];
  const thick = (kind === "half-space" ? 5 : 0.6) * R;
  const tall = (kind === "half-space" ? 5 : 3) * R;
  const moves = kind !== "rigid" && kind !== "half-space";
  const ground = 7 * R;
  const ink = new OGL.Program(gl, { ...LINES, uniforms: { tint: { value: [0, 0, 0] } } });
  const paint = new OGL.Program(gl, {
    ...SURFACE, cullFace: false, uniforms: { ramp: { value: [] }, most: { value: 1 } },
  });
  const slab = new OGL.Transform();
  slab.setParent(scene);
  lines(gl, slab, ink, box(0, thick, tall));
  solid(gl, slab, paint, 0, thick, tall);
  if (kind === "rigid") lines(gl, scene, ink, hatch(thick, tall));
  if (moves) {
    lines(gl, scene, ink, [...box(ground, ground + 0.1 * R, tall), ...hatch(ground + 0.1 * R, tall)]);
    solid(gl, scene, paint, ground, ground + 0.1 * R, tall);
  }
  const link = moves ? lines(gl, scene, ink, linkOf(kind, thick, ground, R)) : null;

  /** Move the slab to x [m], as drawn. */
  function set(x) {
    if (!moves) return;
    slab.position.x = x;
    link.change(linkOf(kind, thick + x, ground, R));
  }

  const corners = [0, moves ? ground : thick].flatMap((x) =>
    [[1, 1], [1, -1], [-1, 1], [-1, -1]].flatMap(([y, z]) => [x, (y * tall) / 2, (z * tall) / 2]),
  );
  return {
    set, corners,
    recolour() {
      ink.uniforms.tint.value = rgb("ink-soft");
      paint.uniforms.ramp.value = [0, 1, 2, 3].flatMap((i) => rgb(`ramp-${i}`));
    },
  };
}

/** The faces of a box from x0 to x1. */
function solid(gl, parent, program, x0, x1, tall) {
  const h = tall / 2;
  const corner = (i) => [i & 1 ? x1 : x0, i & 2 ? h : -h, i & 4 ? h : -h];
  const faces = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];
  const geometry = new OGL.Geometry(gl, {
    position: { size: 3, data: Float32Array.from([0, 1, 2, 3, 4, 5, 6, 7].flatMap(corner)) },
    size: { size: 1, data: new Float32Array(8) },
    index: { data: new Uint16Array(faces.flatMap(([a, b, c, d]) => [a, b, c, a, c, d])) },
  });
  new OGL.Mesh(gl, { geometry, program, frustumCulled: false }).setParent(parent);
}

function lines(gl, scene, program, points) {
  const data = Float32Array.from(points);
  const geometry = new OGL.Geometry(gl, { position: { size: 3, data, usage: gl.DYNAMIC_DRAW } });
  const mesh = new OGL.Mesh(gl, { geometry, program, mode: gl.LINES, frustumCulled: false });
  mesh.setParent(scene);
  return {
    change(moved) {
      data.set(moved);
      geometry.attributes.position.needsUpdate = true;
    },
  };
}

function segment(a, b) {
  return [...a, ...b];
}

/** Edges of a box from x0 to x1, of height and width `tall`. */
function box(x0, x1, tall) {
  const h = tall / 2;
  const square = [[-h, -h], [h, -h], [h, h], [-h, h]];
  const found = [];
  square.forEach(([y, z], i) => {
    const [y1, z1] = square[(i + 1) % 4];
    for (const x of [x0, x1]) found.push(...segment([x, y, z], [x, y1, z1]));
    found.push(...segment([x0, y, z], [x1, y, z]));
  });
  return found;
}

/** Slanting strokes behind what is fixed. */
function hatch(x, tall) {
  const found = [];
  for (let i = 0; i < 9; i++) {
    const y = -tall / 2 + (tall * i) / 8;
    found.push(...segment([x, y, 0], [x + 0.12 * tall, y - 0.12 * tall, 0]));
    found.push(...segment([x, 0, y], [x + 0.12 * tall, 0, y - 0.12 * tall]));
  }
  return found;
}

/** A coil, or a piston in its cylinder, from x0 to x1. */
function linkOf(kind, x0, x1, R) {
  if (kind === "dashpot") {
    const middle = (x0 + x1) / 2;
    const r = 0.5 * R;
    return [
      ...segment([x0, 0, 0], [middle, 0, 0]), ...segment([middle, 0, -0.8 * r], [middle, 0, 0.8 * r]),
      ...segment([middle - r, 0, r], [x1, 0, r]), ...segment([middle - r, 0, -r], [x1, 0, -r]),
    ];
  }
  const found = [];
  const steps = 24 * TURNS;
  const point = (i) => [
    x0 + ((x1 - x0) * i) / steps,
    0.45 * R * Math.sin((2 * Math.PI * i) / 24),
    0.45 * R * Math.cos((2 * Math.PI * i) / 24),
  ];
  for (let i = 0; i < steps; i++) found.push(...segment(point(i), point(i + 1)));
  return found;
}
