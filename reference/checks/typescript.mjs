// Runs changes of the TypeScript port for mutant_runs.py, all in one process: node typescript.mjs TSC FOLDER TYPES
//
// Each line of standard input is a request, an object with one of these fields, and gets a line:
// valid: [path, source] of changed files; whether the compiler finds no error in each, but for what a change leaves unused.
// cases: lines for the testee; what the port itself answers to each, and the seconds of a processor that it took.
// file, source, order: the first of these cases to which the changed port answers in another way; an answer of null: it fails, or
// does not end.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { Script } from "node:vm";

const LOOP = 0.5; // seconds of a processor that one answer may take, besides what it takes without a change
const BATCH = 200; // changes that the compiler sees at once

const [compiler, folder, typeRoot] = process.argv.slice(2);
const ts = createRequire(import.meta.url)(compiler);
const { config } = ts.readConfigFile(`${folder}/tsconfig.json`, ts.sys.readFile);
const { fileNames, options } = ts.parseJsonConfigFileContent(config, ts.sys, folder, {
  typeRoots: [typeRoot],
  noUnusedLocals: false,
  noUnusedParameters: false,
});
const testee = join(folder, "testee-answers.ts");
const codeOf = new Map(fileNames.filter((name) => name !== join(folder, "testee.ts")).map((name) => [name, compiled(name, readFileSync(name, "utf8"))]));
const imports = new Map([...codeOf.keys()].map((name) => [name, new Set()]));

let base; // the compiler's program without a change

/** Each changed file stands beside the others under a name of its own: the compiler reads what they import only once. */
function valid(changes) {
  const sources = new Map(changes.map(([path, source], number) => [path.replace(/\.ts$/, `.${number}.ts`), source]));
  const host = ts.createCompilerHost(options);
  const read = host.getSourceFile.bind(host);
  host.fileExists = (name) => sources.has(name) || ts.sys.fileExists(name);
  host.getSourceFile = (name, ...rest) =>
    sources.has(name) ? ts.createSourceFile(name, sources.get(name), ...rest) : (base?.getSourceFile(name) ?? read(name, ...rest));
  const program = ts.createProgram([...fileNames, ...sources.keys()], options, host);
  base ??= program;
  return [...sources.keys()].map((name) => {
    const file = program.getSourceFile(name);
    return program.getSyntacticDiagnostics(file).length + program.getSemanticDiagnostics(file).length === 0;
  });
}

/** A function that runs a file as a module. */
function compiled(name, source) {
  const compilerOptions = { ...options, module: ts.ModuleKind.CommonJS, moduleResolution: ts.ModuleResolutionKind.Node10, declaration: false };
  const { outputText } = ts.transpileModule(source, { fileName: name, compilerOptions });
  // A file may have a function that is called `require` itself.
  const code = outputText.replace(/= require\("/g, '= imported("');
  return new Script(`(function (exports, imported) {${code}\n})`, { filename: name }).runInThisContext();
}

/** The files that import a file, themselves or through others, and the file. */
function concerned(name) {
  const found = new Set([name]);
  for (const file of found) {
    for (const [other, imported] of imports) if (imported.has(file)) found.add(other);
  }
  return found;
}

/** The testee's function, of modules that are run now, but for those that stay as they are. */
function load(change, kept) {
  const modules = new Map(kept);
  const module = (name) => {
    if (!modules.has(name)) {
      const exports = {};
      modules.set(name, exports);
      const code = name === change?.file ? compiled(name, change.source) : codeOf.get(name);
      code(exports, (imported) => {
        const file = join(dirname(name), imported.replace(/\.js$/, ".ts"));
        imports.get(name).add(file);
        return module(file);
      });
    }
    return modules.get(name);
  };
  return [module(testee).answerOf, modules];
}

const step = new Script("current()");

/** What a function gives, null where it fails or takes longer than that, and the seconds of a processor; the clock alone says nothing. */
function limited(call, seconds) {
  globalThis.current = call;
  for (let wait = seconds; ; wait *= 2) {
    const begun = process.cpuUsage();
    let result = null;
    let late = false;
    try {
      result = step.runInThisContext({ timeout: Math.ceil(1000 * wait) });
    } catch (error) {
      late = error?.code === "ERR_SCRIPT_EXECUTION_TIMEOUT";
    }
    const { user, system } = process.cpuUsage(begun);
    const taken = (user + system) / 1e6;
    if (!late || taken > seconds / 2) return [result, taken];
  }
}

const [original, modules] = load(null, []);
const dependents = new Map([...codeOf.keys()].map((name) => [name, concerned(name)]));
let cases = [];

function changed({ file, source, order }) {
  const kept = [...modules].filter(([name]) => !dependents.get(file).has(name));
  const [loaded] = limited(() => load({ file, source }, kept), LOOP);
  if (loaded === null) return { at: order[0], answer: null };
  for (const at of order) {
    const { line, answer, seconds } = cases[at];
    const [found] = limited(() => loaded[0](line), LOOP + 3 * seconds);
    if (found !== answer) return { at, answer: found };
  }
  return {};
}

function answer(request) {
  if (request.valid) {
    const batches = Array.from({ length: Math.ceil(request.valid.length / BATCH) }, (_, at) => request.valid.slice(BATCH * at, BATCH * (at + 1)));
    return batches.flatMap(valid);
  }
  if (!request.cases) return changed(request);
  cases = request.cases.map((line) => {
    const [answer, seconds] = limited(() => original(line), 600);
    return { line, answer, seconds };
  });
  return cases.map(({ answer, seconds }) => [answer, seconds]);
}

for await (const line of createInterface({ input: process.stdin })) console.log(JSON.stringify(answer(JSON.parse(line))));
