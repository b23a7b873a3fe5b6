// The page of the panel, driven as a user does: by mouse, keys and touch, in both languages, and killed in mid-jog.
//
//   node page.cjs TAKT FOLDER      (crates/panel/tests/panel/run calls it)

const assert = require("node:assert/strict");
const { spawn } = require("node:child_process");
const fs = require("node:fs");
const os = require("node:os");
const path = require("node:path");
const { chromium } = require("playwright-core");

const [takt, folder] = process.argv.slice(2);
const LONG = 30_000;
const LAUNCH = {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
};

const FAULT = `
[[fault]]
kind = "alarm"
axis = "joint2"
code = 0x4310
when = "moving"
at = "300 ms"
`;

// A simulated arm with its panel; resolves when the page can be opened.
const arm = (place, ...options) => start("run", path.join(place, "arm.toml"), "--panel", "127.0.0.1:0", ...options);

const started = [];

function start(...command) {
  const process_ = spawn(takt, command, { stdio: ["ignore", "pipe", "pipe"] });
  started.push(process_);
  return new Promise((resolve, reject) => {
    let said = "";
    process_.stderr.on("data", (data) => {
      said += data;
      const found = /(http:\S+), until/.exec(said);
      if (found) resolve({ process: process_, address: found[1], said: () => said });
    });
    process_.on("exit", (code) => reject(new Error(`takt has ended with ${code}: ${said}`)));
  });
}

const ended = (process_) => new Promise((resolve) => (process_.exitCode === null ? process_.on("exit", resolve) : resolve(process_.exitCode)));

// Reads a position as the page shows it.
const degrees = (text) => Number(text.replace("−", "-").replace("°", ""));

class Panel {
  constructor(page) {
    this.page = page;
  }

  static async open(browser, address, { rows = "#axes .axis", ...options } = {}) {
    const context = await browser.newContext({ viewport: { width: 1440, height: 1000 }, locale: "en-US", ...options });
    const page = await context.newPage();
    const problems = [];
    page.on("pageerror", (error) => problems.push(String(error)));
    page.on("console", (message) => message.type() === "error" && !/status of 4\d\d|ERR_CONNECTION|ERR_INCOMPLETE|ERR_EMPTY/.test(message.text()) && problems.push(message.text()));
    page.on("request", (request) => request.url().startsWith(new URL(address).origin) || problems.push(`asks elsewhere: ${request.url()}`));
    await page.goto(address);
    await page.locator("#link.live").waitFor({ timeout: LONG });
    await page.locator(rows).first().waitFor({ timeout: LONG });
    const panel = new Panel(page);
    panel.problems = problems;
    return panel;
  }

  async until(words, what) {
    await this.page.waitForFunction(what, null, { timeout: LONG, polling: 50 }).catch((error) => {
      throw new Error(`${words}: ${error.message}`);
    });
  }

  async phase(words) {
    await this.page.locator("#groups .phase", { hasText: words }).first().waitFor({ timeout: LONG });
  }

  // Does something until a group is in a phase: on a machine that is too busy for a stream it is refused, or ends at once.
  async untilPhase(words, act, undo = async () => {}) {
    for (let tried = 0; tried < 10; tried += 1) {
      await act();
      const isThere = this.page.locator("#groups .phase", { hasText: words }).first().waitFor({ timeout: 5000 });
      if (await isThere.then(() => true, () => false)) return;
      await undo();
    }
    assert.fail(`no group came to be ${words}`);
  }

  async position(axis = 0) {
    return degrees(await this.page.locator("#axes .axis .position").nth(axis).textContent());
  }

  async positionIs(wanted, axis = 0) {
    const begun = Date.now();
    while (Math.abs((await this.position(axis)) - wanted) > 0.05) {
      assert.ok(Date.now() - begun < LONG, `axis ${axis} is at ${await this.position(axis)}, not at ${wanted}; said: ${await this.page.locator("#said").textContent()}`);
      await this.page.waitForTimeout(50);
    }
  }

  async atRest() {
    let before = await this.position();
    for (;;) {
      await this.page.waitForTimeout(300);
      const now = await this.position();
      if (Math.abs(now - before) < 0.005) return now;
      before = now;
    }
  }

  // A machine that is too busy to confirm states in time is refused, and asks again.
  async take() {
    for (let asked = 0; asked < 10 && !(await this.page.locator("#release").isVisible()); asked += 1) {
      await this.page.locator("#take").click();
      await this.page.locator("#release").waitFor({ timeout: 3000 }).catch(() => {});
    }
  }

  tab(name) {
    return this.page.locator(`#tab-${name}`).click();
  }

  async screenshot(name) {
    await this.page.evaluate(() => scrollTo(0, 0));
    await this.page.screenshot({ path: path.join(folder, `${name}.png`), fullPage: true });
  }

  async close() {
    assert.deepEqual(this.problems, [], "the page had problems");
    await this.page.context().close();
  }
}

// What people who do not see well, or use a keyboard or a screen reader, need: WCAG 2.2, by axe.
const AXE = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");

async function isAccessible(page, name) {
  await page.evaluate(AXE);
  const found = await page.evaluate(() => axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"] }));
  const problems = found.violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.target.join(" ")).join(", ")}`);
  assert.deepEqual(problems, [], name);
  assert.ok(found.passes.length > 30, `${name}: ${found.passes.length} rules looked at something`);
}

async function looksRight(panel, name) {
  await panel.screenshot(name);
  await isAccessible(panel.page, name);
  const overflow = await panel.page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.equal(overflow, 0, `${name} is wider than its window`);
}

// What takt says on a Chinese page: Han, and no English words but those of names and what stands in backticks.
function isChinese(words) {
  assert.match(words, /[\u4e00-\u9fff]/, words);
  const outside = words.split("`").filter((_, place) => place % 2 === 0).join(" ");
  const english = outside.match(/[a-z]{3,}\d*/g) ?? [];
  assert.deepEqual(english.filter((word) => !/^(joint\d|rad|deg|operational|base|wrist|takt|modes)$/.test(word)), [], words);
}

const steps = {
  async "a page takes command, moves an axis, and disables and enables it"({ browser, address }) {
    const panel = await Panel.open(browser, address);
    assert.ok(await panel.page.locator("#motion .why").textContent());
    assert.ok(await panel.page.locator("#groups .disable").first().isDisabled(), "nothing is commanded without command");
    await panel.take();
    await panel.tab("absolute");
    await panel.page.fill("#field-target", "12");
    await panel.page.fill("#field-speed_part", "100");
    await panel.page.locator("#kind button", { hasText: "Move" }).click();
    await panel.positionIs(12);
    await panel.tab("relative");
    await panel.page.fill("#field-distance", "2,5");
    await panel.page.fill("#field-speed_part", "100");
    await panel.page.locator("#kind button", { hasText: "Backwards" }).click();
    await panel.positionIs(9.5);
    await panel.tab("absolute");
    await panel.page.fill("#field-target", "999");
    await panel.page.locator("#kind button", { hasText: "Move" }).click();
    await panel.page.locator("#said", { hasText: "999 is outside" }).waitFor({ timeout: LONG });
    assert.equal(await panel.page.locator("#field-target").getAttribute("aria-invalid"), "true");
    await panel.page.locator("#groups .disable").first().click();
    await panel.phase("disabled");
    await panel.page.locator("#groups .enable").first().click();
    await panel.phase("holding");
    await panel.close();
  },

  async "jog moves while a button or a key is held, and ends with it"({ browser, address }) {
    const panel = await Panel.open(browser, address);
    await panel.take();
    await panel.tab("jog");
    await panel.page.fill("#field-speed", "10");
    for (const hold of ["button", "key"]) {
      const from = await panel.atRest();
      const isThere = async () => (await panel.position()) > from + 2;
      // On a machine that is too busy to renew it in time, the key is let go by takt, and pressed again.
      for (let press = 0; press < 20 && !(await isThere()); press += 1) {
        const box = await panel.page.locator("#jog-plus").boundingBox();
        if (hold === "button") {
          await panel.page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
          await panel.page.mouse.down();
        } else {
          await panel.page.locator("#jog-plus").focus();
          await panel.page.keyboard.down("ArrowRight");
        }
        await panel.page.locator("#jog-plus.held").waitFor({ timeout: LONG });
        while ((await panel.page.locator("#jog-plus.held").count()) && !(await isThere())) await panel.page.waitForTimeout(50);
        if (hold === "button") await panel.page.mouse.up();
        else await panel.page.keyboard.up("ArrowRight");
        await panel.page.locator("#jog-plus.held").waitFor({ state: "detached", timeout: LONG });
        await panel.phase("holding");
      }
      const to = await panel.atRest();
      assert.ok(to - from > 2, `${hold}: from ${from} to ${to}`);
    }
    await panel.close();
  },

  async "a page that is killed in mid-jog leaves the arm at rest"({ browser, address }) {
    const watcher = await Panel.open(browser, address);
    const own = await chromium.launch(LAUNCH);
    const panel = await Panel.open(own, address);
    await panel.take();
    await panel.tab("jog");
    await panel.page.fill("#field-speed", "10");
    await panel.page.locator("#jog-minus").focus();
    const keys = panel.page.keyboard;
    await watcher.untilPhase("following points", () => keys.down("ArrowLeft"), () => keys.up("ArrowLeft"));
    await own.close();
    await watcher.phase("holding");
    await watcher.page.locator("#who", { hasText: "No page commands" }).waitFor({ timeout: LONG });
    const rest = await watcher.atRest();
    await watcher.page.waitForTimeout(500);
    assert.equal(await watcher.position(), rest);
    await watcher.close();
  },

  async "another page takes over and everyone stops, by the button and by keys"({ browser, address }) {
    const first = await Panel.open(browser, address);
    const second = await Panel.open(browser, address);
    await first.take();
    await second.page.locator("#who", { hasText: "commands. This is page" }).waitFor({ timeout: LONG });
    await first.tab("continuous");
    await first.page.fill("#field-speed", "3");
    for (const stop of ["button", "Escape", "Space"]) {
      await first.untilPhase("following points", () => first.page.locator("#kind button", { hasText: "Forwards" }).click());
      if (stop === "button") await second.page.locator("#stop").click();
      else await second.page.keyboard.press(stop);
      await first.phase("disabled");
      await first.page.locator("#groups .enable").first().click();
      await first.phase("holding");
    }
    await second.page.locator("#take").click();
    await second.page.locator("#ask-yes").click();
    await second.page.locator("#who", { hasText: "This page" }).waitFor({ timeout: LONG });
    await first.page.locator("#who", { hasText: "This is page" }).waitFor({ timeout: LONG });
    assert.equal(await first.page.locator("#take").textContent(), "Take over");
    // A space that is typed is no stop.
    await second.page.locator("#field-target, #field-speed").first().press("Space");
    await second.page.waitForTimeout(300);
    await second.phase("holding");
    await first.close();
    await second.close();
  },

  async "the page is whole in both languages, in light and dark, on a desk and on a phone"({ browser, address }) {
    const looks = [
      ["desk-light", { colorScheme: "light" }],
      ["desk-dark", { colorScheme: "dark" }],
      ["phone-light", { viewport: { width: 390, height: 844 }, colorScheme: "light", hasTouch: true, isMobile: true }],
      ["phone-dark", { viewport: { width: 390, height: 844 }, colorScheme: "dark", hasTouch: true, isMobile: true }],
      ["desk-chinese", { locale: "zh-CN", colorScheme: "light" }],
    ];
    for (const [name, options] of looks) {
      const panel = await Panel.open(browser, address, options);
      assert.equal(await panel.page.locator("html").getAttribute("lang"), options.locale ?? "en");
      await panel.take();
      await panel.tab("reciprocating");
      await panel.page.fill("#field-from", "0");
      await panel.page.fill("#field-to", "20");
      await panel.page.fill("#field-speed_part", "60");
      await panel.page.locator("#kind .primary").click();
      await panel.page.waitForTimeout(1500);
      await looksRight(panel, name);
      for (const tab of ["jog", "continuous", "relative", "group", "mode"]) {
        await panel.tab(tab);
        if (name === "desk-light") await isAccessible(panel.page, `${name} ${tab}`);
      }
      if (name === "desk-light") {
        await panel.page.locator("#language").click();
        await panel.page.locator("#axes-title", { hasText: "轴" }).waitFor();
        await panel.page.locator("#unit").click();
        await panel.page.locator(".position", { hasText: "rad" }).first().waitFor();
        // English words in Chinese are those of names and units.
        const left = await panel.page.evaluate(() => [...document.querySelectorAll("h2, h3, dt, button, label span, .soft")].map((one) => one.textContent.trim()).filter((words) => /[a-z]{4,}/.test(words) && !/[\u4e00-\u9fff]/.test(words)));
        const names = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "English", "base (sim)", "wrist (sim)"];
        assert.deepEqual(left.filter((words) => !names.includes(words)), []);
        await panel.page.locator("#unit").click();
      }
      await panel.close();
    }
  },

  async "the monitor shows the frames of a running arm once it is started, and those of a filter alone"({ browser, address }) {
    const panel = await Panel.open(browser, address);
    const { page } = panel;
    await page.waitForTimeout(1000);
    assert.equal(await page.locator("#frames li").count(), 0, "it has not been started");
    await page.locator("#monitor-on").click();
    await page.locator("#frames li", { hasText: "statusword" }).first().waitFor({ timeout: LONG });
    await page.fill("#monitor-filter", "joint6");
    await panel.until("frames of joint6 alone", () => {
      const rows = [...document.querySelectorAll("#frames li")];
      return rows.length > 20 && rows.every((row) => row.textContent.includes("joint6"));
    });
    await looksRight(panel, "monitor");
    await page.locator("#monitor-on").click();
    await panel.close();
  },

  async "a fault is shown with its cure, cleared, and the arm goes on"({ browser, place }) {
    fs.writeFileSync(path.join(place, "fault.toml"), FAULT);
    const own = await arm(place, "--faults", path.join(place, "fault.toml"));
    const panel = await Panel.open(browser, own.address);
    await panel.take();
    await panel.page.locator("#axes .pick").nth(1).click();
    await panel.tab("absolute");
    await panel.page.fill("#field-target", "60");
    await panel.page.fill("#field-speed_part", "100");
    await panel.page.fill("#field-acceleration_part", "100");
    await panel.page.locator("#kind .primary").click();
    const banner = panel.page.locator("#faults .banner.fault");
    await banner.waitFor({ timeout: LONG });
    await panel.phase("disabled");
    assert.match(await banner.textContent(), /A drive reports a fault.*the drive of joint2 reports fault.*0x4310.*Try: .+/s);
    assert.equal(await panel.page.locator("#faults").getAttribute("role"), "alert");
    assert.ok(await panel.page.locator("#groups .enable").first().isDisabled());
    await looksRight(panel, "fault-light");
    await panel.page.emulateMedia({ colorScheme: "dark" });
    await panel.page.locator("#language").click();
    await panel.page.locator("#faults h2", { hasText: "故障：驱动器报告故障" }).waitFor({ timeout: LONG });
    await looksRight(panel, "fault-dark-chinese");
    await panel.page.locator("#language").click();
    await banner.locator("button").click();
    await banner.waitFor({ state: "detached", timeout: LONG });
    await panel.page.locator("#groups .enable").first().click();
    await panel.phase("holding");

    // The controller ends while the page is open.
    own.process.removeAllListeners("exit");
    own.process.kill("SIGINT");
    assert.equal(await ended(own.process), 130, own.said());
    await panel.page.locator("#link.lost").waitFor({ timeout: LONG });
    await panel.page.keyboard.press("Escape");
    await panel.page.locator("#said", { hasText: "could NOT be sent" }).waitFor({ timeout: LONG });
    await panel.page.context().close();
  },

  async "what takt says is Chinese on a Chinese page: a refused command, a fault, a stop"({ browser, place }) {
    fs.writeFileSync(path.join(place, "fault.toml"), FAULT);
    const own = await arm(place, "--faults", path.join(place, "fault.toml"));
    const panel = await Panel.open(browser, own.address, { locale: "zh-CN" });
    const { page } = panel;
    const said = async (words) => {
      await page.locator("#said", { hasText: words }).waitFor({ timeout: LONG });
      isChinese(await page.locator("#said").textContent());
    };
    await panel.take();
    await page.locator("#axes .pick").nth(1).click();
    await panel.tab("mode");
    await page.locator("#field-mode").selectOption("1");
    await page.locator("#kind button", { hasText: "更改模式" }).click();
    await said("被拒绝");
    await panel.tab("absolute");
    await page.fill("#field-target", "60");
    await page.fill("#field-speed_part", "100");
    await page.fill("#field-acceleration_part", "100");
    await page.locator("#kind .primary").click();
    const banner = page.locator("#faults .banner.fault");
    await banner.waitFor({ timeout: LONG });
    await panel.phase("未使能");
    assert.match(await banner.textContent(), /joint2 的驱动器报告故障 0x4310（驱动器温度过高）.*建议：让驱动器冷却/s);
    isChinese(await banner.textContent());
    isChinese(await page.locator("#axes .axis .error").nth(1).textContent());
    await page.locator("#events li", { hasText: "停止：joint2 的驱动器报告故障" }).waitFor({ timeout: LONG });
    await looksRight(panel, "fault-chinese");
    // While a page is looked at by a program, it confirms nothing.
    await panel.take();
    await banner.locator("button").click();
    await banner.waitFor({ state: "detached", timeout: LONG });
    await page.locator("#groups .enable").first().click();
    await panel.phase("保持");
    await page.keyboard.press("Escape");
    await page.locator("#events li", { hasText: "停止：收到停止请求" }).waitFor({ timeout: LONG });
    for (const words of await page.locator("#events li span").allTextContents()) isChinese(words);
    // What was told before is there in the other language, too.
    await page.locator("#language").click();
    await page.locator("#events li", { hasText: "stop: a stop was requested" }).waitFor({ timeout: LONG });
    await panel.close();
    own.process.removeAllListeners("exit");
    own.process.kill("SIGINT");
    await ended(own.process);
  },

  async "drives are commissioned without a controller, in both languages"({ browser }) {
    const config = path.join(__dirname, "../../../../configs/single-erob.toml");
    const bench = await start("panel", config, "--address", "127.0.0.1:0");
    for (const [name, options] of [
      ["bench-desk-light", { acceptDownloads: true }],
      ["bench-phone-dark-chinese", { locale: "zh-CN", colorScheme: "dark", viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true }],
    ]) {
      const panel = await Panel.open(browser, bench.address, { ...options, rows: "#drives .axis" });
      const page = panel.page;
      const isDone = (words) => page.locator("#result h3.done", { hasText: words }).waitFor({ timeout: LONG });
      const isChinese = options.locale === "zh-CN";
      const words = (english, chinese) => (isChinese ? chinese : english);
      assert.ok(await page.locator("#enable").isDisabled(), "nothing is commanded without command");
      await panel.take();

      await page.locator("button.scan").click();
      // The second page sees what the first one has found before its own scan has begun.
      await page.locator("#enable:disabled").waitFor({ timeout: LONG });
      await page.locator("#drives .facts", { hasText: "CANopen SDO" }).waitFor({ timeout: LONG });
      await page.locator("#enable:enabled").waitFor({ timeout: LONG });
      await page.locator("#info").click();
      await isDone(words("information", "信息"));
      assert.ok((await page.locator("#result .report div").count()) > 5);
      await page.locator("#cycle").fill("2000");
      await page.locator("#cycle-write").click();
      await isDone(words("communication cycle", "通信周期"));
      if (isChinese) {
        // What cannot be done is told with why, and what helps.
        await panel.tab("home");
        await page.locator("#kind .primary:enabled").waitFor({ timeout: LONG });
        await page.locator("#kind input").first().fill("17");
        await page.locator("#kind .primary").click();
        await page.locator("#result h3.refused", { hasText: "方法 35 或 37 将当前位置作为零点" }).waitFor({ timeout: LONG });
      }

      await page.locator("#watch:enabled").click();
      await page.locator("#reading .position dd").waitFor({ timeout: LONG });
      const at = async () => degrees(await page.locator("#reading .position dd").textContent());
      const isAt = async (wanted) => {
        const begun = Date.now();
        while (Math.abs((await at()) - wanted) > 0.3) {
          assert.ok(Date.now() - begun < LONG, `at ${await at()}, not at ${wanted}`);
          await page.waitForTimeout(50);
        }
      };
      await page.locator("#enable:enabled").click();
      await page.locator("#drives .torque", { hasText: words("torque on", "已上力") }).waitFor({ timeout: LONG });
      await panel.tab("absolute");
      for (const target of ["10", "0"]) {
        await page.locator("#kind .primary:enabled").waitFor({ timeout: LONG });
        await page.fill("#field-target", target);
        await page.fill("#field-speed", "60");
        await page.fill("#field-acceleration", "300");
        await page.locator("#kind .primary").click();
        await isAt(Number(target));
      }
      await panel.tab("relative");
      await page.fill("#field-distance", "2,5");
      await page.locator("#kind button:enabled", { hasText: words("Forwards", "前进") }).click();
      await isAt(2.5);
      await isDone(words("relative move", "相对运动"));
      await page.locator("#send:enabled").waitFor({ timeout: LONG });

      // A frame is not sent while the drive has torque.
      await page.locator("#send:enabled").click();
      await page.locator("#said", { hasText: words("has torque", "带有转矩。未发送任何帧") }).waitFor({ timeout: LONG });
      await page.locator("#disable:enabled").click();
      await isDone(words("disable", "去使能"));
      await page.locator("#drives .torque").waitFor({ state: "hidden", timeout: LONG });
      // While a page is looked at by a program, it confirms nothing, so that nothing may have torque for it.
      await looksRight(panel, name);
      await panel.take();

      // What is held ends when it is let go.
      await panel.tab("velocity");
      await page.fill("#field-velocity", "20");
      const from = await at();
      await page.locator("#jog-plus:enabled").waitFor({ timeout: LONG });
      for (let press = 0; press < 20 && (await at()) < from + 1; press += 1) {
        await page.locator("#jog-plus:enabled").focus();
        await page.keyboard.down("Enter");
        for (let look = 0; look < 60 && (await page.locator("#jog-plus.held").count()) && (await at()) < from + 1; look += 1) await page.waitForTimeout(50);
        await page.keyboard.up("Enter");
        await page.locator("#jog-plus:enabled").waitFor({ timeout: LONG });
      }
      assert.ok((await at()) > from + 1, `from ${from} to ${await at()}`);
      await page.locator("#drives .torque").waitFor({ state: "hidden", timeout: LONG });

      // The stop is there in mid-motion, by key.
      await panel.tab("continuous");
      await page.locator("#kind button:enabled", { hasText: words("Backwards", "后退") }).click();
      await page.locator("#running", { hasText: words("continuous motion", "连续运动") }).waitFor({ timeout: LONG });
      await page.keyboard.press("Escape");
      await page.locator("#result h3.interrupted").waitFor({ timeout: LONG });
      await page.locator("#drives .torque").waitFor({ state: "hidden", timeout: LONG });

      await page.fill("#monitor-filter", "SDO");
      assert.ok((await page.locator("#frames li").count()) > 3);
      await page.locator("#monitor-pause").click();
      if (!isChinese) {
        const [download] = await Promise.all([page.waitForEvent("download"), page.locator("#monitor-export").click()]);
        assert.match(fs.readFileSync(await download.path(), "utf8"), /^\(\d+\.\d{6}\) \S+ [0-9A-F]{3}#/);
      }
      await page.locator("#monitor-clear").click();
      assert.equal(await page.locator("#frames li").count(), 0);
      await page.fill("#send-frame", "601#4000100000000000");
      await page.locator("#send:enabled").click();
      await page.locator("#monitor-pause").click();
      await page.locator("#frames li", { hasText: "601#4000100000000000" }).first().waitFor({ timeout: LONG });
      for (const tab of ["reciprocating", "torque", "home"]) {
        await panel.tab(tab);
        await isAccessible(page, `${name} ${tab}`);
      }
      await panel.close();
    }
    bench.process.removeAllListeners("exit");
    bench.process.kill("SIGINT");
    assert.equal(await ended(bench.process), 130, bench.said());
  },

  async "six pages are open, and a stop of the last one is taken"({ browser, address }) {
    const panels = [];
    for (let count = 0; count < 6; count += 1) panels.push(await Panel.open(browser, address));
    await panels[0].take();
    await panels[0].page.locator("#who", { hasText: "6 open" }).waitFor({ timeout: LONG });
    await panels[5].page.keyboard.press("Escape");
    await panels[0].phase("disabled");
    for (const panel of panels.slice(1)) await panel.close();
    await panels[0].page.locator("#groups .enable").first().click();
    await panels[0].phase("holding");
    await panels[0].close();
  },
};

async function main() {
  const place = fs.mkdtempSync(path.join(os.tmpdir(), "takt-panel-"));
  const example = fs.readFileSync(path.join(__dirname, "../../../../configs/arm6-erob.toml"), "utf8");
  fs.writeFileSync(path.join(place, "arm.toml"), `${example}\n[telemetry]\nrecord = false\n`);
  const shared = await arm(place);
  const browser = await chromium.launch(LAUNCH);
  const chosen = process.env.ONLY;
  try {
    for (const [name, step] of Object.entries(steps)) {
      if (chosen && !name.includes(chosen)) continue;
      const begun = Date.now();
      await step({ browser, place, address: shared.address }).catch(async (error) => {
        const pages = browser.contexts().flatMap((context) => context.pages());
        for (const [number, page] of pages.entries()) await page.screenshot({ path: path.join(folder, `failed-${number}.png`) }).catch(() => {});
        throw new Error(`${name}: ${error.stack}`);
      });
      console.log(`${name}: ${((Date.now() - begun) / 1000).toFixed(1)} s`);
    }
  } finally {
    await browser.close();
    shared.process.removeAllListeners("exit");
    shared.process.kill("SIGINT");
    await ended(shared.process);
    // A step that has failed has left its own.
    for (const left of started.filter(({ exitCode, signalCode }) => exitCode === null && signalCode === null)) {
      left.removeAllListeners("exit");
      left.kill("SIGKILL");
    }
    fs.rmSync(place, { recursive: true });
  }
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
