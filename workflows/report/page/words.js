// Numbers as a person reads them, and figures as CSV.

const PREFIXES = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G" };

/** The power of ten, a multiple of three, that leaves 1 to 1000 of a value. */
export function power(value) {
  const found = 3 * Math.floor(Math.log10(Math.abs(value) || 1) / 3 + 1e-9);
  return Math.min(Math.max(found, -12), 9);
}

export function prefixed(unit, exponent) {
  return PREFIXES[exponent] + unit;
}

/** Three digits. */
export function digits(value, n = 3) {
  if (value === null || value === undefined || !isFinite(value)) return "–";
  const text = Number(value.toPrecision(n));
  return Math.abs(text) >= 1e5 || (text !== 0 && Math.abs(text) < 1e-3)
    ? text.toExponential(n - 1).replace("e-", "e−").replace("e+", "e")
    : String(text).replace("-", "−");
}

export function si(value, unit, n = 3) {
  const exponent = value ? power(Number(value.toPrecision(n))) : 0;
  return `${digits(value / 10 ** exponent, n)} ${prefixed(unit, exponent)}`;
}

/** The round number 1, 2 or 5 times a power of ten next to a value. */
export function rounded(value) {
  const scale = 10 ** Math.floor(Math.log10(value));
  const share = value / scale;
  return (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10) * scale;
}

/** Save columns of equal length under a name. */
export function saveCsv(name, heads, columns) {
  const quoted = heads.map((head) => `"${head.replaceAll('"', '""')}"`);
  const lines = [quoted.join(",")];
  for (let i = 0; i < columns[0].length; i++) {
    lines.push(columns.map((values) => values[i] ?? "").join(","));
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
  link.download = `${name}.csv`;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** The cells of a table in the page as CSV. */
export function saveTable(name, table) {
  const rows = [...table.rows].map((row) => [...row.cells].map((cell) => cell.innerText.trim().replaceAll(/[\u00a0\u202f]/g, " ")));
  const [heads, ...body] = rows;
  const quoted = body.map((row) => row.map((cell) => `"${cell.replaceAll('"', '""')}"`));
  saveCsv(name, heads, heads.map((_, j) => quoted.map((row) => row[j] ?? "")));
}
