// Looks at the built site in Chromium: the playground with every vector of the reference, the search, the diagrams, two widths.
// Usage: node test.mjs MODULES SITE VECTORS PICTURES
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { extname, join, normalize } from "node:path";
import assert from "node:assert/strict";

const [modules, site, vectors, pictures] = process.argv.slice(2);
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const types = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".svg": "image/svg+xml", ".json": "application/json" };
const server = createServer(async ({ url }, answer) => {
  const path = join(site, normalize(decodeURIComponent(new URL(url, "http://x").pathname)));
  const bytes = await readFile(path.endsWith("/") ? `${path}index.html` : path).catch(() => null);
  answer.writeHead(bytes ? 200 : 404, { "content-type": types[extname(path)] ?? "application/octet-stream" }).end(bytes);
});
await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
const url = `http://127.0.0.1:${server.address().port}`;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync"],
});
const wrong = [];
async function open(path, width, height) {
  const page = await (await browser.newContext({ viewport: { width, height } })).newPage();
  page.setDefaultTimeout(120_000);
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && wrong.push(`${path}: ${message.text()}`));
  page.on("pageerror", (error) => wrong.push(`${path}: ${error}`));
  page.on("dialog", (dialog) => { wrong.push(`${path}: a dialog, ${dialog.message()}`); dialog.dismiss(); });
  page.on("request", (request) => request.url().startsWith(url) || /^(data|blob):/.test(request.url()) || wrong.push(`${path} asks ${request.url()}`));
  await page.goto(`${url}/${path}`);
  return page;
}
const picture = async (page, name) => {
  await page.screenshot({ path: `${pictures}/${name}.png` });
  const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(over <= 0, `${name} is ${over} pixels too wide`);
};

/** Whether `found` has everything that `expected` has. */
const includes = (found, expected) => typeof expected === "object" && expected !== null
  ? Object.entries(expected).every(([key, value]) => includes(found?.[key], value))
  : found === expected;
const plain = (value) => JSON.parse(JSON.stringify(value)); // negative zero is zero

function check(vector, frames, name) {
  const [first] = frames;
  assert.equal(first.at_end, vector.end ?? false, name);
  if (vector.message) {
    assert.deepEqual([frames.length, first.message], [1, plain(vector.message)], name);
  } else {
    assert.ok(includes(first.error, vector.error), `${name}: ${JSON.stringify(first.error)}`);
    assert.equal(frames.length === 1, vector.only, name);
    assert.match(first.clause, /^[A-Z]{2}-\d+$/, name);
  }
}

/** Chooses vectors as a reader does, one after the other, and reads what the page shows of each. */
const shown = (page, ids) => page.evaluate(async (ids) => {
  const select = document.getElementById("vector");
  const all = (selector) => [...document.querySelectorAll(selector)];
  const found = [];
  for (const id of ids) {
    select.value = id;
    select.dispatchEvent(new Event("change"));
    await new Promise((ready) => setTimeout(ready));
    found.push({
      frames: JSON.parse(document.getElementById("json").textContent),
      refused: document.getElementById("refused").textContent,
      cards: all(".frame").length,
      bytes: all(".byte").map((byte) => byte.textContent).join(""),
      places: all(".frame tbody tr").map((row) => row.lastElementChild.textContent),
    });
  }
  return found;
}, ids);

const page = await open("playground/index.html", 1280, 900);
await page.locator(".frame").first().waitFor();
for (const name of await page.locator("#link option").allTextContents()) {
  await page.selectOption("#link", name);
  await page.locator(`#vector option[value="1"]`).waitFor({ state: "attached" });
  await page.waitForFunction((name) => document.getElementById("clause").textContent && document.getElementById("link").value === name, name);
  const all = JSON.parse(await readFile(`${vectors}/${name}.json`, "utf8")).vectors;
  const places = new Map();
  const pages = await shown(page, all.map((vector) => String(vector.id)));
  for (const [at, vector] of all.entries()) {
    const found = pages[at];
    const title = `${name} ${vector.id}`;
    assert.equal(found.refused, "", title);
    check(vector, found.frames, title);
    assert.equal(found.cards, found.frames.length, title);
    assert.equal(found.bytes, vector.hex.replaceAll(" ", ""), title);
    found.places.forEach((place, row) => places.has(place) || places.set(place, [vector.id, row]));
  }
  // The clause of a field is there when its row has the focus, and its bytes are marked.
  for (const [place, [id, row]] of places) {
    await shown(page, [String(id)]);
    await page.locator(".frame tbody tr").nth(row).focus();
    await page.locator(`#clause[data-place="${place.replace("section ", "")}"] > :nth-child(2)`).first().waitFor();
    assert.ok(await page.locator(".byte.marked").count() > 0, `${name}: no byte is marked for ${place}`);
    const text = await page.locator("#clause").innerText();
    assert.ok(text.length > 40, `${name}, ${place}: ${text}`);
  }
  assert.ok(all.length >= 50, `${name} has ${all.length} vectors`);
  console.log(`${name}: ${all.length} vectors, ${places.size} clauses and sections`);
}

// By keyboard, from the link to a field; by pointer, from a byte to its field.
await page.selectOption("#link", "isra-ball");
await page.locator("#vector option[value='2']").waitFor({ state: "attached" });
await page.focus("#hex");
for (let press = 0; press < 40 && !(await page.evaluate(() => document.activeElement.matches(".frame tbody tr"))); press++) {
  await page.keyboard.press("Tab");
}
await page.keyboard.press("ArrowDown");
await page.locator("#clause", { hasText: "IB-10" }).waitFor();
await page.locator(".byte").nth(10).hover();
await page.locator("tr.marked", { hasText: "keys" }).waitFor();
await page.locator(".byte").nth(4).hover();
await page.locator("#clause tr.named", { hasText: "force along" }).waitFor();
await picture(page, "playground-1280");
await page.fill("#hex", "08 F8 5D 0");
assert.match(await page.locator("#refused").innerText(), /odd number of hex digits/);
await page.fill("#hex", "0x08, 0xF8, 0x5D, 00:01:FE 03-FC-05 FA\n817A 08F8");
assert.equal(await page.locator(".frame").count(), 2);
// A text of the peer is a text.
await page.selectOption("#link", "laser-eb90");
const payload = [0xF3, 28, ...Buffer.from("<img src=x onerror=alert(1)>")];
const frame = [0xEB, 0x90, 0x82, 0xF0, ...payload, 0x90, 0x82, payload.reduce((sum, byte) => sum + byte) % 256];
await page.locator("#vector option[value='104']").waitFor({ state: "attached" });
await page.fill("#hex", Buffer.from(frame).toString("hex"));
await page.locator(".frame td", { hasText: "onerror" }).waitFor();
assert.equal(await page.locator("main img").count(), 0);

const phone = await open("playground/index.html", 390, 844);
await phone.locator(".frame").first().waitFor();
await phone.selectOption("#link", "mmacell-proto");
await phone.getByRole("group", { name: "Examples" }).getByRole("button").nth(1).click();
await phone.locator(".frame tbody tr").nth(1).focus();
await phone.locator("#clause h2").waitFor();
await picture(phone, "playground-390");
await phone.evaluate(() => document.getElementById("frames").scrollIntoView());
await picture(phone, "playground-390-frames");
console.log("playground: keyboard, pointer, wrong hex, a text with markup, 390 pixels");

// The book.
const book = await open("docs/first-robot.html", 1280, 900);
await picture(book, "page-1280");
await book.keyboard.press("s");
await book.locator("input[type=search]").fill("stuffing");
await book.locator("#mdbook-searchresults li").first().waitFor();
await picture(book, "search-1280");
await book.locator("#mdbook-searchresults li a").first().click();
assert.match(await book.locator("main").innerText(), /stuff/i);
for (const [path, name] of [["reference/isra-ball.html#IB-6", "specification"], ["index.html", "first-page"], ["BENCHMARKS.html", "figures"]]) {
  for (const [width, height] of [[1280, 900], [390, 844]]) await picture(await open(path, width, height), `${name}-${width}`);
}
let drawn = 0;
for (const path of (await readFile(`${site}/diagrams.txt`, "utf8")).trim().split("\n")) {
  const page = await open(path, 1280, 900);
  await page.locator("pre.mermaid svg").first().waitFor();
  assert.equal(await page.locator("pre.mermaid:not(:has(svg))").count(), 0, path);
  if (drawn++ === 0) await picture(page, "diagram-1280");
  await page.context().close();
}
console.log(`book: search, ${drawn} pages with diagrams, 390 pixels`);
await browser.close();
server.close();
assert.deepEqual(wrong, []);
