// The page: what comes is shown, what is pressed is sent.

import { Axes, Groups } from "./axes.js";
import { Connection } from "./connection.js";
import { askToken, find, forgetEvents, isTyping, link, say, sayProblem as sayIt, showCommander, showEvent, wireCommand, wireStop } from "./frame.js";
import { Monitor } from "./monitor.js";
import { Motion } from "./motion.js";
import { Histogram, Plots } from "./plots.js";
import { element, fill, isChinese, put, switchLanguage, text, textOr, told } from "./texts.js";
import { isInDegrees, shown, switchUnit } from "./units.js";

let machine = null;
let axes = null;
let groups = null;
let motion = null;
let plots = null;
let state = null;
let heldByOther = false;
const histogram = new Histogram(find("histogram"));

function sayProblem(problem) {
  heldByOther = problem.error === "lease";
  sayIt(problem);
}

const connection = new Connection({
  open(description) {
    const isOther = machine === null || JSON.stringify(machine) !== JSON.stringify(description);
    machine = description;
    find("monitor").hidden = !machine.has_frames;
    monitor.begin(machine.buses.map(({ name }) => name), isOther);
    forgetEvents();
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
  token: () => askToken(() => connection),
});

const monitor = new Monitor(() => connection, false);

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
  const isMine = commands();
  showCommander(state, connection.page, isMine);
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
    const clear = element("button", { type: "button", class: "primary", onclick: () => act("clear_fault", number) }, text("clear_fault"));
    clear.disabled = !commands() || phase === "stopping";
    return element(
      "div",
      { class: "banner fault" },
      element("h2", {}, text("fault_of", textOr(`rule_${stop.rule}`, stop.rule))),
      element("div", { class: "buttons" }, clear),
      element("p", {}, told(stop.words)),
      element("p", { class: "cure" }, stop.cure ? text("try_this", told(stop.cure)) : ""),
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

wireStop(() => stop());
wireCommand(() => state?.commander ?? null, control);
find("take-lease").addEventListener("click", async () => {
  await connection.takeLease().then(() => (heldByOther = false), sayProblem);
});
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
  link();
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

const ARROWS = { ArrowLeft: -1, ArrowRight: 1 };

document.addEventListener("keydown", (event) => {
  if (ARROWS[event.key] && !isTyping(event.target) && !event.ctrlKey && !event.altKey && !event.metaKey) {
    if (event.target.getAttribute?.("role") === "tab") return;
    if (motion?.jog(ARROWS[event.key])) event.preventDefault();
  }
});
document.addEventListener("keyup", (event) => {
  if (ARROWS[event.key]) motion?.release();
});
for (const end of ["blur", "pagehide"]) window.addEventListener(end, () => motion?.release());
document.addEventListener("visibilitychange", () => document.hidden && motion?.release());

draw();
