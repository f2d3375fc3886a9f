// Looks at the bridge's page in Chromium: a site of 50 cells, one of which has a hostile name, another dies, the broker goes and comes.
// Usage: node page.mjs MODULES URL FOLDER; it reads from standard input what has happened, and answers each line when the page shows it.
import { createRequire } from "node:module";
import { createInterface } from "node:readline";

const [modules, url, folder] = process.argv.slice(2);
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync"],
});
const wrong = [];
const open = async (width, height) => {
  const page = await (await browser.newContext({ viewport: { width, height } })).newPage();
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && wrong.push(message.text()));
  page.on("pageerror", (error) => wrong.push(String(error)));
  page.on("dialog", (dialog) => { wrong.push(`a dialog: ${dialog.message()}`); dialog.dismiss(); });
  page.on("request", (request) => request.url().startsWith(url) || request.url() === "data:," || wrong.push(`it asks ${request.url()}`));
  page.on("request", (request) => request.method() === "GET" || wrong.push(`it sends ${request.method()}`));
  await page.goto(url);
  return page;
};
const pages = { wide: await open(1280, 900), phone: await open(390, 844) };

/** Waits until every page shows it; the text of an element that matches. */
const shows = async (selector, pattern) => {
  for (const page of Object.values(pages)) {
    await page.locator(selector).filter({ hasText: new RegExp(pattern) }).first().waitFor({ timeout: 30_000 });
  }
};
const steps = {
  shows: ({ selector, pattern }) => shows(selector, pattern),
  async picture({ name, at }) {
    for (const [kind, page] of Object.entries(pages)) {
      await page.evaluate((at) => at ? document.querySelector(at).scrollIntoView() : scrollTo(0, 0), at);
      await page.screenshot({ path: `${folder}/${name}-${kind}.png` });
      const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      if (over > 0) throw new Error(`${name}: ${kind} is ${over} pixels too wide`);
    }
  },
  /** The text is there as text, and nothing of it has become an element. */
  async harmless({ text }) {
    await shows("#rows td.first", text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&"));
    for (const page of Object.values(pages)) {
      if (await page.locator("main img, main script, main b").count()) throw new Error("a name has become an element");
    }
  },
  async wrong({ but }) {
    const found = wrong.splice(0).filter((text) => !(but && new RegExp(but).test(text)));
    if (found.length) throw new Error(found.join("; "));
  },
};
for await (const line of createInterface({ input: process.stdin })) {
  const { step, ...rest } = JSON.parse(line);
  try {
    await steps[step](rest);
    console.log(JSON.stringify({ ok: line }));
  } catch (error) {
    console.log(JSON.stringify({ failed: line, why: String(error), wrong }));
    break;
  }
}
await browser.close();
