// The page of commissioning: buses, drives, one drive's motion, the monitor and free frames.

import { Connection } from "./connection.js";
import { askToken, find, forgetEvents, link, say, sayProblem, showCommander, showEvent, sure, wireCommand, wireStop } from "./frame.js";
import { Monitor } from "./monitor.js";
import { Plots } from "./plots.js";
import { Tasks } from "./tasks.js";
import { element, fill, isChinese, put, sentences, switchLanguage, text, textOr, told } from "./texts.js";
import { isInDegrees, parse, position, shown, switchUnit, torque, velocity } from "./units.js";

let machine = null;
let state = null;
let chosen = null;
let result = null;
let isDescribing = false;
// Of the readings of the chosen drive.
let plots = null;
let plottedMs = null;

const connection = new Connection({
  open(description) {
    const isOther = machine === null || machine.name !== description.name;
    machine = description;
    forgetEvents();
    monitor.begin(machine.buses.map(({ name }) => name), isOther);
    draw();
    link("live");
  },
  state: take,
  event: showEvent,
  problem: sayProblem,
  outcome: showOutcome,
  lost(why) {
    tasks.forget();
    state = null;
    link(why === "token" ? "connecting" : why);
    show();
  },
  token: () => askToken(() => connection),
});
const monitor = new Monitor(() => connection, true);
const tasks = new Tasks(find("motion"), ask, say);

// Sends a command; whether it was taken.
async function ask(command) {
  try {
    await connection.command(command);
    return true;
  } catch (problem) {
    // What was held has ended before it was let go: that is told where it ended.
    if (!["nothing_to_renew", "overtaken"].includes(problem.error)) sayProblem(problem);
    return false;
  }
}

const control = (what) => connection.control(what).catch(sayProblem);
const task = (what) => ask({ do: "task", drive: chosen, task: what });

async function stop() {
  tasks.forget();
  try {
    await connection.stop(1);
    say(text("stopped_all"));
  } catch {
    say(text("stop_not_sent"));
  }
}

const commands = () => connection.isOpen && state !== null && state.commander === connection.page;
const drive = () => (chosen === null ? null : machine?.drives[chosen] ?? null);

let isDue = false;
function take(next) {
  if (!machine) return;
  const isFirst = state === null;
  state = next;
  if (state.version !== machine.version) describe();
  if (state.has_ended) link("ended");
  if (isFirst) show();
  else if (!isDue) {
    isDue = true;
    requestAnimationFrame(() => {
      isDue = false;
      show();
    });
  }
}

// The drives have changed.
async function describe() {
  if (isDescribing) return;
  isDescribing = true;
  machine = await connection.describe().catch(() => machine);
  isDescribing = false;
  drawDrives();
  show();
}

// Draws what depends on the machine, the language or the unit.
function draw() {
  fill(document);
  put(find("unit"), isInDegrees() ? "rad" : "°");
  put(find("language"), isChinese() ? "English" : "中文");
  find("language").lang = isChinese() ? "en" : "zh";
  link();
  if (!machine) return;
  document.title = `${machine.name} – takt`;
  put(find("name"), machine.name);
  put(find("version"), text("version", machine.program));
  drawBuses();
  const options = (buses) => buses.map(([{ name }, number]) => element("option", { value: String(number) }, name));
  const all = machine.buses.map((bus, number) => [bus, number]);
  find("add-bus").replaceChildren(...options(all));
  find("send-bus").replaceChildren(...options(all.filter(([{ is_line }]) => !is_line)));
  find("add-family").replaceChildren(...machine.families.map((family) => element("option", { value: family }, family)));
  drawDrives();
  tasks.redraw();
  showResult();
  show();
}

function drawBuses() {
  const bus = ({ name, interface: by, is_line }, number) => {
    const [from, to] = [["scan_from", "1"], ["scan_to", is_line ? "16" : "64"]].map(([label, value]) => {
      const input = element("input", { type: "text", inputmode: "numeric", autocomplete: "off", value });
      return { input, label: element("label", {}, element("span", {}, text(label)), input) };
    });
    const scan = () => {
      const [first, last] = [parse(from.input.value), parse(to.input.value)];
      if (Number.isInteger(first) && Number.isInteger(last)) ask({ do: "scan", bus: number, from: first, to: last });
      else say(text("not_a_number", `${from.input.value} – ${to.input.value}`));
    };
    return element(
      "div",
      { class: "bus" },
      element("div", { class: "heading" }, element("h3", {}, by === name ? name : `${name} (${by})`), element("span", { class: "phase" })),
      element("p", { class: "soft words" }),
      element("div", { class: "scanning" }, from.label, to.label, element("button", { type: "button", class: "scan does", onclick: scan }, text("scan"))),
    );
  };
  find("buses").replaceChildren(...machine.buses.map(bus));
}

function drawDrives() {
  if (chosen === null && machine.drives.length) chosen = 0;
  const rows = machine.drives.map((one, number) => {
    const name = element("button", { type: "button", class: "pick", "aria-label": text("choose_drive", one.name), onclick: () => choose(number) }, one.name);
    const found = one.found;
    const facts = [
      ["node", one.node],
      ["family", one.family ?? text("no_family")],
      ["protocol", found && told(found.protocol)],
      ["vendor", found?.vendor],
      ["product", found?.product ?? (found && told(found.kind))],
      ["firmware", found?.firmware],
      ["serial_number", found?.serial],
    ].filter(([, value]) => value !== null && value !== undefined);
    return element(
      "li",
      { class: "axis" },
      element("div", { class: "row" }, name, element("span", { class: "soft" }, machine.buses.length > 1 ? machine.buses[one.bus].name : ""), element("span", { class: "phase torque" })),
      element("dl", { class: "figures facts" }, ...facts.map(([label, value]) => element("div", {}, element("dt", {}, text(label)), element("dd", {}, String(value))))),
      ...(found?.remarks ?? []).map((remark) => element("p", { class: "soft" }, told(remark))),
    );
  });
  find("drives").replaceChildren(...(rows.length ? rows : [element("li", { class: "soft" }, text("no_drives"))]));
  choose(chosen);
}

function choose(number) {
  const isOther = number !== chosen;
  chosen = number;
  if (isOther) result = null;
  tasks.choose(number, drive());
  drawPlots(isOther ? null : plots);
  if (isOther) {
    find("cycle").value = "";
    showResult();
    if (state?.watched !== null && state?.watched !== undefined) watch();
  }
  show();
}

function drawPlots(before) {
  plots = drive() ? new Plots(find("plots"), { axes: [drive()] }, before) : null;
  find("plots").hidden = true;
}

// Why the chosen drive cannot be moved now; null if it can.
function obstacle() {
  if (!commands()) return "needs_command";
  if (!drive()?.family) return "needs_drive";
  return state.running !== null && !state.running.is_watch ? "needs_end" : null;
}

function show() {
  if (!machine) return;
  const why = obstacle();
  put(find("why"), why ? text(why) : "");
  put(find("chosen"), drive()?.name ?? "");
  showCommander(state, connection.page, commands());
  const isBusy = state !== null && state.running !== null && !state.running.is_watch;
  // What is held stays pressed: a button that is disabled would be let go.
  for (const button of document.querySelectorAll("#motion .does")) button.disabled = why !== null && !tasks.isHeld;
  for (const id of ["enable", "clear-fault", "info", "cycle-read", "cycle-write"]) find(id).disabled = why !== null;
  for (const button of document.querySelectorAll("button.scan")) button.disabled = !commands() || isBusy;
  for (const id of ["add", "send"]) find(id).disabled = !commands() || isBusy;
  find("watch").disabled = !commands() || !drive()?.family;
  find("disable").disabled = !commands() || !drive()?.family;
  find("end").disabled = !commands() || !isBusy;
  showRunning();
  showReading();
  showDrives();
}

// A step of the procedure, where it says more than what is done.
function stepWords(step) {
  const words = ["", "run", "watch"].includes(step) ? "" : textOr(`step_${step.replaceAll(" ", "_").toLowerCase()}`, step);
  return words && ` – ${words}`;
}

function showRunning() {
  const running = state?.running ?? null;
  const who = running === null || running.drive === null ? machine.buses[running?.bus ?? 0]?.name : machine.drives[running.drive]?.name;
  put(find("running"), running === null ? "" : `${who}: ${text(`action_${running.action}`)}${stepWords(running.step)}`);
  const progress = find("progress");
  progress.hidden = !running || running.of === 0;
  if (!progress.hidden) progress.firstElementChild.style.width = `${Math.min(100, (100 * running.done) / running.of)}%`;
}

function showReading() {
  const isWatched = state?.watched !== null && state?.watched !== undefined;
  find("watch").setAttribute("aria-pressed", isWatched);
  find("watch").dataset.text = isWatched ? "readings_end" : "readings";
  put(find("watch"), text(find("watch").dataset.text));
  const reading = state?.reading?.drive === chosen ? state.reading : null;
  if (reading && plots && reading.time_ms !== plottedMs) {
    plottedMs = reading.time_ms;
    const position_ = drive().unit === "counts" ? reading.position_counts : reading.position;
    // The clock of readings is that of what is done with the drive, which begins anew.
    plots.take({ time_ms: Date.now(), axes: [{ ...reading, position: position_, position_set: null, velocity_set: null, following_error: null }] });
    find("plots").hidden = false;
    plots.show(0);
  }
  if (reading) tasks.position = drive().unit === "counts" ? reading.position_counts : reading.position;
  const unit = drive() ?? { unit: "rad" };
  const rows = reading === null ? [] : [
    ["position", unit.unit === "counts" ? String(reading.position_counts) : position(reading.position, unit)],
    ["counts", String(reading.position_counts)],
    ["velocity", velocity(reading.velocity, unit)],
    ["torque", torque(reading.torque, unit)],
    ["current", shown(reading.current_a, 2, "A")],
    ["temperature", shown(reading.temperature_c, 0, "°C")],
    ["drive_state", textOr(`drive_${reading.state.replaceAll(" ", "_").toLowerCase()}`, reading.state)],
  ].filter(([, words]) => words !== "–");
  const place = find("reading");
  if (place.children.length !== rows.length) place.replaceChildren(...rows.map(() => element("div", {}, element("dt"), element("dd"))));
  rows.forEach(([label, words], row) => {
    put(place.children[row].children[0], text(label));
    put(place.children[row].children[1], words);
    place.children[row].className = label;
  });
}

function showDrives() {
  machine.buses.forEach((_, number) => {
    const health = state?.buses[number] ?? null;
    const place = find("buses").children[number];
    if (!place) return;
    const phase = place.querySelector(".phase");
    put(phase, health ? text(`bus_${health.state}`) : machine.buses[number].is_line ? text("serial_line") : "");
    phase.hidden = phase.textContent === "";
    phase.className = `phase ${!health ? "" : health.state === "error_active" ? "active" : "fault"}`;
    put(place.querySelector(".words"), health ? `${text("sent")} ${health.tx_frames} · ${text("received")} ${health.rx_frames} · ${text("errors")} ${health.errors} · ${text("overruns")} ${health.overruns}` : "");
  });
  machine.drives.forEach((_, number) => {
    const row = find("drives").children[number];
    const badge = row?.querySelector(".torque");
    if (!badge) return;
    const has = state?.torque[number] ?? "off";
    put(badge, has === "off" ? "" : text(`torque_${has}`));
    badge.hidden = has === "off";
    badge.className = `phase torque ${has === "on" ? "busy" : "fault"}`;
    row.classList.toggle("chosen", number === chosen);
    row.querySelector(".pick").setAttribute("aria-pressed", number === chosen);
  });
}

async function showOutcome(outcome) {
  if (outcome.consequence !== null && commands() && outcome.drive === chosen) {
    if (await sure(text("consent", told(outcome.consequence)), text("do_it"))) task({ kind: outcome.action, is_confirmed: true });
    return;
  }
  result = outcome;
  if (["failed", "refused"].includes(outcome.ended)) say(howEnded(outcome));
  const cycle = outcome.items.find(({ key }) => key === "value" || key === "1006:00");
  if (outcome.action === "cycle" && cycle && outcome.drive === chosen) find("cycle").value = told(cycle.text, "en").replace(/[^\d].*$/, "");
  showResult();
}

function howEnded({ drive: number, action, ended, failure, advice }) {
  const name = machine?.drives[number]?.name ?? "";
  const why = sentences(failure && told(failure), advice && text("try_this", told(advice)));
  return text(`ended_${ended}`, name, text(`action_${action}`), why);
}

function showResult() {
  if (result === null) return find("result").replaceChildren();
  const item = ({ label, text: value }) => element("div", {}, element("dt", {}, textOr(`label_${label.replaceAll(" ", "_").toLowerCase()}`, label)), element("dd", {}, told(value)));
  find("result").replaceChildren(
    element("h3", { class: result.ended }, howEnded(result)),
    ...result.notes.map((note) => element("p", { class: "soft" }, told(note))),
    ...(result.items.length ? [element("dl", { class: "report" }, ...result.items.map(item))] : []),
  );
}

const watch = () => ask({ do: "watch", drive: chosen, every_ms: Math.min(5000, Math.max(20, Math.round(parse(find("watch-every").value)) || 100)) });

find("watch").addEventListener("click", () => {
  if (state?.watched === null) watch();
  else ask({ do: "watch", drive: null, every_ms: 100 });
});
find("enable").addEventListener("click", () => task({ kind: "enable" }));
find("disable").addEventListener("click", () => task({ kind: "disable" }));
find("clear-fault").addEventListener("click", () => task({ kind: "clear_fault", is_confirmed: false }));
find("end").addEventListener("click", () => ask({ do: "end" }));
find("info").addEventListener("click", () => task({ kind: "info" }));
find("cycle-read").addEventListener("click", () => task({ kind: "cycle", write_us: null }));
find("cycle-write").addEventListener("click", () => {
  const write_us = parse(find("cycle").value);
  if (Number.isInteger(write_us) && write_us >= 0) task({ kind: "cycle", write_us });
  else say(text("not_a_number", find("cycle").value || `“${text("communication_cycle")}”`));
});
find("add").addEventListener("click", () => {
  const node = parse(find("add-node").value);
  if (Number.isInteger(node) && node >= 0 && node < 256) ask({ do: "add", bus: Number(find("add-bus").value), node, family: find("add-family").value });
  else say(text("not_a_number", find("add-node").value || `“${text("node")}”`));
});
find("send").addEventListener("click", () => {
  const [count, period_ms] = [parse(find("send-count").value), parse(find("send-period").value)];
  if (Number.isInteger(count) && count > 0 && Number.isInteger(period_ms) && period_ms > 0) {
    ask({ do: "send", bus: Number(find("send-bus").value), frame: find("send-frame").value.trim(), count, period_ms });
  } else say(text("not_a_number", `${find("send-count").value}, ${find("send-period").value}`));
});
find("clear-events").addEventListener("click", () => find("events").replaceChildren());
find("unit").addEventListener("click", () => {
  switchUnit();
  draw();
});
find("language").addEventListener("click", () => {
  switchLanguage();
  draw();
});
wireStop(stop);
wireCommand(() => state?.commander ?? null, control);
for (const end of ["blur", "pagehide"]) window.addEventListener(end, () => tasks.release());
document.addEventListener("visibilitychange", () => document.hidden && tasks.release());

draw();
