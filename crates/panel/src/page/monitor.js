// The monitor: the frames of the buses with their meaning, with pause, clear, filter and export.

import { find } from "./frame.js";
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
  #isOn = false;
  #isPaused = false;
  #filter = "";

  // `isOn`: from the beginning. The buses of a running controller are so busy that it is asked for.
  constructor(connection, isOn) {
    this.#list = find("frames");
    this.#lostPlace = find("frames-lost");
    this.#connection = connection;
    this.#switch(isOn);
    find("monitor-on").addEventListener("click", () => this.#switch(!this.#isOn));
    find("monitor-pause").addEventListener("click", () => {
      this.#isPaused = !this.#isPaused;
      toggled(find("monitor-pause"), this.#isPaused, ["pause", "resume"]);
      if (!this.#isPaused) this.#show();
    });
    find("monitor-clear").addEventListener("click", () => this.clear());
    find("monitor-export").addEventListener("click", () => this.#export());
    find("monitor-filter").addEventListener("input", (event) => {
      this.#filter = event.target.value.trim().toLowerCase();
      this.#show();
    });
    this.#ask();
  }

  #switch(isOn) {
    this.#isOn = isOn;
    // What comes while it is off is no loss.
    this.#seen = 0;
    toggled(find("monitor-on"), isOn, ["monitor_on", "monitor_off"]);
  }

  // A new connection counts frames anew.
  begin(busNames, isOther) {
    this.#busNames = busNames;
    if (isOther) this.clear();
    this.#seen = 0;
    this.#lost = 0;
  }

  clear() {
    this.#frames = [];
    this.#lost = 0;
    this.#show();
  }

  async #ask() {
    for (;;) {
      if (this.#isOn && this.#connection().isOpen && !document.hidden) await this.#read().catch(() => {});
      await new Promise((later) => setTimeout(later, ASK_EVERY_MS));
    }
  }

  async #read() {
    const answer = await this.#connection().frames(this.#seen, this.#filter);
    if (!answer || answer.last === this.#seen) return;
    // What came before the page was opened is no loss.
    if (this.#seen > 0) this.#lost += answer.lost;
    this.#seen = answer.last;
    this.#frames.push(...answer.frames);
    this.#frames.splice(0, this.#frames.length - KEPT);
    if (!this.#isPaused) this.#show();
  }

  #chosen() {
    const filter = this.#filter;
    if (filter === "") return this.#frames;
    return this.#frames.filter(({ frame, words }) => `${frame} ${words}`.toLowerCase().includes(filter));
  }

  #show() {
    const rows = this.#chosen().slice(-SHOWN).reverse().map(({ time, bus, direction, frame, words }) =>
      element(
        "li",
        {},
        element("time", {}, clock(time)),
        element("code", {}, `${this.#busNames.length > 1 ? `${this.#busNames[bus]} ` : ""}${direction} ${frame}`),
        element("span", { lang: "en" }, words),
      ),
    );
    this.#list.replaceChildren(...rows);
    put(this.#lostPlace, this.#lost > 0 ? text("frames_lost", this.#lost) : "");
  }

  // A candump log of what is shown.
  #export() {
    const lines = this.#chosen().map(({ time, bus, direction, frame }) => {
      const name = (this.#busNames[bus] ?? "can").replace(/\s/g, "_");
      return `(${time.toFixed(6)}) ${name} ${frame} ${direction === ">" ? "T" : "R"}\n`;
    });
    const link = element("a", { download: "takt.log", href: URL.createObjectURL(new Blob(lines, { type: "text/plain" })) });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }
}

// A button that is pressed or not, with a text for each.
function toggled(button, isPressed, texts) {
  button.setAttribute("aria-pressed", isPressed);
  button.dataset.text = texts[isPressed ? 1 : 0];
  put(button, text(button.dataset.text));
}

function clock(seconds) {
  const time = new Date(seconds * 1000);
  return time.toLocaleTimeString("en-GB") + "." + String(time.getMilliseconds()).padStart(3, "0");
}
