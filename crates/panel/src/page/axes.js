// The axes, their bars and figures; the groups with what they can be told.

import { element, put, sentences, text, textOr, told } from "./texts.js";
import { position, shown, torque, unitOf, velocity } from "./units.js";

const FIGURES = ["velocity", "following_error_short", "torque", "current", "temperature"];

export class Axes {
  #rows = [];
  #list;

  constructor(list, machine, choose) {
    this.#list = list;
    this.#rows = machine.axes.map((axis, number) => this.#row(axis, number, choose));
    list.replaceChildren(...this.#rows.map((row) => row.item));
  }

  #row(axis, number, choose) {
    const row = {
      axis,
      pick: element("button", { type: "button", class: "pick", "aria-pressed": "false", "aria-label": text("choose", axis.name), onclick: () => choose(number) }, axis.name),
      mode: element("span", { class: "mode" }),
      drive: element("span", { class: "drive" }),
      position: element("span", { class: "position number" }),
      actual: element("i"),
      set: element("i", { class: "set" }),
      low: element("span", { class: "number" }),
      high: element("span", { class: "number" }),
      error: element("p", { class: "error", hidden: true }),
      figures: {},
    };
    row.bar = element("div", { class: "bar", role: "img" }, row.set, row.actual);
    const figures = element("dl", { class: "figures" });
    for (const figure of FIGURES) {
      row.figures[figure] = element("dd", {}, "–");
      figures.append(element("div", {}, element("dt", {}, text(figure)), row.figures[figure]));
    }
    row.item = element(
      "li",
      { class: "axis" },
      element("div", { class: "row" }, row.pick, row.mode, row.drive, row.position),
      row.bar,
      element("div", { class: "ends" }, row.low, row.high),
      figures,
      row.error,
    );
    return row;
  }

  choose(number) {
    this.#rows.forEach((row, own) => {
      row.item.classList.toggle("chosen", own === number);
      row.pick.setAttribute("aria-pressed", own === number);
    });
  }

  show(states, faulty) {
    this.#rows.forEach((row, number) => this.#show(row, states[number], faulty.has(number)));
  }

  #show(row, state, isFaulty) {
    const { axis } = row;
    const part = (value) => {
      const range = axis.position_max - axis.position_min;
      return `${Math.min(100, Math.max(0, (100 * (value - axis.position_min)) / range)).toFixed(2)}%`;
    };
    row.item.classList.toggle("stale", state.is_stale);
    row.item.classList.toggle("faulty", isFaulty || state.error !== null);
    put(row.position, position(state.position, axis));
    put(row.mode, textOr(`mode_${state.mode}`, String(state.mode)));
    put(row.drive, this.#drive(state));
    row.actual.style.left = part(state.position);
    row.set.style.left = part(state.position_set);
    const margin = 0.03 * (axis.position_max - axis.position_min);
    row.bar.classList.toggle("near", state.position < axis.position_min + margin || state.position > axis.position_max - margin);
    const [low, high] = [position(axis.position_min, axis), position(axis.position_max, axis)];
    put(row.low, low);
    put(row.high, high);
    row.bar.setAttribute("aria-label", text("position_bar", position(state.position, axis), low, high));
    put(row.figures.velocity, velocity(state.velocity, axis));
    const unit = unitOf(axis);
    put(row.figures.following_error_short, shown(state.following_error * unit.factor, unit.digits + 1, unit.symbol));
    put(row.figures.torque, torque(state.torque, axis));
    put(row.figures.current, state.current_per_mille === null ? "–" : shown(state.current_per_mille / 10, 1, "%"));
    put(row.figures.temperature, state.temperature === null ? "–" : shown(state.temperature, 0, "°C"));
    row.error.hidden = state.error === null;
    if (state.error) put(row.error, sentences(told(state.error.words), text("try_this", told(state.error.cure))));
  }

  #drive(state) {
    if (!state.is_heard) return text("no_feedback");
    if (state.is_stale && state.age_ms > 20) return text("stale", Math.round(state.age_ms));
    return textOr(`drive_${state.drive.replaceAll(" ", "_").toLowerCase()}`, state.drive);
  }
}

const BUSY = ["enabling", "moving", "streaming", "stopping", "disabling"];

export class Groups {
  #rows;

  // `act(what, group)` is called for the buttons.
  constructor(place, machine, act) {
    this.#rows = machine.groups.map((group, number) => {
      const button = (what) => element("button", { type: "button", class: what, onclick: () => act(what, number) }, text(what));
      const row = {
        phase: element("span", { class: "phase" }),
        buttons: { enable: button("enable"), disable: button("disable"), halt: button("halt"), clear_fault: button("clear_fault"), bring_up: button("bring_up") },
      };
      row.item = element(
        "div",
        { class: "group", role: "group", "aria-label": group.name || text("all_axes") },
        element("div", { class: "row" }, element("h3", {}, group.name || text("all_axes")), row.phase),
        element("div", { class: "buttons" }, ...Object.values(row.buttons)),
      );
      return row;
    });
    place.replaceChildren(...this.#rows.map((row) => row.item));
  }

  show(groups, commands) {
    this.#rows.forEach((row, number) => {
      const { phase, stop } = groups[number];
      const isFault = stop?.is_fault ?? false;
      put(row.phase, text(`phase_${phase}`));
      row.phase.className = `phase ${isFault ? "fault" : BUSY.includes(phase) ? "busy" : phase === "holding" ? "active" : ""}`;
      row.buttons.enable.disabled = !commands || phase !== "disabled" || isFault;
      row.buttons.disable.disabled = !commands || phase === "disabled" || phase === "passive";
      row.buttons.halt.disabled = !["moving", "streaming"].includes(phase);
      row.buttons.clear_fault.disabled = !commands || !isFault || phase === "stopping";
      row.buttons.bring_up.disabled = !commands || phase !== "disabled";
    });
  }
}
