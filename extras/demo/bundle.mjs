// One page of the panel's files, the demonstration's, the module and the configuration. It needs nothing beside itself.
//
//   node bundle.mjs FOLDER-OF-THE-MODULE PAGE.html      (extras/demo/build calls it)

import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const [moduleFolder, page] = process.argv.slice(2);
const here = path.dirname(fileURLToPath(import.meta.url));
const root = path.join(here, "../..");
const read = (...parts) => readFileSync(path.join(...parts), "utf8");
const panel = path.join(root, "crates/panel/src/page");

const SCRIPTS = {
  ...Object.fromEntries(["connection", "texts", "chinese", "frame", "units", "panel", "axes", "motion", "monitor", "plots"].map((name) => [`${name}.js`, read(panel, `${name}.js`)])),
  "takt.mjs": read(moduleFolder, "takt.mjs"),
  "arm.js": read(here, "arm.js"),
  "demo.js": read(here, "demo.js"),
};
const data = (type, text) => `data:${type};base64,${Buffer.from(text).toString("base64")}`;
// A page of one file has no paths: its scripts find each other by names.
const named = (script) => script.replace(/(from |import\()"\.\/([\w.]+)"/g, (_, before, name) => {
  if (!SCRIPTS[name]) throw new Error(`there is no ${name}`);
  return `${before}"takt/${name}"`;
});
const imports = Object.fromEntries(Object.entries(SCRIPTS).map(([name, script]) => [`takt/${name}`, data("text/javascript", named(script))]));

const main = "arm6-erob.toml";
const files = { main, files: [[main, read(root, "configs", main)]] };
const inScript = (value) => JSON.stringify(value).replaceAll("</", "<\\/");

const put = (html, from, to) => {
  if (!html.includes(from)) throw new Error(`the page of the panel has no ${from}`);
  return html.replace(from, () => to);
};
let html = ["top.html", "controller.html", "bottom.html"].map((part) => read(panel, part)).join("");
html = put(html, '<link rel="icon" href="/icon.svg">', `<link rel="icon" href="${data("image/svg+xml", read(panel, "icon.svg"))}">`);
html = put(html, '<link rel="stylesheet" href="/panel.css">', `<style>${read(panel, "panel.css")}${read(here, "demo.css")}</style>`);
html = put(html, '<script type="module" src="/page.js"></script>', `<script type="importmap">${inScript({ imports })}</script>
<script type="application/json" id="takt-files">${inScript(files)}</script>
<script type="module">import "takt/demo.js";</script>`);
html = put(html, "<main>", '<div class="demo-place"><section class="card demo" id="demo"></section></div>\n<main>');
html = put(html, "</body>", `<script type="text/plain" id="takt-wasm">${gzipSync(readFileSync(path.join(moduleFolder, "takt.wasm")), { level: 9 }).toString("base64")}</script>\n</body>`);
writeFileSync(page, html);
console.log(`${page}: ${(html.length / 1e6).toFixed(1)} MB`);
