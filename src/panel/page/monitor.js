// The monitor: the frames of the buses with their meaning, with pause, clear and export.

import { element, put, text } from "./texts.js";

const ASK_EVERY_MS = 250;
const KEPT = 5000;
const SHOWN = 300;

export class Monitor {
  #list;
  #lostPlace;
  #connection;
  #busNames = [];
  #frames = [];
  #seen = 0;
  #lost = 0;
  #isPaused = false;
  #filter = "";

  constructor(list, lostPlace, connection) {
    this.#list = list;
    this.#lostPlace = lostPlace;
    this.#connection = connection;
    this.#ask();
  }

  // A new connection counts frames anew.
  begin(busNames, isOther) {
    this.#busNames = busNames;
    if (isOther) this.clear();
    this.#seen = 0;
    this.#lost = 0;
  }

  set isPaused(isPaused) {
    this.#isPaused = isPaused;
    if (!isPaused) this.#show();
  }

  set filter(filter) {
    this.#filter = filter.trim().toLowerCase();
    this.#show();
  }

  clear() {
    this.#frames = [];
    this.#lost = 0;
    this.#show();
  }

  async #ask() {
    for (;;) {
      if (this.#connection().isOpen && !document.hidden) await this.#read().catch(() => {});
      await new Promise((later) => setTimeout(later, ASK_EVERY_MS));
    }
  }

  async #read() {
    const answer = await this.#connection().frames(this.#seen);
    if (!answer || answer.frames.length === 0) return;
    // What came before the page was opened is no loss.
    if (this.#seen > 0) this.#lost += answer.lost;
    this.#seen = answer.frames.at(-1).number;
    this.#frames.push(...answer.frames);
    this.#frames.splice(0, this.#frames.length - KEPT);
    if (!this.#isPaused) this.#show();
  }

  #chosen() {
    const filter = this.#filter;
    return filter === "" ? this.#frames : this.#frames.filter(({ frame, words }) => `${frame} ${words}`.toLowerCase().includes(filter));
  }

  #show() {
    const rows = this.#chosen().slice(-SHOWN).reverse().map(({ time, bus, direction, frame, words }) =>
      element(
        "li",
        {},
        element("time", {}, clock(time)),
        element("code", {}, `${this.#busNames.length > 1 ? `${this.#busNames[bus]} ` : ""}${direction} ${frame}`),
        element("span", {}, words),
      ),
    );
    this.#list.replaceChildren(...rows);
    put(this.#lostPlace, this.#lost > 0 ? text("frames_lost", this.#lost) : "");
  }

  // A candump log of what is shown.
  export() {
    const lines = this.#chosen().map(({ time, bus, direction, frame }) => {
      const name = (this.#busNames[bus] ?? "can").replace(/\s/g, "_");
      return `(${time.toFixed(6)}) ${name} ${frame} ${direction === ">" ? "T" : "R"}\n`;
    });
    const link = element("a", { download: "takt.log", href: URL.createObjectURL(new Blob(lines, { type: "text/plain" })) });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }
}

function clock(seconds) {
  const time = new Date(seconds * 1000);
  return time.toLocaleTimeString("en-GB") + "." + String(time.getMilliseconds()).padStart(3, "0");
}
