// The motion page of one drive in commissioning: what `takt drive` does with it.

import { element, text } from "./texts.js";
import { parse, shown, unitOf } from "./units.js";

const RENEW_EVERY_MS = 80;
const TABS = ["absolute", "relative", "reciprocating", "continuous", "velocity", "torque", "home"];

export class Tasks {
  #place;
  #ask;
  #say;
  #drive = null;
  #number = null;
  #tab = "absolute";
  #kept = new Map();
  #hold = null;
  #position = null;

  // `ask(what)` sends a command, and tells whether it was taken; `say(words)` tells the user.
  constructor(place, ask, say) {
    this.#place = place;
    this.#ask = ask;
    this.#say = say;
  }

  get isHeld() {
    return this.#hold !== null;
  }

  choose(number, drive) {
    this.release();
    this.#number = number;
    this.#drive = drive;
    this.draw();
  }

  // The newest position of the drive, for what is moved to.
  set position(position) {
    this.#position = position;
  }

  draw() {
    this.release();
    if (this.#drive === null || this.#drive.family === null) return this.#place.replaceChildren();
    const bar = element("div", { class: "tabs", role: "tablist", "aria-label": text("tabs") });
    for (const name of TABS) {
      const isChosen = name === this.#tab;
      const choose = () => {
        this.#tab = name;
        this.draw();
        document.getElementById(`tab-${name}`).focus();
      };
      bar.append(element("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": "kind", "aria-selected": isChosen, tabindex: isChosen ? "0" : "-1", onclick: choose }, text(`tab_${name}`)));
    }
    bar.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.stopPropagation();
      document.getElementById(`tab-${TABS[(TABS.indexOf(this.#tab) + step + TABS.length) % TABS.length]}`).click();
    });
    const panel = element("div", { role: "tabpanel", id: "kind", "aria-labelledby": `tab-${this.#tab}`, tabindex: "-1" });
    panel.append(...this[`_${this.#tab}`]());
    this.#place.replaceChildren(bar, panel);
  }

  // After a change of the unit or the language nothing that was written keeps its meaning.
  redraw() {
    this.#kept.clear();
    this.draw();
  }

  // `usual`: it may be empty.
  #field(name, label, symbol, initial, usual = null) {
    const key = `${this.#number} ${name}`;
    const input = element("input", { id: `field-${name}`, type: "text", inputmode: "decimal", autocomplete: "off", value: this.#kept.get(key) ?? initial, placeholder: usual && text(usual) });
    input.addEventListener("input", () => {
      input.removeAttribute("aria-invalid");
      this.#kept.set(key, input.value);
    });
    const words = symbol ? `${text(label)} (${symbol})` : text(label);
    return { input, label: element("label", {}, element("span", {}, words), input), words };
  }

  // The number in a field, in SI: null where it may be empty and is, undefined after the user was told that it is none.
  #read(field, factor, mayBeEmpty, lowest = null, highest = null) {
    if (mayBeEmpty && field.input.value.trim() === "") return null;
    const written = parse(field.input.value);
    const refuse = (words) => {
      field.input.setAttribute("aria-invalid", "true");
      field.input.focus();
      this.#say(words);
      return undefined;
    };
    if (!Number.isFinite(written)) return refuse(text("not_a_number", field.input.value || `“${field.words}”`));
    const value = written / factor;
    const slack = 1e-9 * Math.max(1, Math.abs(highest ?? 0));
    if ((lowest !== null && value < lowest - slack) || (highest !== null && value > highest + slack)) {
      const words = (limit) => (limit === null ? "" : shown(limit * factor, 2, ""));
      return refuse(text("outside", field.input.value, words(lowest), words(highest)));
    }
    return value;
  }

  #profile() {
    const { factor, symbol } = unitOf(this.#drive);
    const velocity = this.#field("speed", "speed", symbol && `${symbol}/s`, "", "usual");
    const acceleration = this.#field("acceleration", "acceleration", symbol && `${symbol}/s²`, "", "usual");
    const read = () => {
      const speed = this.#read(velocity, factor, true, 0, this.#drive.velocity);
      const ramp = speed === undefined ? undefined : this.#read(acceleration, factor, true, 0, this.#drive.acceleration);
      return ramp === undefined ? undefined : { velocity: speed, acceleration: ramp };
    };
    return { labels: [velocity.label, acceleration.label], read };
  }

  #target() {
    const { factor, symbol, digits } = unitOf(this.#drive);
    const here = this.#position === null ? "0" : (this.#position * factor).toFixed(digits);
    const field = this.#field("target", "target", symbol, here);
    return { label: field.label, read: () => this.#read(field, factor, false, this.#drive.position_min, this.#drive.position_max) };
  }

  #button(label, onclick, attributes = {}) {
    return element("button", { type: "button", class: "does", onclick, ...attributes }, text(label));
  }

  #task(task, held = false) {
    return this.#ask({ do: "task", drive: this.#number, task, held });
  }

  #form(labels, buttons, words) {
    return [
      element("div", { class: "fields" }, ...labels),
      ...(buttons.length ? [element("div", { class: "buttons" }, ...buttons)] : []),
      element("p", { class: "soft" }, text(words)),
    ];
  }

  _absolute() {
    const [target, profile] = [this.#target(), this.#profile()];
    const move = () => {
      const to = target.read();
      const how = to === undefined ? undefined : profile.read();
      if (how) this.#task({ kind: "absolute", to, profile: how });
    };
    return this.#form([target.label, ...profile.labels], [this.#button("move", move, { class: "primary does" })], "keeps_words");
  }

  _relative() {
    const { factor, symbol, digits } = unitOf(this.#drive);
    const first = symbol === "rad" ? 0.1 : symbol === "" ? 1000 : 5;
    const distance = this.#field("distance", "distance", symbol, first.toFixed(digits));
    const profile = this.#profile();
    const move = (sign) => () => {
      const by = this.#read(distance, factor, false, 0);
      const how = by === undefined ? undefined : profile.read();
      if (how) this.#task({ kind: "relative", by: sign * by, profile: how });
    };
    return this.#form([distance.label, ...profile.labels], [this.#button("backwards", move(-1)), this.#button("forwards", move(1))], "keeps_words");
  }

  _reciprocating() {
    const [target, profile] = [this.#target(), this.#profile()];
    const [times, dwell] = [this.#field("times", "times", "", "2", "until_end"), this.#field("dwell", "dwell", "", "0")];
    const start = () => {
      const to = target.read();
      const count = to === undefined ? undefined : this.#read(times, 1, true, 1, 1e6);
      const pause = count === undefined ? undefined : this.#read(dwell, 1, false, 0, 3600);
      const how = pause === undefined ? undefined : profile.read();
      if (how) this.#task({ kind: "reciprocate", to, times: count === null ? null : Math.round(count), dwell: pause, profile: how });
    };
    return this.#form([target.label, times.label, dwell.label, ...profile.labels], [this.#button("start", start, { class: "primary does" })], "keeps_words");
  }

  _continuous() {
    const profile = this.#profile();
    const start = (is_forward) => () => {
      const how = profile.read();
      if (how) this.#task({ kind: "continuous", is_forward, profile: how });
    };
    return this.#form(profile.labels, [this.#button("backwards", start(false)), this.#button("forwards", start(true))], "until_end_words");
  }

  _velocity() {
    const { factor, symbol, digits } = unitOf(this.#drive);
    const usual = this.#drive.velocity === null ? "" : (this.#drive.velocity * factor * 0.1).toFixed(digits);
    const speed = this.#field("velocity", "speed", symbol && `${symbol}/s`, usual);
    const acceleration = this.#field("ramp", "acceleration", symbol && `${symbol}/s²`, "", "usual");
    const read = (sign) => {
      const value = this.#read(speed, factor, false, 0, this.#drive.velocity);
      const ramp = value === undefined ? undefined : this.#read(acceleration, factor, true, 0, this.#drive.acceleration);
      return ramp === undefined ? undefined : { kind: "velocity", value: sign * value, profile: { velocity: null, acceleration: ramp } };
    };
    const [fields, words] = this.#form([speed.label, acceleration.label], [], "held_words");
    return [fields, this.#holdPair(read), words];
  }

  _torque() {
    const { factor, symbol, force } = unitOf(this.#drive);
    const usual = this.#drive.torque === null ? "" : (this.#drive.torque * 0.05).toFixed(2);
    const torque = this.#field("torque", "torque", force, usual);
    const above = this.#field("above", "max_velocity", symbol && `${symbol}/s`, "", "usual");
    const read = (sign) => {
      const value = this.#read(torque, 1, false, 0, this.#drive.torque);
      const most = value === undefined ? undefined : this.#read(above, factor, true, 0, this.#drive.velocity);
      return most === undefined ? undefined : { kind: "torque", value: sign * value, max_velocity: most };
    };
    const [fields, words] = this.#form([torque.label, above.label], [], "held_words");
    return [fields, this.#holdPair(read), words];
  }

  _home() {
    const method = this.#field("method", "home_method", "", "", "usual");
    const start = () => {
      const number = this.#read(method, 1, true, -128, 127);
      if (number !== undefined) this.#task({ kind: "home", method: number === null ? null : Math.round(number) });
    };
    return this.#form([method.label], [this.#button("start", start, { class: "primary does" })], "home_words");
  }

  #holdPair(read) {
    const held = (sign, label) => {
      const button = this.#button(label, () => {}, { id: sign < 0 ? "jog-minus" : "jog-plus" });
      button.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        event.preventDefault();
        button.focus();
        button.setPointerCapture?.(event.pointerId);
        this.#begin(read, sign, button);
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => this.release());
      button.addEventListener("contextmenu", (event) => event.preventDefault());
      button.addEventListener("keydown", (event) => {
        if (event.key === "Enter" && !event.repeat) this.#begin(read, sign, button);
      });
      button.addEventListener("keyup", (event) => event.key === "Enter" && this.release());
      return button;
    };
    return element("div", { class: "jog" }, held(-1, "jog_minus"), held(1, "jog_plus"));
  }

  async #begin(read, sign, button) {
    if (this.#hold || button.disabled) return;
    const task = read(sign);
    if (task === undefined) return;
    const hold = { button, timer: 0, isWaiting: true };
    this.#hold = hold;
    button.classList.add("held");
    const isBegun = await this.#task(task, true);
    if (this.#hold !== hold) return;
    if (!isBegun) return this.#letGo(hold);
    hold.isWaiting = false;
    hold.timer = setInterval(async () => {
      // One at a time, so that none is queued behind a slow one.
      if (hold.isWaiting) return;
      hold.isWaiting = true;
      const goesOn = await this.#ask({ do: "renew" });
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
    if (!this.#hold) return;
    this.#letGo(this.#hold);
    this.#ask({ do: "end" });
  }

  // After a stop: there is nothing to let go.
  forget() {
    if (this.#hold) this.#letGo(this.#hold);
  }
}
