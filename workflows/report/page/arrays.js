// Arrays of the page: base64 of little-endian numbers; columns of whole numbers have a scale each.

const KINDS = {
  i1: Int8Array, i2: Int16Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array,
};

/** The numbers of an array as they are stored, row by row. */
export function stored(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  return new KINDS[packed.kind](bytes.buffer);
}

/** Column j of scaled columns, as Float32Array. */
export function column(packed, j, values = stored(packed)) {
  const [rows, columns] = packed.shape;
  return Float32Array.from({ length: rows }, (_, i) => values[i * columns + j] * packed.scale[j]);
}

/** All scaled columns, one after the other. */
export function columns(packed) {
  const values = stored(packed);
  return packed.scale.map((_, j) => column(packed, j, values));
}

/** The largest size of any value of some arrays. */
export function largest(arrays) {
  let most = 0;
  for (const values of arrays) for (const value of values) most = Math.max(most, Math.abs(value));
  return most;
}

/** Columns between two stored instants, by the straight line: place is a number of rows. */
export function between(series, place, j) {
  const values = series[j];
  const i = Math.min(Math.max(Math.floor(place), 0), values.length - 1);
  const next = Math.min(i + 1, values.length - 1);
  return values[i] + (values[next] - values[i]) * Math.min(Math.max(place - i, 0), 1);
}
