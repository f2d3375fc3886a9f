// Looks at the Web Serial page in Chromium: the simulated ball's values are shown. node page.mjs MODULES PACKAGE PICTURE
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { extname, join } from "node:path";

const [modules, folder, path] = process.argv.slice(2);
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const types = { ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm" };
const server = createServer(async ({ url }, answer) => {
  const bytes = await readFile(join(folder, new URL(url, "http://x").pathname)).catch(() => null);
  answer.writeHead(bytes ? 200 : 404, { "content-type": types[extname(url)] ?? "text/plain" }).end(bytes);
});
await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
});
const page = await browser.newPage({ viewport: { width: 640, height: 420 } });
page.on("pageerror", (error) => { throw error; });
await page.goto(`http://127.0.0.1:${server.address().port}/webserial.html`);
await page.click("#simulated");
await page.waitForFunction(() => document.querySelector("#axes tr:last-child td:last-child").textContent !== "" && document.querySelector("#state").textContent === "new");
await page.screenshot({ path });
console.log(`webserial.html: ${await page.textContent("#axes tr:first-child")}`);
await browser.close();
server.close();
