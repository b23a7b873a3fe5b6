// What WebAssembly does is what this machine does, bit for bit; and the simulated arm moves, breaks and tells why.
//
//   node check.mjs FOLDER-OF-THE-MODULE FOLDER-OF-RECORDINGS TAKT      (extras/wasm/tests/run calls it)

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";

// The wording of the panel's page, which asks for the language that was chosen last.
globalThis.localStorage = { getItem: () => "en" };
const { told } = await import("../../../crates/panel/src/page/texts.js");

const [moduleFolder, recordings, takt] = process.argv.slice(2).map((name) => path.resolve(name));
const { Takt } = await import(pathToFileURL(path.join(moduleFolder, "takt.mjs")));
const module = await WebAssembly.compile(readFileSync(path.join(moduleFolder, "takt.wasm")));

async function check(sentence, body) {
  const began = performance.now();
  await body();
  console.log(`${sentence} (${((performance.now() - began) / 1000).toFixed(1)} s)`);
}

const recorded = readdirSync(recordings).filter((name) => name.endsWith(".mcap")).sort();
assert.equal(recorded.length, 5, `recorded: ${recorded}`);

for (const name of recorded) {
  await check(`the replay of ${name} is that of the recording, bit for bit`, async () => {
    const report = (await Takt.of(module)).replay(name, readFileSync(path.join(recordings, name)));
    assert.ok(report.identical && report.compared > 500 && report.differing === 0 && report.missing === 0, JSON.stringify(report, null, 1));
  });
}

await check("a changed value gives the same other motion as on this machine, to the last digit", async () => {
  const file = path.join(recordings, "first.mcap");
  const setting = "axes.joint.limits.velocity=20 deg/s";
  const here = JSON.parse(execFileSync(takt, ["replay", file, "--set", setting, "--json"]));
  const report = (await Takt.of(module)).replay("first.mcap", readFileSync(file), [setting]);
  assert.ok(!report.identical && report.differing > 100);
  // The command adds what it is of.
  for (const [key, value] of Object.entries(report)) assert.deepEqual(value, here[key], key);
});

await check("what cannot be replayed is refused in words", async () => {
  const takt = await Takt.of(module);
  assert.throws(() => takt.replay("x.mcap", new Uint8Array([1, 2, 3])), /not an MCAP file/);
  const file = readFileSync(path.join(recordings, "first.mcap"));
  assert.throws(() => takt.replay("first.mcap", file, ["axes.nobody.limits.velocity=1"]), /nobody/);
});

// An arm as the page has it: the newest state, and all events.
class Arm {
  events = [];
  problems = [];
  #takt;

  static async of(config) {
    return new Arm(await Takt.of(module), config);
  }

  constructor(takt, config) {
    this.#takt = takt;
    this.#takt.start("arm.toml", [["arm.toml", readFileSync(config, "utf8")]], 1_700_000_000_000);
    this.machine = JSON.parse(this.#takt.machine());
    this.pass(1);
  }

  get takt() {
    return this.#takt;
  }

  pass(ms) {
    for (const message of this.#takt.advance(ms).split("\n\n").filter(Boolean)) {
      const [, name, data] = /^event: (\w+)\ndata: (.*)$/.exec(message);
      if (name === "state") this.state = JSON.parse(data);
      if (name === "event") this.events.push(told(JSON.parse(data).words));
      if (name === "problem") this.problems.push(told(JSON.parse(data).words));
    }
    return this;
  }

  get phase() {
    return this.state.groups[0].phase;
  }
}

const six = "configs/arm6-erob.toml";
const move = (axis, to) => ({ do: "move", axis, to, relative: false, velocity: 1, acceleration: 1 });

await check("the simulated arm moves where it is told to, and jogs while it is told to", async () => {
  const arm = await Arm.of(six);
  assert.equal(arm.machine.axes.length, 6);
  assert.equal(arm.phase, "holding");
  arm.takt.command(move(1, 0.3));
  arm.pass(2000);
  assert.ok(Math.abs(arm.state.axes[1].position - 0.3) < 1e-3, `${arm.state.axes[1].position}`);
  assert.throws(() => arm.takt.command(move(1, 99)), (refusal) => refusal.error === "refused" && /joint2.* is not within its limits/.test(told(refusal.words)) && /joint2.*超出其限值/.test(told(refusal.words, "zh")));
  arm.takt.command({ do: "drive", axis: 0, quantity: "velocity", value: 0.5, while: "held" });
  for (let renewals = 0; renewals < 10; renewals += 1) {
    arm.takt.command({ do: "renew", axis: 0, value: 0.5 });
    arm.pass(100);
  }
  assert.equal(arm.phase, "streaming");
  const { position } = arm.state.axes[0];
  assert.ok(position > 0.2, `${position}`);
  // A key that is not renewed has been let go.
  arm.pass(1500);
  assert.equal(arm.phase, "holding");
  assert.ok(arm.state.axes[0].position < position + 0.4);
  arm.takt.command({ do: "disable", group: null });
  arm.pass(1000);
  assert.equal(arm.phase, "disabled");
  arm.takt.command({ do: "enable", group: null });
  arm.pass(3000);
  assert.equal(arm.phase, "holding");
  arm.takt.command(move(1, -0.3));
  arm.pass(100);
  arm.takt.stop(2);
  arm.pass(1000);
  assert.equal(arm.phase, "holding");
});

for (const [what, rule, isState, isMended] of [
  ["silent", /feedback|heartbeat/, true, false],
  ["blocked", /following_error|drive_fault/, true, true],
  ["over_voltage", /drive_fault/, false, true],
  ["power_cut", /drive|boot|feedback/, false, false],
  ["torque_off", /drive/, false, true],
  ["bus_off", /bus/, true, false],
]) {
  await check(`${what}: the arm stops, the black box says why, and it moves again ${isMended ? "when that is mended" : "in a new run alone"}`, async () => {
    const arm = await Arm.of(six);
    arm.takt.command(move(1, 0.8));
    arm.pass(300);
    arm.takt.break(what, 1);
    arm.pass(3000);
    const { stop } = arm.state.groups[0];
    assert.ok(stop?.is_fault && rule.test(stop.rule), JSON.stringify(stop));
    const [name] = arm.takt.blackBoxes();
    assert.match(name, /black-box/);
    const report = arm.takt.report(0);
    writeFileSync(path.join(recordings, name), arm.takt.blackBox(0));
    const here = execFileSync(takt, ["report", name], { encoding: "utf8", cwd: recordings });
    const words = (text) => text.replace(/\s+/g, " ");
    // What stopped it; below, the widths of columns are those of the terminal.
    const why = (text) => words(text).split(" slot s event")[0];
    assert.equal(why(report), why(here));
    if (isState) arm.takt.break(what, 1, false);
    arm.pass(1000);
    arm.takt.command({ do: "clear_faults", group: null });
    arm.pass(2000);
    if (arm.phase === "disabled") {
      const enable = () => arm.takt.command({ do: "enable", group: null });
      // A drive that has left the bus has confirmed nothing.
      if (isState && !isMended) return assert.throws(enable, (refusal) => /not_disabled/.test(told(refusal.words)));
      enable();
      arm.pass(6000);
    }
    // A drive that has lost its supply or its master is brought up by a new run alone.
    if (!isMended) return assert.notEqual(arm.phase, "holding");
    assert.equal(arm.phase, "holding", JSON.stringify([arm.state.groups, arm.events.slice(-5)]));
    arm.takt.command(move(1, -0.2));
    arm.pass(3000);
    assert.ok(Math.abs(arm.state.axes[1].position + 0.2) < 1e-3, `${arm.state.axes[1].position}`);
  });
}

await check("two arms that are told the same do the same, bit for bit", async () => {
  const run = async () => {
    const arm = await Arm.of(six);
    const states = [];
    arm.takt.command(move(2, 0.4));
    for (let looks = 0; looks < 50; looks += 1) states.push(JSON.stringify(arm.pass(40).state));
    return states;
  };
  assert.deepEqual(await run(), await run());
});

await check("an arm of six axes passes its time faster than the clock on the wall", async () => {
  const arm = await Arm.of(six);
  const began = performance.now();
  arm.pass(5000);
  const factor = 5000 / (performance.now() - began);
  console.log(`   ${factor.toFixed(1)} times as fast`);
  assert.ok(factor > 1);
});
