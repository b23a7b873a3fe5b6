// The motion page of the chosen axis: what its mode allows.

import { element, put, text } from "./texts.js";
import { digits, parse, position, torque, unitOf, velocity } from "./units.js";

const RENEW_EVERY_MS = 80;
const POSITION_TABS = ["absolute", "relative", "reciprocating"];
const SET_POINT_TABS = ["jog", ...POSITION_TABS, "continuous"];

// What can be asked of an axis in a mode (object 6060).
function tabsOf(mode, groupSize) {
  const tabs = {
    1: POSITION_TABS,
    3: ["jog", "continuous"],
    4: ["torque"],
    7: SET_POINT_TABS,
    8: SET_POINT_TABS,
    9: SET_POINT_TABS,
    10: [...SET_POINT_TABS, "torque"],
  }[mode] ?? [];
  const takesMoves = mode === 1 || mode >= 7;
  return [...tabs, ...(groupSize > 1 && takesMoves ? ["group"] : []), "mode"];
}

export class Motion {
  #place;
  #machine;
  #command;
  #say;
  #axis = 0;
  #mode = null;
  #tab = "absolute";
  #kept = new Map();
  #buttons = [];
  #why = null;
  #hold = null;
  #state = null;
  #jogButtons = {};

  // `command(command)` sends one; `say(words)` tells the user.
  constructor(place, machine, command, say) {
    this.#place = place;
    this.#machine = machine;
    this.#command = command;
    this.#say = say;
  }

  get axis() {
    return this.#axis;
  }

  choose(number) {
    this.release();
    this.#axis = number;
    this.#mode = null;
  }

  // Draws it anew: after a switch of the language or of the unit.
  redraw() {
    this.release();
    this.#kept.clear();
    this.#mode = null;
  }

  // `obstacle` is the key of a text, or null.
  show(state, obstacle) {
    this.#state = state;
    const shown = state.axes[this.#axis];
    if (shown.mode !== this.#mode) this.#draw(shown.mode);
    if (obstacle && this.#hold) this.release();
    for (const button of this.#buttons) button.disabled = obstacle !== null && !(button.dataset.always === "1");
    put(this.#why, obstacle ? text(obstacle) : "");
  }

  get #description() {
    return this.#machine.axes[this.#axis];
  }

  #draw(mode) {
    this.#mode = mode;
    const group = this.#machine.groups[this.#description.group];
    const tabs = tabsOf(mode, group.axes.length);
    if (!tabs.includes(this.#tab)) this.#tab = tabs[0];
    const bar = element("div", { class: "tabs", role: "tablist", "aria-label": text("tabs") });
    const panel = element("div", { role: "tabpanel", id: "kind", "aria-labelledby": `tab-${this.#tab}`, tabindex: "-1" });
    for (const name of tabs) {
      const isChosen = name === this.#tab;
      const choose = () => {
        this.release();
        this.#tab = name;
        this.#draw(this.#mode);
        document.getElementById(`tab-${name}`).focus();
      };
      bar.append(
        element("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": "kind", "aria-selected": isChosen, tabindex: isChosen ? "0" : "-1", onclick: choose }, text(`tab_${name}`)),
      );
    }
    bar.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.stopPropagation();
      const next = tabs[(tabs.indexOf(this.#tab) + step + tabs.length) % tabs.length];
      document.getElementById(`tab-${next}`).click();
    });
    this.#buttons = [];
    this.#jogButtons = {};
    this.#why = element("p", { class: "why", role: "status" });
    panel.append(...this[`_${this.#tab}`](), this.#why);
    this.#place.replaceChildren(bar, panel);
    if (this.#state) this.#why.textContent = "";
  }

  // A field that keeps its value for this axis.
  #field(name, symbol, initial, label = name) {
    const key = `${this.#axis} ${name}`;
    const input = element("input", { id: `field-${name}`, type: "text", inputmode: "decimal", autocomplete: "off", value: this.#kept.get(key) ?? initial });
    input.addEventListener("input", () => {
      input.removeAttribute("aria-invalid");
      this.#kept.set(key, input.value);
    });
    const words = element("span", {}, symbol ? `${text(label)} (${symbol})` : text(label));
    return { input, label: element("label", {}, words, input), name: text(label) };
  }

  // The number in a field, in SI; null after the user was told that it is none.
  #number(field, factor, lowest, highest, format) {
    const written = parse(field.input.value);
    if (!Number.isFinite(written)) return this.#refuse(field, text("not_a_number", field.input.value || `“${field.name}”`));
    const value = written / factor;
    const slack = 1e-9 * Math.max(1, Math.abs(highest));
    if (value < lowest - slack || value > highest + slack) {
      return this.#refuse(field, text("outside", field.input.value, format(lowest), format(highest)));
    }
    return Math.min(highest, Math.max(lowest, value));
  }

  #refuse(field, words) {
    field.input.setAttribute("aria-invalid", "true");
    field.input.focus();
    this.#say(words);
    return null;
  }

  #button(label, act, attributes = {}) {
    const button = element("button", { type: "button", onclick: act, ...attributes }, text(label));
    this.#buttons.push(button);
    return button;
  }

  #scales() {
    const speed = this.#field("speed_part", "", "30");
    const acceleration = this.#field("acceleration_part", "", "50");
    const percent = (field) => this.#number(field, 100, 0.01, 1, (value) => `${Math.round(value * 100)} %`);
    const read = () => {
      const [velocity, acceleration_] = [percent(speed), percent(acceleration)];
      return velocity === null || acceleration_ === null ? null : { velocity, acceleration: acceleration_ };
    };
    return { labels: [speed.label, acceleration.label], read };
  }

  #here(number = this.#axis) {
    const axis = this.#machine.axes[number];
    const unit = unitOf(axis);
    return digits((this.#state?.axes[number].position_set ?? 0) * unit.factor, unit.digits);
  }

  #place_of(field, axis = this.#description) {
    const format = (value) => position(value, axis);
    return this.#number(field, unitOf(axis).factor, axis.position_min, axis.position_max, format);
  }

  _absolute() {
    const unit = unitOf(this.#description);
    const target = this.#field("target", unit.symbol, this.#here());
    const scales = this.#scales();
    const move = () => {
      const [to, part] = [this.#place_of(target), scales.read()];
      if (to !== null && part) this.#command({ do: "move", axis: this.#axis, to, relative: false, ...part });
    };
    return [
      element("div", { class: "fields" }, target.label, ...scales.labels),
      element("div", { class: "buttons" }, this.#button("move", move, { class: "primary" })),
    ];
  }

  _relative() {
    const axis = this.#description;
    const unit = unitOf(axis);
    const distance = this.#field("distance", unit.symbol, digits(unit.symbol === "rad" ? 0.1 : 5, unit.digits));
    const scales = this.#scales();
    const span = axis.position_max - axis.position_min;
    const move = (sign) => () => {
      const value = this.#number(distance, unit.factor, 0, span, (limit) => position(limit, axis));
      const part = value === null ? null : scales.read();
      if (part) this.#command({ do: "move", axis: this.#axis, to: sign * value, relative: true, ...part });
    };
    return [
      element("div", { class: "fields" }, distance.label, ...scales.labels),
      element("div", { class: "buttons" }, this.#button("backwards", move(-1)), this.#button("forwards", move(1))),
    ];
  }

  _reciprocating() {
    const unit = unitOf(this.#description);
    const [from, to] = [this.#field("from", unit.symbol, this.#here()), this.#field("to", unit.symbol, this.#here())];
    const scales = this.#scales();
    const start = () => {
      const first = this.#place_of(from);
      const second = first === null ? null : this.#place_of(to);
      const part = second === null ? null : scales.read();
      if (part) this.#command({ do: "reciprocate", axis: this.#axis, between: [first, second], ...part });
    };
    return [
      element("div", { class: "fields" }, from.label, to.label, ...scales.labels),
      element("div", { class: "buttons" }, this.#button("start", start, { class: "primary" }), this.#endButton()),
    ];
  }

  #endButton() {
    return this.#button("end", () => this.#command({ do: "release", axis: this.#axis }));
  }

  #speedField() {
    const axis = this.#description;
    const unit = unitOf(axis);
    const field = this.#field("speed", `${unit.symbol}/s`, digits(axis.velocity * unit.factor * 0.1, unit.digits - 1));
    const read = () => this.#number(field, unit.factor, 0, axis.velocity, (limit) => velocity(limit, axis));
    return { field, read };
  }

  _continuous() {
    const speed = this.#speedField();
    const start = (sign) => () => {
      const value = speed.read();
      if (value !== null) this.#command({ do: "drive", axis: this.#axis, quantity: "velocity", value: sign * value, while: "open" });
    };
    return [
      element("div", { class: "fields" }, speed.field.label),
      element("div", { class: "buttons" }, this.#button("backwards", start(-1)), this.#button("forwards", start(1)), this.#endButton()),
      element("p", { class: "soft" }, text("continuous_words")),
    ];
  }

  _torque() {
    const axis = this.#description;
    const unit = unitOf(axis);
    const field = this.#field("torque", unit.force, digits(axis.torque * 0.05, 2));
    const read = () => this.#number(field, 1, 0, axis.torque, (limit) => torque(limit, axis));
    return [
      element("div", { class: "fields" }, field.label),
      this.#jogPair("torque", read),
      element("p", { class: "soft" }, text("jog_words")),
    ];
  }

  _jog() {
    const speed = this.#speedField();
    return [
      element("div", { class: "fields" }, speed.field.label),
      this.#jogPair("velocity", speed.read),
      element("p", { class: "soft" }, text("jog_words")),
    ];
  }

  #jogPair(quantity, read) {
    const held = (sign, label) => {
      const begin = (event) => {
        if (event.button !== 0) return;
        event.preventDefault();
        button.focus();
        button.setPointerCapture?.(event.pointerId);
        this.#begin(quantity, read, sign, button);
      };
      const button = this.#button(label, () => {}, { id: sign < 0 ? "jog-minus" : "jog-plus" });
      button.addEventListener("pointerdown", begin);
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => this.release());
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      this.#jogButtons[sign] = () => this.#begin(quantity, read, sign, button);
      return button;
    };
    return element("div", { class: "jog" }, held(-1, "jog_minus"), held(1, "jog_plus"));
  }

  // By a key: whether there was something to begin.
  jog(sign) {
    const begin = this.#jogButtons[sign];
    if (!begin || this.#buttons.some((button) => button.disabled)) return false;
    if (!this.#hold) begin();
    return true;
  }

  async #begin(quantity, read, sign, button) {
    if (this.#hold || button.disabled) return;
    const first = read();
    if (first === null) return;
    const axis = this.#axis;
    const hold = { axis, button, timer: 0, isWaiting: true };
    this.#hold = hold;
    button.classList.add("held");
    const isBegun = await this.#command({ do: "drive", axis, quantity, value: sign * first, while: "held" });
    if (this.#hold !== hold) return;
    if (!isBegun) return this.#letGo(hold);
    hold.isWaiting = false;
    hold.timer = setInterval(async () => {
      // One at a time, so that none is queued behind a slow one.
      if (hold.isWaiting) return;
      hold.isWaiting = true;
      const goesOn = await this.#command({ do: "renew", axis, value: sign * first });
      hold.isWaiting = false;
      if (!goesOn && this.#hold === hold) this.#letGo(hold);
    }, RENEW_EVERY_MS);
  }

  #letGo(hold) {
    clearInterval(hold.timer);
    hold.button.classList.remove("held");
    this.#hold = null;
  }

  // Whatever is held is let go.
  release() {
    const hold = this.#hold;
    if (!hold) return;
    this.#letGo(hold);
    this.#command({ do: "release", axis: hold.axis });
  }

  // After a stop: there is nothing to let go.
  forget() {
    if (this.#hold) this.#letGo(this.#hold);
  }

  _group() {
    const number = this.#description.group;
    const group = this.#machine.groups[number];
    const fields = group.axes.map((own) => {
      const axis = this.#machine.axes[own];
      const key = `group ${own}`;
      const input = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", value: this.#kept.get(key) ?? this.#here(own) });
      input.addEventListener("input", () => {
        input.removeAttribute("aria-invalid");
        this.#kept.set(key, input.value);
      });
      return { axis, input, name: axis.name, label: element("label", {}, element("span", {}, `${axis.name} (${unitOf(axis).symbol})`), input) };
    });
    const scales = this.#scales();
    const move = () => {
      const to = [];
      for (const field of fields) {
        const value = this.#place_of(field, field.axis);
        if (value === null) return;
        to.push(value);
      }
      const part = scales.read();
      if (part) this.#command({ do: "move_group", group: number, to, ...part });
    };
    return [
      element("div", { class: "fields" }, ...fields.map((field) => field.label), ...scales.labels),
      element("div", { class: "buttons" }, this.#button("move", move, { class: "primary" })),
    ];
  }

  _mode() {
    const select = element("select", { id: "field-mode" });
    for (const mode of [1, 3, 4, 7, 8, 9, 10]) {
      select.append(element("option", { value: mode, selected: mode === this.#mode }, text(`mode_${mode}`)));
    }
    const change = () => this.#command({ do: "change_mode", axis: this.#axis, mode: Number(select.value) });
    return [
      element("label", {}, element("span", { class: "soft" }, text("tab_mode")), select),
      element("div", { class: "buttons" }, this.#button("change_mode", change, { "data-always": "1" })),
      element("p", { class: "soft" }, text("mode_words")),
    ];
  }
}
