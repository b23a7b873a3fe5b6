// The page: what comes is shown, what is pressed is sent.

import { Axes, Groups, put } from "./axes.js";
import { Connection } from "./connection.js";
import { Motion } from "./motion.js";
import { Histogram, Plots } from "./plots.js";
import { element, fill, isChinese, switchLanguage, text, textOr } from "./texts.js";
import { isInDegrees, shown, switchUnit } from "./units.js";

const find = (id) => document.getElementById(id);
const EVENTS_SHOWN = 400;

let machine = null;
let axes = null;
let groups = null;
let motion = null;
let plots = null;
let state = null;
let lastEvent = 0;
let linkState = "connecting";
let heldByOther = false;
const histogram = new Histogram(find("histogram"));

// Told once, seen for some seconds.
let sayTimer = 0;
function say(words) {
  find("said").textContent = words;
  clearTimeout(sayTimer);
  sayTimer = setTimeout(() => (find("said").textContent = ""), 6000);
}

function sayProblem({ error, words }) {
  heldByOther = error === "lease";
  // What takt says itself is in English; for what has a text here, that comes first.
  const own = textOr(`error_${error}`, "");
  say(isChinese() && own ? (error === "refused" ? `${own} ${words}` : own) : words || own);
}

const connection = new Connection({
  open(description) {
    const isOther = machine === null || JSON.stringify(machine) !== JSON.stringify(description);
    machine = description;
    lastEvent = 0;
    find("events").replaceChildren();
    if (isOther) draw();
    link("live");
  },
  state: take,
  event: showEvent,
  problem: sayProblem,
  lost(why) {
    motion?.forget();
    state = null;
    link(why === "token" ? "connecting" : why);
    showCommand();
    setUsable(false);
  },
  token() {
    const dialog = find("ask-token");
    dialog.showModal();
    return new Promise((given) => {
      dialog.addEventListener("close", () => {
        connection.token = find("token").value;
        find("token").value = "";
        given();
      }, { once: true });
    });
  },
});

function link(key) {
  linkState = key;
  const place = find("link");
  place.dataset.text = key;
  put(place, text(key));
  place.className = `link ${key === "live" ? "live" : key === "connecting" ? "" : "lost"}`;
}

// Sends a command; whether it was taken.
async function command(what) {
  try {
    await connection.command(what);
    return true;
  } catch (problem) {
    // What was held has ended before it was let go: that is told where it ended.
    if (!["nothing_to_renew", "overtaken"].includes(problem.error)) sayProblem(problem);
    return false;
  }
}

async function control(what) {
  try {
    await connection.control(what);
    heldByOther = false;
  } catch (problem) {
    sayProblem(problem);
  }
}

async function stop(category = 1, group = null) {
  motion?.forget();
  try {
    await connection.stop(category, group);
    if (group === null) say(text("stopped_all"));
  } catch {
    say(text("stop_not_sent"));
  }
}

function act(what, group) {
  if (what === "halt") stop(2, group);
  else command({ do: what === "clear_fault" ? "clear_faults" : what, group });
}

// Draws what depends on the machine, the language or the unit.
function draw() {
  fill(document);
  put(find("unit"), isInDegrees() ? "rad" : "°");
  put(find("language"), isChinese() ? "English" : "中文");
  find("language").lang = isChinese() ? "en" : "zh";
  if (!machine) return;
  document.title = `${machine.name} – takt`;
  put(find("name"), machine.name);
  put(find("version"), text("version", machine.version));
  const chosen = motion?.axis ?? 0;
  find("chosen").replaceChildren(...machine.axes.map(({ name }, number) => element("option", { value: String(number) }, name)));
  axes = new Axes(find("axes"), machine, choose);
  groups = new Groups(find("groups"), machine, act);
  motion = new Motion(find("motion"), machine, command, say);
  plots = new Plots(find("plots"), machine, plots);
  choose(Math.min(chosen, machine.axes.length - 1));
  drawBuses();
  if (state) show();
}

function choose(number) {
  motion.choose(number);
  axes.choose(number);
  find("chosen").value = number;
  if (state) {
    showMotion();
    plots.draw(number);
  }
}

const commands = () => connection.isOpen && state !== null && state.commander === connection.page;

// Why the chosen axis cannot be moved now; null if it can.
function obstacle() {
  if (!commands()) return "needs_command";
  const group = state.groups[machine.axes[motion.axis].group];
  if (group.stop?.is_fault) return "needs_clear";
  return ["holding", "moving", "streaming", "stopping"].includes(group.phase) ? null : "needs_enabled";
}

function showMotion() {
  motion.show(state, obstacle());
}

// Every state is kept for the plots; the newest one is shown in the next picture of the screen.
let isDue = false;
function take(next) {
  if (!machine) return;
  const isFirst = state === null;
  state = next;
  plots.take(state);
  histogram.take(state.phase_us);
  if (isFirst) show();
  else if (!isDue) {
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      if (state !== null) show();
    });
  }
}

function show() {
  const faulty = new Set(state.groups.flatMap(({ stop }) => (stop?.is_fault && stop.axis !== null ? [stop.axis] : [])));
  axes.show(state.axes, faulty);
  groups.show(state.groups, commands());
  showMotion();
  plots.show(motion.axis);
  histogram.show();
  showCommand();
  showFaults();
  showTiming();
  if (state.has_ended) link("ended");
}

function setUsable(isUsable) {
  for (const button of document.querySelectorAll("#groups button, #motion button:not([role=tab])")) button.disabled = !isUsable;
}

function showCommand() {
  const commander = state?.commander ?? null;
  const isMine = commands();
  const isOther = commander !== null && !isMine;
  const words = state === null ? "" : isMine ? text("you_command", connection.page, state.pages) : isOther ? text("other_commands", commander, connection.page) : text("nobody_commands");
  put(find("who"), words);
  find("take").hidden = isMine;
  find("take").disabled = state === null;
  put(find("take"), text(isOther ? "take_over" : "take"));
  find("release").hidden = !isMine;
  find("take-lease").hidden = !(isMine && heldByOther);
}

// Faults where they happen: on top, with their cure and the way to clear them.
let faultsShown = "";
function showFaults() {
  const faults = state.groups.flatMap(({ stop, phase }, number) => (stop?.is_fault ? [{ stop, number, phase }] : []));
  const key = JSON.stringify([faults.map(({ stop, number, phase }) => [stop, number, phase === "stopping"]), isChinese(), commands()]);
  if (key === faultsShown) return;
  faultsShown = key;
  const banner = ({ stop, number, phase }) => {
    const cure = stop.cure ?? textOr(`cure_${stop.rule}`, "");
    const clear = element("button", { type: "button", class: "primary", onclick: () => act("clear_fault", number) }, text("clear_fault"));
    clear.disabled = !commands() || phase === "stopping";
    return element(
      "div",
      { class: "banner fault" },
      element("h3", {}, text("fault_of", textOr(`rule_${stop.rule}`, stop.rule))),
      element("div", { class: "buttons" }, clear),
      element("p", {}, stop.words),
      element("p", { class: "cure" }, cure ? text("try_this", cure) : ""),
    );
  };
  find("faults").replaceChildren(...faults.map(banner));
}

function showTiming() {
  const rows = [
    ["cycle", shown(machine.cycle_ns / 1e6, 1, "ms")],
    ["timing", text(`timing_${state.timing}`)],
    ["missed_slots", String(state.missed_slots)],
    ["rejected", String(state.rejected)],
    ["dropped", String(state.dropped)],
  ];
  const place = find("timing");
  if (place.children.length !== rows.length) place.replaceChildren(...rows.map(() => element("div", {}, element("dt"), element("dd"))));
  rows.forEach(([label, words], row) => {
    put(place.children[row].children[0], text(label));
    put(place.children[row].children[1], words);
  });
  state.buses.forEach((bus, number) => {
    const item = find("buses").children[number];
    put(item.querySelector(".phase"), text(`bus_${bus.state}`));
    item.querySelector(".phase").className = `phase ${bus.state === "error_active" ? "active" : "fault"}`;
    item.querySelector(".load i").style.width = `${Math.min(100, bus.load_percent ?? 0)}%`;
    put(item.querySelector(".words"), `${text("load")} ${shown(bus.load_percent, 1, "%")} · ${text("sent")} ${bus.tx_frames} · ${text("received")} ${bus.rx_frames} · ${text("errors")} ${bus.errors} · ${text("overruns")} ${bus.tx_overruns + bus.rx_overruns}`);
  });
}

function drawBuses() {
  find("timing").replaceChildren();
  const bus = ({ name, interface: by }) =>
    element(
      "div",
      { class: "bus" },
      element("div", { class: "heading" }, element("h3", {}, by === name ? name : `${name} (${by})`), element("span", { class: "phase" })),
      element("div", { class: "load" }, element("i")),
      element("p", { class: "soft words" }),
    );
  find("buses").replaceChildren(...machine.buses.map(bus));
}

function showEvent(event) {
  if (event.number <= lastEvent) return;
  lastEvent = event.number;
  const time = new Date(event.time_ms);
  const clock = time.toLocaleTimeString("en-GB") + "." + String(time.getMilliseconds()).padStart(3, "0");
  const list = find("events");
  list.prepend(element("li", {}, element("time", { datetime: time.toISOString() }, clock), element("span", { class: event.level }, event.words)));
  while (list.children.length > EVENTS_SHOWN) list.lastChild.remove();
}

async function sure(words, yes) {
  put(find("ask-words"), words);
  put(find("ask-yes"), yes);
  const dialog = find("ask");
  dialog.returnValue = "no";
  dialog.showModal();
  await new Promise((closed) => dialog.addEventListener("close", closed, { once: true }));
  return dialog.returnValue === "yes";
}

find("stop").addEventListener("pointerdown", () => stop());
find("stop").addEventListener("click", (event) => {
  // A press has stopped already; a click without one comes from a keyboard or a screen reader.
  if (event.detail === 0) stop();
});
find("take").addEventListener("click", async () => {
  const other = state?.commander ?? null;
  if (other === null) await control("take");
  else if (await sure(text("take_over_sure", other), text("take_over"))) await control("take_over");
});
find("release").addEventListener("click", () => control("release"));
find("take-lease").addEventListener("click", () => control("take_lease"));
find("clear-events").addEventListener("click", () => find("events").replaceChildren());
find("unit").addEventListener("click", () => {
  switchUnit();
  motion?.redraw();
  draw();
});
find("language").addEventListener("click", () => {
  switchLanguage();
  motion?.redraw();
  faultsShown = "";
  draw();
  link(linkState);
  showCommand();
});
find("chosen").addEventListener("change", (event) => choose(Number(event.target.value)));
find("pause").addEventListener("click", (event) => {
  const isPaused = event.target.getAttribute("aria-pressed") !== "true";
  event.target.setAttribute("aria-pressed", isPaused);
  event.target.dataset.text = isPaused ? "resume" : "pause";
  put(event.target, text(event.target.dataset.text));
  plots?.pause(isPaused);
});

const isTyping = (target) => target.matches?.("input, select, textarea") ?? false;
const ARROWS = { ArrowLeft: -1, ArrowRight: 1 };

document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" || (event.key === " " && !isTyping(event.target))) {
    if (event.key === " ") event.preventDefault();
    if (!event.repeat) stop();
  } else if (ARROWS[event.key] && !isTyping(event.target) && !event.ctrlKey && !event.altKey && !event.metaKey) {
    if (event.target.getAttribute?.("role") === "tab") return;
    if (motion?.jog(ARROWS[event.key])) event.preventDefault();
  }
});
document.addEventListener("keyup", (event) => {
  if (ARROWS[event.key]) motion?.release();
  // A button would be pressed by the space bar that has stopped.
  if (event.key === " " && !isTyping(event.target)) event.preventDefault();
});
for (const end of ["blur", "pagehide"]) window.addEventListener(end, () => motion?.release());
document.addEventListener("visibilitychange", () => document.hidden && motion?.release());

draw();
