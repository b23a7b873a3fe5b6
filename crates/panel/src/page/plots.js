// Live plots of the chosen axis, and the histogram of the cycle.

import { element, put, text } from "./texts.js";
import { position, torque, unitOf, velocity } from "./units.js";

const SECONDS = 20;
const SAMPLES_A_SECOND = 20;
const KINDS = ["position", "velocity", "following_error_short", "torque"];

// Round steps, about `count` of them between two values.
export function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((part) => part * power).find((size) => size >= rough);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-9; value += step) found.push(Math.abs(value) < step * 1e-9 ? 0 : value);
  return { values: found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

// A canvas in the pixels of the screen.
function prepared(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  return { context, width, height };
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Plots {
  #machine;
  #samples;
  #plots;
  #isPaused = false;
  #drawnAt = 0;

  // `before`: what it is drawn in place of, in another language or unit.
  constructor(place, machine, before) {
    this.#machine = machine;
    this.#samples = before?.#samples.length === machine.axes.length ? before.#samples : machine.axes.map(() => []);
    this.#plots = KINDS.map((kind) => {
      const canvas = element("canvas", { role: "img", "aria-label": text(kind) });
      const now = element("b", { class: "number" });
      const item = element("div", { class: "plot" }, element("p", { class: "soft legend" }, text(kind), now, ...(kind === "position" && machine.axes.some((axis) => axis.group !== undefined) ? [element("i", {}, text("actual")), element("i", { class: "set" }, text("set_point"))] : [])), canvas);
      return { kind, canvas, now, item };
    });
    place.replaceChildren(...this.#plots.map((plot) => plot.item));
  }

  pause(isPaused) {
    this.#isPaused = isPaused;
  }

  take(state) {
    if (this.#isPaused) return;
    const at = state.time_ms / 1000;
    state.axes.forEach((axis, number) => {
      const samples = this.#samples[number];
      samples.push({ at, position: [axis.position, axis.position_set], velocity: [axis.velocity, axis.velocity_set], following_error_short: [axis.following_error], torque: [axis.torque] });
      if (samples.length > SECONDS * SAMPLES_A_SECOND * 1.1) samples.shift();
    });
  }

  // Draws them, but no more often than eyes need.
  show(chosen) {
    if (this.#isPaused) return;
    const now = performance.now();
    if (now - this.#drawnAt < 95) return;
    this.#drawnAt = now;
    this.draw(chosen);
  }

  draw(chosen) {
    const axis = this.#machine.axes[chosen];
    const unit = unitOf(axis);
    const format = { position, velocity, torque, following_error_short: position };
    for (const { kind, canvas, now, item } of this.#plots) {
      const samples = this.#samples[chosen];
      const last = samples.at(-1)?.[kind][0] ?? null;
      const isKnown = last !== null;
      item.hidden = !isKnown;
      if (!isKnown || samples.length < 2) continue;
      const words = format[kind](last, axis);
      put(now, words);
      canvas.setAttribute("aria-label", text("plot_label", text(kind), axis.name, SECONDS, words));
      const factor = kind === "torque" ? 1 : unit.factor;
      this.#line(canvas, samples, kind, factor);
    }
  }

  #line(canvas, samples, kind, factor) {
    const { context, width, height } = prepared(canvas);
    const values = samples.flatMap((sample) => sample[kind]).filter((value) => value !== null).map((value) => value * factor);
    let [low, high] = [Math.min(...values), Math.max(...values)];
    const least = { position: 1, velocity: 1, following_error_short: 0.05, torque: 0.5 }[kind] * (factor > 1 || kind === "torque" ? 1 : 0.02);
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    const margin = (high - low) * 0.08;
    [low, high] = [low - margin, high + margin];
    const [left, bottom] = [52, 14];
    const end = samples.at(-1).at;
    const x = (at) => left + ((width - left - 4) * (at - end + SECONDS)) / SECONDS;
    const y = (value) => 3 + ((height - bottom - 6) * (high - value)) / (high - low);
    context.strokeStyle = colour("--line");
    context.fillStyle = colour("--soft");
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    const { values: steps, digits } = ticks(low, high, 3);
    for (const step of steps) {
      context.beginPath();
      context.moveTo(left, y(step));
      context.lineTo(width - 4, y(step));
      context.stroke();
      context.fillText(step.toFixed(digits).replace("-", "−"), left - 6, Math.max(8, y(step)));
    }
    context.textBaseline = "alphabetic";
    context.textAlign = "center";
    for (let back = 5; back < SECONDS; back += 5) context.fillText(`−${back} s`, x(end - back), height - 2);
    const colours = [colour("--accent"), colour("--set")];
    for (let curve = samples[0][kind].length - 1; curve >= 0; curve -= 1) {
      context.strokeStyle = colours[curve];
      context.lineWidth = curve === 0 ? 2 : 1.25;
      context.setLineDash(curve === 0 ? [] : [5, 3]);
      context.beginPath();
      let isDrawing = false;
      for (const sample of samples) {
        if (sample.at < end - SECONDS || sample[kind][curve] === null) continue;
        const [across, down] = [x(sample.at), y(sample[kind][curve] * factor)];
        if (isDrawing) context.lineTo(across, down);
        else context.moveTo(across, down);
        isDrawing = true;
      }
      context.stroke();
    }
    context.setLineDash([]);
  }
}

const BUCKETS = 60;

export class Histogram {
  #samples = [];
  #canvas;
  #drawnAt = 0;

  constructor(canvas) {
    this.#canvas = canvas;
  }

  take(value) {
    if (value === null) return;
    this.#samples.push(value);
    if (this.#samples.length > 6000) this.#samples.shift();
  }

  show() {
    const now = performance.now();
    if (now - this.#drawnAt < 500) return;
    this.#drawnAt = now;
    this.draw();
  }

  draw() {
    if (!this.#samples.length) return;
    const sorted = [...this.#samples].sort((one, other) => one - other);
    const [half, most, latest] = [0.5, 0.99, 1].map((part) => sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))]);
    const high = Math.max(20, most * 1.3);
    const counts = new Array(BUCKETS).fill(0);
    for (const value of sorted) counts[Math.min(BUCKETS - 1, Math.floor((BUCKETS * value) / high))] += 1;
    const { context, width, height } = prepared(this.#canvas);
    const [bottom, greatest] = [height - 16, Math.max(...counts)];
    context.fillStyle = colour("--accent");
    counts.forEach((count, bucket) => {
      const tall = count ? Math.max(2, ((bottom - 4) * Math.log1p(count)) / Math.log1p(greatest)) : 0;
      context.fillRect((bucket * width) / BUCKETS + 1, bottom - tall, width / BUCKETS - 2, tall);
    });
    context.fillStyle = colour("--soft");
    context.textAlign = "center";
    const { values, digits } = ticks(0, high, 5);
    for (const value of values) {
      const at = (value / high) * width;
      if (at > 14 && at < width - 20) context.fillText(`${value.toFixed(digits)} µs`, at, height - 3);
    }
    const words = text("histogram_of", sorted.length, half.toFixed(0), latest.toFixed(0));
    this.#canvas.setAttribute("aria-label", words);
    this.#canvas.title = words;
  }
}
