// Triangles and outlines of a surface of triangles and quadrilaterals.

const SHARP = Math.cos((30 * Math.PI) / 180); // between the normals of two faces of an outline

/** Corner numbers of all triangles; a triangle among quadrilaterals repeats its last corner. */
export function triangles(faces, width) {
  const found = [];
  for (let i = 0; i < faces.length; i += width) {
    found.push(faces[i], faces[i + 1], faces[i + 2]);
    if (width === 4 && faces[i + 3] !== faces[i + 2]) {
      found.push(faces[i], faces[i + 2], faces[i + 3]);
    }
  }
  return new Uint32Array(found);
}

/** Pairs of corner numbers along the edges at which two faces meet at an angle, or only one is. */
export function outline(points, faces, width) {
  const first = new Map();
  const found = [];
  for (let i = 0; i < faces.length; i += width) {
    const normal = faceNormal(points, faces, i);
    for (const [a, b] of edges(faces, i, width)) {
      const key = a < b ? a * 2 ** 26 + b : b * 2 ** 26 + a;
      const other = first.get(key);
      if (!other) {
        first.set(key, { normal, pair: [a, b] });
      } else {
        const cosine = Math.abs(other.normal.reduce((sum, x, j) => sum + x * normal[j], 0));
        if (cosine < SHARP) found.push(a, b);
        other.pair = null;
      }
    }
  }
  for (const { pair } of first.values()) if (pair) found.push(...pair);
  return new Uint32Array(found);
}

function edges(faces, i, width) {
  const corners = Array.from(faces.subarray(i, i + width));
  if (width === 4 && corners[3] === corners[2]) corners.pop();
  return corners.map((corner, j) => [corner, corners[(j + 1) % corners.length]]);
}

function faceNormal(points, faces, i) {
  const [a, b, c] = [0, 1, 2].map((j) => points.subarray(3 * faces[i + j], 3 * faces[i + j] + 3));
  const u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
  const v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
  return unit(cross(u, v));
}

export function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function unit(a) {
  const length = Math.hypot(...a) || 1;
  return a.map((x) => x / length);
}

export function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
