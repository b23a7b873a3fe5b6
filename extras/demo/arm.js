// The simulated arm in the place of the panel's server: the page asks as it always does, and is answered from here.

import { Takt } from "./takt.mjs";

const TELL_EVERY_MS = 50;
// A page that was held up lets no more time pass than this at once.
const LONGEST_MS = 250;

export class Arm {
  #module;
  #files;
  #takt = null;
  #streams = new Set();

  // An arm that has begun. `files`: the configuration's name, and [name, text] of all files.
  static async of(module, files) {
    const arm = new Arm(module, files);
    await arm.start();
    return arm;
  }

  constructor(module, files) {
    this.#module = module;
    this.#files = files;
  }

  // Begins anew; open pages connect again.
  async start() {
    const takt = await Takt.of(this.#module);
    takt.start(this.#files.main, this.#files.files);
    this.#takt = takt;
    for (const end of [...this.#streams]) end();
  }

  get takt() {
    return this.#takt;
  }

  // A recording has an engine of its own.
  async replay(name, recording, settings) {
    return (await Takt.of(this.#module)).replay(name, recording, settings);
  }

  fetch(path, { body, signal } = {}) {
    const asked = body ? JSON.parse(body) : null;
    try {
      switch (path) {
        case "/api/machine":
          return answer(this.#takt.machine());
        case "/api/states":
          return new Response(this.#states(signal));
        case "/api/command":
          this.#takt.command(asked.command);
          return answer("{}");
        case "/api/stop":
          this.#takt.stop(asked.category, asked.group);
          return answer("{}");
        case "/api/control":
          return asked.do === "release" ? answer('{"error":"refused","words":"There is no other page: this one commands."}', 409) : answer("{}");
        default:
          return answer("{}");
      }
    } catch (refusal) {
      return answer(JSON.stringify(refusal.words === undefined ? { error: "refused", words: refusal.message } : refusal), 409);
    }
  }

  // What the server would send: the greeting, then events and states.
  #states(signal) {
    let end;
    return new ReadableStream({
      start: (controller) => {
        const encoder = new TextEncoder();
        let before = performance.now();
        const tell = () => {
          const now = performance.now();
          try {
            controller.enqueue(encoder.encode(this.#takt.advance(Math.min(now - before, LONGEST_MS))));
          } catch (error) {
            console.error(error);
            end();
          }
          before = now;
        };
        const timer = setInterval(tell, TELL_EVERY_MS);
        end = () => {
          clearInterval(timer);
          this.#streams.delete(end);
          controller.error(new Error("ended"));
        };
        this.#streams.add(end);
        signal?.addEventListener("abort", () => end());
        controller.enqueue(encoder.encode(this.#takt.page()));
        tell();
      },
      cancel: () => end(),
    });
  }
}

const answer = (text, status = 200) => new Response(text, { status, headers: { "Content-Type": "application/json" } });
