// The page of the panel on a simulated arm, with what the panel has not: breaking it, and reading its black box.

import { Arm } from "./arm.js";
import { element, isChinese, put, told } from "./texts.js";

const WORDS = {
  title: ["A simulated arm, in this page alone", "仅在本页面中运行的仿真机械臂"],
  lead: [
    "The engine, the drives and the buses of takt run here as WebAssembly: no machine, no server. Move it, then break it.",
    "takt 的引擎、驱动器和总线以 WebAssembly 在此运行：无需机器，也无需服务器。先让它运动，再弄坏它。",
  ],
  broken: ["Break", "制造故障"],
  of: ["of", "对象"],
  silent: ["Unplug its cable", "拔掉电缆"],
  blocked: ["Block its joint", "卡住关节"],
  bus_off: ["Its bus: bus-off", "总线离线"],
  over_voltage: ["Over-voltage", "过压"],
  torque_off: ["Safe torque off", "安全转矩关断"],
  power_cut: ["Cut its power", "瞬间断电"],
  mend: ["Press again to mend it; then clear the fault and enable. A drive that has lost its power or the bus needs a new start.", "再按一次恢复；然后清除故障并使能。断电或断线的驱动器需要重新开始。"],
  again: ["Start anew", "重新开始"],
  box: ["Black box", "黑匣子"],
  no_box: ["Empty: it is written at every fault.", "空：每次故障时写入。"],
  read: ["Read", "读取"],
  save: ["Save (.mcap)", "保存 (.mcap)"],
  replay: ["Replay a recording", "回放记录"],
  replay_lead: ["The engine again on a recording of `takt run`, bit for bit; it stays in this page.", "用引擎逐位重放 takt run 的记录；文件不会离开本页面。"],
  setting: ["Change before (optional)", "更改参数（可选）"],
  identical: ["{0} cycles: all set-points are those of the recording, bit for bit", "{0} 个周期：所有设定值与记录逐位一致"],
  differs: ["{0} of {1} cycles differ. The first is slot {2}: {3}: {4} recorded, {5} replayed", "{1} 个周期中有 {0} 个不同。首个为时隙 {2}：{3}：记录 {4}，重放 {5}"],
  replaying: ["Replaying …", "正在重放…"],
  close: ["Close", "关闭"],
};
const word = (key, ...parts) => WORDS[key][isChinese() ? 1 : 0].replace(/\{(\d)\}/g, (_, number) => parts[number] ?? "");

// What lasts until it is mended, and what happens once.
const STATES = ["silent", "blocked", "bus_off"];
const MOMENTS = ["over_voltage", "torque_off", "power_cut"];

class Demo {
  #arm;
  #broken = new Set();
  #texts = [];
  #axis;
  #boxes;
  #result;
  #buttons = {};

  constructor(place, arm) {
    this.#arm = arm;
    const machine = JSON.parse(arm.takt.machine());
    this.#axis = element("select", { id: "broken-axis", onchange: () => this.#show() }, ...machine.axes.map(({ name }, number) => element("option", { value: String(number) }, name)));
    this.#boxes = element("select", { id: "boxes", "aria-label": "black box" });
    this.#result = element("p", { class: "soft", id: "replayed", role: "status" });
    const setting = element("input", { id: "setting", placeholder: "axes.joint1.limits.velocity=1 rad/s", spellcheck: "false" });
    const recording = element("input", { type: "file", id: "recording", accept: ".mcap", onchange: (event) => this.#replay(event.target, setting.value.trim()) });
    const breaking = [...STATES, ...MOMENTS].map((what) => (this.#buttons[what] = this.#button(what, () => this.#break(what), { id: `break-${what}` })));
    for (const what of STATES) this.#buttons[what].setAttribute("aria-pressed", "false");
    place.append(
      element("div", { class: "heading" }, this.#text("h2", "title"), this.#button("again", () => this.#again(), { id: "again" })),
      this.#text("p", "lead", "soft"),
      element(
        "div",
        { class: "demo-parts" },
        element("div", {}, element("div", { class: "heading" }, this.#text("h3", "broken"), this.#axis), element("div", { class: "buttons" }, ...breaking), this.#text("p", "mend", "soft")),
        element("div", {}, this.#text("h3", "box"), element("div", { class: "buttons" }, this.#boxes, this.#button("read", () => this.#read(), { id: "read-box" }), this.#button("save", () => this.#save(), { id: "save-box" })), this.#text("p", "no_box", "soft")),
        element("div", {}, this.#text("h3", "replay"), this.#text("p", "replay_lead", "soft"), element("div", { class: "buttons" }, recording), element("label", {}, this.#text("span", "setting", "soft"), setting), this.#result),
      ),
    );
    // The page itself changes the language after this.
    document.getElementById("language").addEventListener("click", () => setTimeout(() => this.#translate()));
    this.#translate();
    this.#show();
    setInterval(() => this.#showBoxes(), 300);
  }

  #text(tag, key, className = "") {
    const node = element(tag, { class: className });
    this.#texts.push([node, key]);
    return node;
  }

  #button(key, press, attributes) {
    const button = element("button", { type: "button", onclick: press, ...attributes });
    this.#texts.push([button, key]);
    return button;
  }

  #translate() {
    for (const [node, key] of this.#texts) put(node, word(key));
  }

  #key(what) {
    return `${what} ${this.#axis.value}`;
  }

  #break(what) {
    const key = this.#key(what);
    const isBroken = !this.#broken.has(key);
    try {
      this.#arm.takt.break(what, Number(this.#axis.value), isBroken);
      if (STATES.includes(what)) isBroken ? this.#broken.add(key) : this.#broken.delete(key);
    } catch (refusal) {
      put(this.#result, refusal.words ? told(refusal.words) : refusal.message);
    }
    this.#show();
  }

  #show() {
    for (const what of STATES) {
      const isBroken = this.#broken.has(this.#key(what));
      this.#buttons[what].setAttribute("aria-pressed", isBroken);
      this.#buttons[what].classList.toggle("primary", isBroken);
    }
  }

  async #again() {
    await this.#arm.start();
    this.#broken.clear();
    this.#boxes.replaceChildren();
    this.#show();
  }

  #showBoxes() {
    const names = this.#arm.takt.blackBoxes();
    const isShown = names.length === this.#boxes.options.length && names.every((name, place) => this.#boxes.options[place].textContent === name);
    if (!isShown) {
      this.#boxes.replaceChildren(...names.map((name, place) => element("option", { value: String(place) }, name)));
      this.#boxes.value = String(names.length - 1);
    }
    for (const id of ["read-box", "save-box"]) document.getElementById(id).disabled = names.length === 0;
    this.#boxes.hidden = names.length === 0;
    this.#texts.find(([, key]) => key === "no_box")[0].hidden = names.length > 0;
  }

  #read() {
    const place = Number(this.#boxes.value);
    const dialog = element(
      "dialog",
      { class: "report-dialog", id: "report", "aria-label": word("box") },
      element("pre", { tabindex: "0" }, this.#arm.takt.report(place)),
      element("form", { method: "dialog" }, element("button", { class: "primary" }, word("close"))),
    );
    dialog.addEventListener("close", () => dialog.remove());
    document.body.append(dialog);
    dialog.showModal();
  }

  #save() {
    const place = Number(this.#boxes.value);
    const href = URL.createObjectURL(new Blob([this.#arm.takt.blackBox(place)], { type: "application/octet-stream" }));
    element("a", { href, download: this.#boxes.options[place].textContent }).click();
    setTimeout(() => URL.revokeObjectURL(href), 10_000);
  }

  async #replay(input, setting) {
    const [file] = input.files;
    if (!file) return;
    put(this.#result, word("replaying"));
    const bytes = new Uint8Array(await file.arrayBuffer());
    // The words come before the work, which holds the page up.
    await new Promise((shown) => setTimeout(shown, 50));
    try {
      const { identical, cycles, compared, differing, first_difference: first } = await this.#arm.replay(file.name, bytes, setting ? [setting] : []);
      put(this.#result, identical || !first ? word("identical", cycles) : word("differs", differing, compared, first.slot, first.what, first.recorded, first.replayed));
    } catch (error) {
      put(this.#result, error.message);
    }
    input.value = "";
  }
}

async function begin() {
  const packed = Uint8Array.from(atob(document.getElementById("takt-wasm").textContent.trim()), (letter) => letter.charCodeAt(0));
  const unpacked = new Response(packed).body.pipeThrough(new DecompressionStream("gzip"));
  const module = await WebAssembly.compile(await new Response(unpacked).arrayBuffer());
  const arm = await Arm.of(module, JSON.parse(document.getElementById("takt-files").textContent));
  window.fetch = async (path, options) => arm.fetch(path, options);
  new Demo(document.getElementById("demo"), arm);
  await import("./panel.js");
}

begin().catch((error) => {
  document.getElementById("demo").append(element("p", { class: "banner fault" }, String(error)));
});
