// The grammar on programs: which scopes the words have.
const assert = require("node:assert");
const { readFileSync } = require("node:fs");
const { join } = require("node:path");
const { test } = require("node:test");
const oniguruma = require("vscode-oniguruma");
const { INITIAL, Registry, parseRawGrammar } = require("vscode-textmate");

const file = join(__dirname, "../syntaxes/fanuc-ls.tmLanguage.json");

/** The grammar, as an editor loads it. */
async function grammar() {
    await oniguruma.loadWASM(readFileSync(require.resolve("vscode-oniguruma/release/onig.wasm")));
    const registry = new Registry({
        onigLib: Promise.resolve({
            createOnigScanner: (sources) => new oniguruma.OnigScanner(sources),
            createOnigString: (text) => new oniguruma.OnigString(text),
        }),
        loadGrammar: async () => parseRawGrammar(readFileSync(file, "utf8"), file),
    });
    return registry.loadGrammar("source.fanuc-ls");
}
const loaded = grammar();

/** The words of a text with the last scope of each, without the language's name: [line, word, scope]. */
async function words(text) {
    const it = await loaded;
    let stack = INITIAL;
    return text.split(/\r?\n/).flatMap((line, at) => {
        const { tokens, ruleStack } = it.tokenizeLine(line, stack);
        stack = ruleStack;
        const word = ({ startIndex, endIndex, scopes }) => [at, line.slice(startIndex, endIndex), scopes.at(-1).replace(/\.fanuc-ls$/, "")];
        return tokens.map(word).filter(([, word]) => word.trim());
    });
}

/** The words of one statement after its number. */
async function statement(text) {
    const all = await words(`/PROG A\n/MN\n   1:${text} ;\n   2:  END ;\n/POS\n/END`);
    // A statement never reaches into the next one.
    assert.deepStrictEqual(all.filter(([line]) => line === 3).map(([, word, scope]) => [word.trim(), scope])[2], ["END", "keyword.control.flow"], text);
    return all.filter(([line]) => line === 2).slice(2).map(([, word, scope]) => `${word.trim()} ${scope}`);
}

test("motions", async () => {
    assert.deepStrictEqual(await statement("L P[3:belt] 150mm/sec CNT50 ACC80 Offset,PR[90:z up]   "), [
        "L keyword.control.motion", "P support.constant.position", "[ punctuation.section.brackets", "3 constant.numeric", ": meta", "belt string.unquoted.name",
        "] punctuation.section.brackets", "150 constant.numeric", "mm/sec keyword.other.unit", "CNT storage.modifier.termination", "50 constant.numeric",
        "ACC storage.modifier.option", "80 constant.numeric", "Offset storage.modifier.option", ", meta", "PR variable.other.register",
        "[ punctuation.section.brackets", "90 constant.numeric", ": meta", "z up string.unquoted.name", "] punctuation.section.brackets", "; punctuation.terminator",
    ].map((it) => it.replace(/ meta$/, " meta.main")));
    for (const letter of "JLCAS") assert.strictEqual((await statement(`${letter} PR[2] 100% FINE`))[0], `${letter} keyword.control.motion`);
});

test("instructions", async () => {
    const has = async (text, ...expected) => {
        const found = await statement(text);
        for (const it of expected) assert.ok(found.includes(it), `${text}: ${it} is not among ${found.join(", ")}`);
    };
    await has("  IF R[1:sheets]<3,JMP LBL[1:next]", "IF keyword.control.flow", "R variable.other.register", "< keyword.operator", "JMP keyword.control.flow", "LBL entity.name.label", "next string.unquoted.name");
    await has("  SELECT R[55]=1,CALL A_B", "SELECT keyword.control.flow", "CALL keyword.control.flow", "A_B entity.name.function");
    await has("  FOR R[1]=1 TO R[R[2]]", "FOR keyword.control.flow", "TO keyword.control.flow");
    await has("  DO[5:Fault]=PULSE,0.5sec", "DO variable.other.io", "Fault string.unquoted.name", "PULSE constant.language", "0.5 constant.numeric", "sec keyword.other.unit");
    await has("  WAIT   .50(sec)", "WAIT keyword.control.flow", ".50 constant.numeric", "(sec) keyword.other.unit");
    await has("  WAIT DI[1]=ON TIMEOUT,LBL[99]", "ON constant.language", "TIMEOUT keyword.control.flow");
    await has("  $WAITTMOUT=500", "$WAITTMOUT variable.language.system");
    await has("  CALL SR[25]", "CALL keyword.control.flow", "SR variable.other.register");
    await has("  MESSAGE[no [sheet] here]", "no [sheet] here string.unquoted.message");
    await has("  WENN E[1]=EIN,SPRUNG LBL[2]", "WENN keyword.control.flow", "E variable.other.io", "EIN constant.language", "SPRUNG keyword.control.flow");
});

test("remarks and instructions that are switched off", async () => {
    assert.deepStrictEqual(await statement("  !it's; a R[1] remark"), ["!it's; a R[1] remark comment.line", "; punctuation.terminator"]);
    assert.deepStrictEqual(await statement("  --eg:a remark"), ["--eg:a remark comment.line", "; punctuation.terminator"]);
    assert.deepStrictEqual(await statement("  //CALL WELD"), ["//CALL WELD comment.line.disabled", "; punctuation.terminator"]);
    // The teach pendant breaks a long remark; one without its `;` ends before the next number.
    const all = await words("/MN\n   1:  --eg:long\n    :  and more ;\n   2:  !open\n   3:  END ;\n/END");
    assert.deepStrictEqual(all.filter(([, , scope]) => scope === "comment.line").map(([line]) => line), [1, 2, 3]);
    assert.ok(all.some(([line, word, scope]) => line === 4 && word === "END" && scope === "keyword.control.flow"));
});

test("what does not end within its line does not colour the next ones", async () => {
    for (const text of ["  R[1:x", "  MESSAGE[x", "  CALL", "J P[", "  R[R[", "  VISION RUN_FIND 'A", "  !"]) await statement(text);
});

test("header, and positions as data", async () => {
    const all = await words(readFileSync(join(__dirname, "../../example/PICK.LS"), "utf8"));
    const scope = (text) => all.find(([, word]) => word.trim() === text)?.[2];
    assert.strictEqual(scope("/PROG"), "keyword.control.section");
    assert.strictEqual(scope("PICK"), "entity.name.function.program");
    assert.strictEqual(scope("TASK_PRIORITY"), "variable.other.property");
    assert.strictEqual(scope("\"Sheets to stack\""), "string.quoted.double");
    assert.strictEqual(scope("\"above belt\""), "string.quoted.double");
    assert.strictEqual(scope("CONFIG"), "variable.other.property");
    assert.strictEqual(scope("-220.000"), "constant.numeric");
    // `P` and `R` of a pose are no position and no register.
    const pose = all.filter(([, word, scope]) => /^[PR]$/.test(word.trim()) && scope === "variable.other.property");
    assert.strictEqual(pose.length, 12);
    assert.strictEqual(all.at(-1)[2], "keyword.control.section");
});
