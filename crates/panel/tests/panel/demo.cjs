// The demonstration, opened from the disk: the arm is moved, broken, and its black box read.
//
//   node demo.cjs PAGE.html FOLDER      (crates/panel/tests/panel/run calls it)

const assert = require("node:assert/strict");
const path = require("node:path");
const { pathToFileURL } = require("node:url");
const { chromium } = require("playwright-core");

const [page, folder] = process.argv.slice(2);
const LONG = 60_000;
const SHAPES = [
  ["desk", { viewport: { width: 1440, height: 1000 }, colorScheme: "light" }],
  ["dark", { viewport: { width: 1440, height: 1000 }, colorScheme: "dark" }],
  ["phone", { viewport: { width: 390, height: 844 }, colorScheme: "light", hasTouch: true, isMobile: true }],
];

async function open(browser, options) {
  const context = await browser.newContext({ locale: "en-US", ...options });
  const tab = await context.newPage();
  const problems = [];
  tab.on("pageerror", (error) => problems.push(String(error)));
  tab.on("console", (message) => message.type() === "error" && problems.push(message.text()));
  tab.on("request", (request) => /^(file|data|blob):/.test(request.url()) || problems.push(`asks elsewhere: ${request.url()}`));
  await tab.goto(pathToFileURL(path.resolve(page)).href);
  await tab.locator("#link.live").waitFor({ timeout: LONG });
  await phase(tab, "Holding");
  return { tab, problems };
}

const phase = (tab, words) => tab.locator("#groups .phase", { hasText: new RegExp(words, "i") }).first().waitFor({ timeout: LONG });

async function main() {
  const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--headless", "--no-sandbox", "--disable-gpu"] });
  for (const [name, options] of SHAPES) {
    const { tab, problems } = await open(browser, options);
    await tab.locator("#chosen").selectOption("1");
    await tab.locator("#tab-jog").click();
    const jog = tab.locator("#jog-plus");
    await jog.scrollIntoViewIfNeeded();
    const box = await jog.boundingBox();
    await tab.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await tab.mouse.down();
    await phase(tab, "following points");
    await tab.waitForTimeout(1000);
    await tab.locator("#broken-axis").selectOption("1");
    await tab.evaluate(() => document.getElementById("break-blocked").click());
    await tab.locator("#faults .banner").first().waitFor({ timeout: LONG });
    await tab.mouse.up();
    await tab.evaluate(() => scrollTo(0, 0));
    await tab.locator("#read-box:not([disabled])").waitFor({ timeout: LONG });
    await tab.screenshot({ path: path.join(folder, `demo-${name}.png`), fullPage: name === "phone" });
    await tab.waitForTimeout(700);
    await tab.locator("#read-box").click();
    const report = await tab.locator("#report pre").textContent();
    assert.match(report, /following error/, report);
    await tab.screenshot({ path: path.join(folder, `demo-${name}-report.png`) });
    await tab.locator("#report button").click();
    await tab.locator("#break-blocked").click();
    await tab.locator("#faults .banner button").click();
    await phase(tab, "Disabled");
    await tab.locator("#groups button.enable").click();
    await phase(tab, "Holding");
    await tab.locator("#again").click();
    await tab.locator("#boxes[hidden]").waitFor({ state: "attached", timeout: LONG });
    await phase(tab, "Holding");
    await tab.locator("#language").click();
    assert.match(await tab.locator("#demo h2").textContent(), /仿真/);
    // What takt has said is there in Chinese; and so is what it refuses now.
    await tab.locator("#events li", { hasText: "状态：" }).first().waitFor({ timeout: LONG });
    const english = (await tab.locator("#events li span").allTextContents()).filter((words) => !/[\u4e00-\u9fff]/.test(words));
    assert.deepEqual(english, [], `${name}: events without Chinese words`);
    await tab.locator("#tab-mode").click();
    await tab.locator("#field-mode").selectOption("1");
    await tab.locator("#kind button", { hasText: "更改模式" }).click();
    await tab.locator("#said", { hasText: "被拒绝" }).waitFor({ timeout: LONG });
    await tab.locator("#broken-axis").selectOption("1");
    await tab.evaluate(() => document.getElementById("break-over_voltage").click());
    await tab.locator("#faults .banner", { hasText: /joint2 的驱动器报告故障.*过压.*建议：/ }).waitFor({ timeout: LONG });
    await tab.screenshot({ path: path.join(folder, `demo-${name}-chinese.png`) });
    assert.ok(await tab.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${name}: wider than the screen`);
    assert.deepEqual(problems, [], name);
    console.log(`${name}: the arm of the demonstration moves, stops, tells why, and begins anew`);
    await tab.context().close();
  }
  await browser.close();
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
