// The connection with takt: a stream of states, and commands. What is moved by this page ends when the stream does.

const CONFIRM_EVERY_MS = 300;
const SILENT_AFTER_MS = 3000;
const AGAIN_AFTER_MS = 1000;

// The token of the address that takt has printed. It leaves the address, so that no history and no bookmark keeps it.
function tokenOfAddress() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    sessionStorage.setItem("takt.token", token);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem("takt.token");
}

// A new address of the same page loads nothing by itself.
addEventListener("hashchange", () => location.reload());

export class Connection {
  #token = tokenOfAddress();
  #key = null;
  #number = 0;
  #confirmedAt = 0;
  #heardAt = 0;
  #abort = null;
  #handlers;
  page = null;
  machine = null;

  // `handlers`: open(machine), state, event, problem, lost(why), token().
  constructor(handlers) {
    this.#handlers = handlers;
    setInterval(() => {
      if (this.#key && performance.now() - this.#heardAt > SILENT_AFTER_MS) this.#abort?.abort();
    }, 250);
    // A browser allows few connections to one server: a page that nobody sees gives its own back.
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.#abort?.abort();
    });
    this.#keepOpen();
  }

  get isOpen() {
    return this.#key !== null;
  }

  set token(token) {
    this.#token = token;
    sessionStorage.setItem("takt.token", token);
  }

  #headers(more) {
    const headers = { "X-Takt-Panel": "1", ...more };
    if (this.#token) headers.Authorization = `Bearer ${this.#token}`;
    if (this.#key) headers["X-Takt-Page"] = this.#key;
    return headers;
  }

  async #keepOpen() {
    for (;;) {
      if (document.hidden) {
        await new Promise((seen) => document.addEventListener("visibilitychange", seen, { once: true }));
        continue;
      }
      const why = await this.#open();
      this.#key = null;
      this.page = null;
      this.#handlers.lost(why);
      if (why === "token") await this.#handlers.token();
      else await new Promise((again) => setTimeout(again, AGAIN_AFTER_MS));
    }
  }

  // Reads the stream to its end; returns why it has ended.
  async #open() {
    this.#abort = new AbortController();
    const signal = this.#abort.signal;
    try {
      const machine = await fetch("/api/machine", { headers: this.#headers(), signal });
      if (machine.status === 401) return "token";
      if (!machine.ok) return "lost";
      this.machine = await machine.json();
      const states = await fetch("/api/states", { headers: this.#headers(), signal });
      if (states.status === 401) return "token";
      if (states.status === 503) return "too_many_pages";
      if (!states.ok) return "lost";
      return await this.#read(states.body.getReader());
    } catch {
      return "lost";
    }
  }

  async #read(reader) {
    const decoder = new TextDecoder();
    let text = "";
    let why = "lost";
    this.#heardAt = performance.now();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return why;
      this.#heardAt = performance.now();
      text += decoder.decode(value, { stream: true });
      const messages = text.split("\n\n");
      text = messages.pop();
      for (const message of messages) {
        const [, name, data] = /^event: (\w+)\ndata: (.*)$/.exec(message) ?? [];
        if (name && this.#message(name, JSON.parse(data)) === "ended") why = "ended";
      }
    }
  }

  #message(name, value) {
    if (name === "page") {
      this.#key = value.key;
      this.page = value.number;
      this.#number = 0;
      this.#handlers.open(this.machine);
    } else {
      this.#handlers[name]?.(value);
    }
    if (name !== "state") return "";
    const now = performance.now();
    if (now - this.#confirmedAt > CONFIRM_EVERY_MS) {
      this.#confirmedAt = now;
      this.#post("/api/confirm", null).catch(() => {});
    }
    return value.has_ended ? "ended" : "";
  }

  async #post(path, value) {
    const headers = this.#headers(value === null ? {} : { "Content-Type": "application/json" });
    const body = value === null ? undefined : JSON.stringify(value);
    let answer;
    try {
      answer = await fetch(path, { method: "POST", headers, body, keepalive: true });
    } catch {
      throw { error: "unreachable", words: null };
    }
    const told = await answer.json().catch(() => ({}));
    if (!answer.ok) throw { error: told.error ?? "unreachable", words: told.words ?? { text: `HTTP ${answer.status}` } };
  }

  // Each of these throws { error, words } when it is refused.
  command(command) {
    this.#number += 1;
    return this.#post("/api/command", { number: this.#number, command });
  }

  control(what) {
    return this.#post("/api/control", { do: what });
  }

  // Takes the controller over from another process.
  takeLease() {
    return this.#post("/api/lease", null);
  }

  // What the panel shows, where that has changed.
  async describe() {
    const answer = await fetch("/api/machine", { headers: this.#headers() });
    if (answer.ok) this.machine = await answer.json();
    return this.machine;
  }

  // The frames after one with this number that have `filter` in them.
  async frames(after, filter) {
    const headers = this.#headers({ "Content-Type": "application/json" });
    const answer = await fetch("/api/frames", { method: "POST", headers, body: JSON.stringify({ after, filter }) });
    return answer.ok ? answer.json() : null;
  }

  stop(category, group = null) {
    this.#number += 1;
    return this.#post("/api/stop", { category, group, number: this.#number });
  }
}
