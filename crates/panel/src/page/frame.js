// What the pages of a controller and of commissioning share: what is said, the link, the stop, and the questions.

import { element, put, text, told, toldElement } from "./texts.js";

export const find = (id) => document.getElementById(id);

// Told once, seen for some seconds.
let sayTimer = 0;
export function say(words) {
  find("said").textContent = words;
  clearTimeout(sayTimer);
  sayTimer = setTimeout(() => (find("said").textContent = ""), 6000);
}

// A problem without words is one of the page itself.
export const sayProblem = ({ words }) => say(words ? told(words) : text("error_unreachable"));

let linkState = "connecting";
export function link(key = linkState) {
  linkState = key;
  const place = find("link");
  place.dataset.text = key;
  put(place, text(key));
  place.className = `link ${key === "live" ? "live" : key === "connecting" ? "" : "lost"}`;
}

export async function sure(words, yes) {
  put(find("ask-words"), words);
  put(find("ask-yes"), yes);
  const dialog = find("ask");
  dialog.returnValue = "no";
  dialog.showModal();
  await new Promise((closed) => dialog.addEventListener("close", closed, { once: true }));
  return dialog.returnValue === "yes";
}

// Asks for the token of a connection.
export function askToken(connection) {
  const dialog = find("ask-token");
  dialog.showModal();
  return new Promise((given) => {
    dialog.addEventListener("close", () => {
      connection().token = find("token").value;
      find("token").value = "";
      given();
    }, { once: true });
  });
}

// Who commands: the words, and the buttons that change it.
export function showCommander(state, page, isMine) {
  const commander = state?.commander ?? null;
  const isOther = commander !== null && !isMine;
  const words = state === null ? "" : isMine ? text("you_command", page, state.pages) : isOther ? text("other_commands", commander, page) : text("nobody_commands");
  put(find("who"), words);
  find("take").hidden = isMine;
  find("take").disabled = state === null;
  put(find("take"), text(isOther ? "take_over" : "take"));
  find("release").hidden = !isMine;
}

// `commander` is the page that commands now; `control` asks for a change.
export function wireCommand(commander, control) {
  find("take").addEventListener("click", async () => {
    const other = commander();
    if (other === null) await control("take");
    else if (await sure(text("take_over_sure", other), text("take_over"))) await control("take_over");
  });
  find("release").addEventListener("click", () => control("release"));
}

export const isTyping = (target) => target.matches?.("input, select, textarea") ?? false;

// The stop: the button, Escape, and Space except in a field.
export function wireStop(stop) {
  find("stop").addEventListener("pointerdown", () => stop());
  find("stop").addEventListener("click", (event) => {
    // A press has stopped already; a click without one comes from a keyboard or a screen reader.
    if (event.detail === 0) stop();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" && (event.key !== " " || isTyping(event.target))) return;
    if (event.key === " ") event.preventDefault();
    if (!event.repeat) stop();
  });
  document.addEventListener("keyup", (event) => {
    // A button would be pressed by the space bar that has stopped.
    if (event.key === " " && !isTyping(event.target)) event.preventDefault();
  });
}

const EVENTS_SHOWN = 400;
let lastEvent = 0;

export function forgetEvents() {
  lastEvent = 0;
  find("events").replaceChildren();
}

export function showEvent(event) {
  if (event.number <= lastEvent) return;
  lastEvent = event.number;
  const time = new Date(event.time_ms);
  const clock = time.toLocaleTimeString("en-GB") + "." + String(time.getMilliseconds()).padStart(3, "0");
  const list = find("events");
  list.prepend(element("li", {}, element("time", { datetime: time.toISOString() }, clock), toldElement("span", { class: event.level }, event.words)));
  while (list.children.length > EVENTS_SHOWN) list.lastChild.remove();
}
