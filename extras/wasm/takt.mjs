// takt in a page or in node: what takt.wasm exports, as functions of text and bytes.

export class Takt {
  #exports;

  // `instance`: a WebAssembly.Instance that no other Takt has.
  constructor(instance) {
    this.#exports = instance.exports;
  }

  // `bytes`: those of takt.wasm.
  static async load(bytes) {
    return Takt.of(await WebAssembly.compile(bytes));
  }

  // `module`: a WebAssembly.Module. Browsers refuse to instantiate a large one while the page waits.
  static async of(module) {
    return new Takt(await WebAssembly.instantiate(module, {}));
  }

  // Runs the engine again on a recording. `settings`: changed values of its configuration, as ["axes.wrist.limits.jerk=200"].
  replay(name, recording, settings = []) {
    return JSON.parse(this.#text("takt_replay", name, recording, JSON.stringify(settings)));
  }

  // Brings a simulated arm up and enables it. `files`: [name, text] of the configuration and of what it names.
  start(main, files, time_ms = Date.now()) {
    this.#call("takt_start", JSON.stringify({ main, files, time_ms }));
  }

  machine() {
    return this.#text("takt_machine");
  }

  page() {
    return this.#text("takt_page");
  }

  // Lets a time pass. Returns what the panel would have sent to its page.
  advance(by_ms) {
    return this.#text("takt_advance", by_ms);
  }

  // Each of these throws { error, words: { en, zh } } when it is refused.
  command(command) {
    this.#order("takt_command", command);
  }

  stop(category, group = null) {
    this.#order("takt_stop", { category, group });
  }

  // `what`: silent, blocked, over_voltage, power_cut, torque_off or bus_off.
  break(what, axis, is_broken = true) {
    this.#order("takt_break", { what, axis, is_broken });
  }

  // The names of the files of the black box, the oldest first.
  blackBoxes() {
    return JSON.parse(this.#text("takt_black_boxes"));
  }

  blackBox(place) {
    return this.#call("takt_black_box", place);
  }

  // What `takt report` says of one of them.
  report(place) {
    return this.#text("takt_report", place);
  }

  #order(name, value) {
    try {
      this.#call(name, JSON.stringify(value));
    } catch (error) {
      throw error instanceof Refusal ? JSON.parse(error.message) : error;
    }
  }

  #text(name, ...given) {
    return new TextDecoder().decode(this.#call(name, ...given));
  }

  #call(name, ...given) {
    const handed = given.flatMap((value) => (typeof value === "number" ? [value] : this.#hand(value)));
    let isError;
    try {
      isError = this.#exports[name](...handed);
    } catch (trap) {
      // A panic has left its message.
      throw new Error(`${trap.message}: ${new TextDecoder().decode(this.#answer())}`);
    }
    const answer = this.#answer();
    if (isError) throw new Refusal(new TextDecoder().decode(answer));
    return answer;
  }

  #hand(value) {
    const bytes = typeof value === "string" ? new TextEncoder().encode(value) : value;
    const at = this.#exports.takt_memory(bytes.length);
    new Uint8Array(this.#exports.memory.buffer, at, bytes.length).set(bytes);
    return [at, bytes.length];
  }

  #answer() {
    const { memory, takt_answer, takt_answer_length } = this.#exports;
    return new Uint8Array(memory.buffer, takt_answer(), takt_answer_length()).slice();
  }
}

// What takt has refused, in its words.
export class Refusal extends Error {}
