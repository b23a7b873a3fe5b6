// Numbers as people read them: degrees or radians, millimetres, N·m. What is sent and received is rad, m, N·m and seconds.

let inDegrees = localStorage.getItem("takt.unit") !== "rad";

export const isInDegrees = () => inDegrees;

export function switchUnit() {
  inDegrees = !inDegrees;
  localStorage.setItem("takt.unit", inDegrees ? "deg" : "rad");
}

// Of an axis: the factor from SI, the symbol, and the digits of positions.
export function unitOf(axis) {
  if (axis.unit === "counts") return { factor: 1, symbol: "", digits: 0, force: "" };
  if (axis.unit === "m") return { factor: 1000, symbol: "mm", digits: 2, force: "N" };
  if (inDegrees) return { factor: 180 / Math.PI, symbol: "°", digits: 2, force: "N·m" };
  return { factor: 1, symbol: "rad", digits: 4, force: "N·m" };
}

// A number as people write it.
export const parse = (written) => (written.trim() === "" ? NaN : Number(written.trim().replace(",", ".").replace("−", "-")));

// A number without "-0.00".
export function digits(value, count) {
  const text = value.toFixed(count);
  return Number(text) === 0 ? (0).toFixed(count) : text;
}

const minus = (text) => text.replace("-", "−");

export function shown(value, count, symbol) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return `${minus(digits(value, count))}${symbol === "°" || symbol === "" ? "" : " "}${symbol}`;
}

export const position = (value, axis) => {
  const unit = unitOf(axis);
  return shown(value * unit.factor, unit.digits, unit.symbol);
};

export const velocity = (value, axis) => {
  const unit = unitOf(axis);
  return shown(value * unit.factor, unit.digits - 1, `${unit.symbol}/s`);
};

export const torque = (value, axis) => (value === null ? "–" : shown(value, 2, unitOf(axis).force));
