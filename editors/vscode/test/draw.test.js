// The picture of a program, by the tool that CELLWIRE names; and what a user reads where there is none.
const assert = require("node:assert");
const { copyFileSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } = require("node:fs");
const { tmpdir } = require("node:os");
const { join } = require("node:path");
const { test } = require("node:test");
const { draw } = require("../src/draw");
const { advice, page, serverArguments } = require("../src/texts");

const cellwire = process.env.CELLWIRE ?? "cellwire";
const example = join(__dirname, "../../example");

/** A folder whose name has what a shell and a URI would change. */
function folder(t) {
    const place = mkdtempSync(join(tmpdir(), "a cell's & é-"));
    t.after(() => rmSync(place, { recursive: true }));
    return place;
}

test("a program is drawn", async (t) => {
    const place = folder(t);
    for (const name of readdirSync(example)) copyFileSync(join(example, name), join(place, name));
    const { svg, text, good } = await draw(cellwire, join(place, "PICK.LS"), ["--inputs", "DI[1]:0-"]);
    assert.match(svg, /^<svg .*<\/svg>\s*$/s);
    assert.match(text, /"event":"program_ended"/);
    assert.match(text, /\d mm\n/);
    assert.ok(good);
    // Its page has the picture as data, and allows nothing else.
    const html = page("PICK.LS", { svg, text, good });
    assert.strictEqual(Buffer.from(/base64,([^"]*)"/.exec(html)[1], "base64").toString(), svg);
    assert.match(html, /default-src 'none'; img-src data:/);
    assert.doesNotMatch(html, /class="bad"/);
    assert.deepStrictEqual(readdirSync(place), readdirSync(example), "nothing is written beside the programs");
});

test("a program that stops is drawn up to there, with the reason", async (t) => {
    const place = folder(t);
    const program = readFileSync(join(example, "PICK.LS"), "utf8");
    writeFileSync(join(place, "PICK.LS"), program.replace(" TIMEOUT,LBL[99]", ""));
    const { svg, text, good } = await draw(cellwire, join(place, "PICK.LS"), []);
    assert.ok(svg);
    assert.match(text, /has waited for `WAIT DI\[1:sheet here\]=ON`/);
    assert.ok(!good);
    assert.match(page("PICK.LS", { svg, text, good }), /class="bad"/);
});

test("a file that is no program has no picture", async (t) => {
    const file = join(folder(t), "A.LS");
    writeFileSync(file, "<b>no program</b>");
    const { svg, text, good } = await draw(cellwire, file, []);
    assert.strictEqual(svg, undefined);
    assert.ok(!good);
    assert.match(text, /A\.LS/);
    assert.doesNotMatch(page("<b>", { svg, text: "<b>&", good }), /<b>/);
});

test("a simulation ends when its panel is closed", async (t) => {
    const file = join(folder(t), "LOOP.LS");
    writeFileSync(file, "/PROG LOOP\n/MN\n   1:  LBL[1] ;\n   2:  JMP LBL[1] ;\n/POS\n/END\n");
    const before = readdirSync(tmpdir()).filter((name) => name.startsWith("cellwire-")).length;
    const stop = new AbortController();
    const drawn = draw(cellwire, file, ["--for", "86400s"], stop.signal);
    setTimeout(() => stop.abort(), 100);
    assert.ok(!(await drawn).good);
    assert.strictEqual(readdirSync(tmpdir()).filter((name) => name.startsWith("cellwire-")).length, before, "its folder is removed");
});

test("a program that is not installed is named, with the setting", async () => {
    const { text, good } = await draw("/nowhere/cellwire", join(example, "PICK.LS"), []);
    assert.ok(!good);
    assert.strictEqual(text, "There is no program /nowhere/cellwire: install cellwire, or set cellwire.path to its file.");
    assert.strictEqual(advice("cellwire", new Error("killed ")), "cellwire does not run: killed");
    assert.deepStrictEqual(serverArguments(["--name-limit", "8"]), ["ls", "lsp", "--name-limit", "8"]);
});

test("the manifest names the commands and settings of the code, and no others", () => {
    const code = readFileSync(join(__dirname, "../src/extension.js"), "utf8");
    const { contributes } = JSON.parse(readFileSync(join(__dirname, "../package.json"), "utf8"));
    const all = (pattern) => [...code.matchAll(pattern)].map(([, name]) => name);
    assert.deepStrictEqual(new Set(contributes.commands.map(({ command }) => command)), new Set(all(/registerCommand\("([^"]+)"/g)));
    // The client reads the last one.
    const settings = [...all(/settings\.get\("([^"]+)"/g), "trace.server"].map((name) => `cellwire.${name}`);
    assert.deepStrictEqual(new Set(Object.keys(contributes.configuration.properties)), new Set(settings));
});
