// Compiles the files of a copy of the TypeScript port for mutant_runs.py: node typescript.mjs TSC FOLDER TYPES OUT
//
// Compiles all of them, then reads paths from standard input, a file that has changed a line, and compiles each again; answers
// "built", or "refused" where the compiler finds an error in it. What is unused is none: a change may leave it so.

import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname } from "node:path";
import { createInterface } from "node:readline";

const [compiler, folder, typeRoot, outDir] = process.argv.slice(2);
const ts = createRequire(import.meta.url)(compiler);
const { config } = ts.readConfigFile(`${folder}/tsconfig.json`, ts.sys.readFile);
const { fileNames, options } = ts.parseJsonConfigFileContent(config, ts.sys, folder, {
  outDir,
  typeRoots: [typeRoot],
  noUnusedLocals: false,
  noUnusedParameters: false,
});
const versions = new Map(fileNames.map((name) => [name, 0]));
const service = ts.createLanguageService({
  getScriptFileNames: () => fileNames,
  getScriptVersion: (name) => String(versions.get(name) ?? 0),
  getScriptSnapshot: (name) => (ts.sys.fileExists(name) ? ts.ScriptSnapshot.fromString(readFileSync(name, "utf8")) : undefined),
  getCurrentDirectory: () => folder,
  getCompilationSettings: () => options,
  getDefaultLibFileName: (settings) => ts.getDefaultLibFilePath(settings),
  fileExists: ts.sys.fileExists,
  readFile: ts.sys.readFile,
  directoryExists: ts.sys.directoryExists,
  getDirectories: ts.sys.getDirectories,
});

function build(name) {
  versions.set(name, (versions.get(name) ?? 0) + 1);
  if (service.getSyntacticDiagnostics(name).length + service.getSemanticDiagnostics(name).length > 0) return "refused";
  for (const { name: written, text } of service.getEmitOutput(name).outputFiles) {
    mkdirSync(dirname(written), { recursive: true });
    writeFileSync(written, text);
  }
  return "built";
}

console.log(fileNames.every((name) => build(name) === "built") ? "built" : "refused");
for await (const line of createInterface({ input: process.stdin })) console.log(build(line));
