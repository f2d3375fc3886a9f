// Parses every vector with the parser that Kaitai Struct makes of kaitai/<link>.ksy, in JavaScript.
//
//   node kaitai.mjs [LINK…]                  prints `link: passed of all`, exit status 1 on a failure
//   node kaitai.mjs --compile DIR [LINK…]    writes the Python parsers into DIR, for kaitai.py
//
// A valid vector must parse, use up all bytes, and have each value of `message` in the attribute of the same name; an
// invalid one must be rejected, by the envelope that the description leaves out or by the description.

import { existsSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { isDeepStrictEqual } from "node:util";
import vm from "node:vm";

const reference = new URL("../", import.meta.url);
const require = createRequire(new URL("../target/reference/", reference));
const compiler = require("kaitai-struct-compiler");
const { KaitaiStream } = require("kaitai-struct");
const yaml = require("js-yaml");
// `TextDecoder` takes ISO 8859-1 for windows-1252, as browsers do: 80h to 9Fh would be other characters.
const { bytesToStr } = KaitaiStream;
KaitaiStream.bytesToStr = (bytes, encoding) =>
  encoding === "ISO-8859-1" ? Buffer.from(bytes).toString("latin1") : bytesToStr(bytes, encoding);
const read = (path) => readFileSync(new URL(path, reference), "utf8");

/** What is around the described bytes: [vector] → bytes. A link without an entry has none. */
const ENVELOPES = {
  "laser-eb90": (bytes, { flag = "separate" }) => {
    let at = flag === "separate" ? 4 : 3;
    const plain = bytes.slice(0, at);
    for (; bytes[at] !== 0x90 || bytes[at + 1] === 0x90; at += 1) {
      if (at >= bytes.length) throw new Error("the frame breaks off");
      plain.push(bytes[at]);
      if (bytes[at] === 0x90) at += 1;
    }
    return [...plain, ...bytes.slice(at)];
  },
  "val2-alter": (bytes, { leading_dle = 2, stuffed_checksum = false }) => {
    let at = bytes.findIndex((byte) => byte !== 0x10);
    if (at < leading_dle || bytes[at] !== 0x02) throw new Error("no start mark");
    const data = [];
    for (at += 1; bytes[at] !== 0x10 || bytes[at + 1] === 0x10; at += 1) {
      if (at >= bytes.length) throw new Error("the frame breaks off");
      data.push(bytes[at]);
      if (bytes[at] === 0x10) at += 1;
    }
    if (bytes[at + 1] !== 0x03) throw new Error("no end mark");
    const rest = bytes.slice(at + 2);
    if (stuffed_checksum && rest[0] === 0x10 && rest.splice(1, 1)[0] !== 0x10) throw new Error("no end mark");
    return [...data, ...rest];
  },
};

function compile(link, language) {
  const ksy = yaml.load(read(`kaitai/${link}.ksy`));
  return compiler.compile(language, ksy, null, false).then((files) => ({ ksy, files }));
}

// Keys that Kaitai's expressions do not allow as names.
const NAMES = { and: "and_mask", or: "or_mask" };
// What an object of this kind means where it does not name these.
const UNSAID = { start: { marked: true, error: 0 } };
const camel = (name) => name.replace(/_+(.)/g, (_, letter) => letter.toUpperCase());

/** Throws unless `found` has what `expected` has. */
function compare(found, expected, path) {
  if (Array.isArray(expected)) {
    found = found?.value ?? found; // an object stands for its value
    compare(found?.length, expected.length, `${path}.length`);
    expected.forEach((value, index) => compare(found[index], value, `${path}[${index}]`));
  } else if (expected !== null && typeof expected === "object") {
    for (const [name, value] of Object.entries(expected)) {
      compare(found?.[camel(NAMES[name] ?? name)], value, `${path}.${name}`);
    }
  } else if (typeof expected === "number" && found === Math.fround(expected)) {
    return; // a single, of which JSON has the shortest decimal
  } else if (!isDeepStrictEqual(found?.value ?? found ?? null, expected)) {
    // An object stands for its value.
    throw new Error(`${path} is ${found}, not ${expected}`);
  }
}

function check(vector, link, params, Parser) {
  const options = { ...vector.options, ...(vector.from && { sender: vector.from }) };
  // The parts of an option that is an object are parameters of their own.
  for (const [name, inner] of Object.entries(options)) {
    if (typeof inner !== "object") continue;
    for (const [part, value] of Object.entries(inner)) options[`${name}_${part}`] = value;
  }
  let bytes = [...Buffer.from(vector.hex.replaceAll(" ", ""), "hex")];
  let parsed;
  try {
    bytes = ENVELOPES[link]?.(bytes, options) ?? bytes;
    const stream = new KaitaiStream(Uint8Array.from(bytes).buffer);
    const values = params.map((param) => options[param.id] ?? param["-default"]);
    parsed = new Parser(stream, null, null, ...values);
    if (!stream.isEof()) throw new Error("bytes are left");
  } catch (error) {
    const is_fault = error instanceof TypeError || error instanceof ReferenceError;
    if (vector.error && !is_fault) return;
    throw error;
  }
  if (vector.error) throw new Error("was not rejected");
  compare(parsed, { ...UNSAID[vector.message.kind], ...vector.message }, "message");
}

async function run(link) {
  const { ksy, files } = await compile(link, "javascript");
  const [[name, source]] = Object.entries(files);
  const modules = {};
  vm.runInThisContext(`(function (exports, require) {${source}\n})`)(modules, require);
  const Parser = modules[name.replace(".js", "")];
  const { vectors } = JSON.parse(read(`vectors/${link}.json`));
  let passed = 0;
  for (const vector of vectors) {
    try {
      check(vector, link, ksy.params ?? [], Parser);
      passed += 1;
    } catch (error) {
      console.log(`${link} ${vector.id}: ${error.message ?? error}`);
    }
  }
  console.log(`${link}: ${passed} of ${vectors.length}`);
  if (passed < vectors.length) process.exitCode = 1;
}

const args = process.argv.slice(2);
const directory = args[0] === "--compile" ? args.splice(0, 2)[1] : null;
const all = readdirSync(new URL("kaitai/", reference)).map((name) => name.replace(/\.ksy$/, ""));
for (const link of args.length > 0 ? args : all) {
  if (directory === null) {
    await run(link);
  } else {
    if (!existsSync(directory)) mkdirSync(directory);
    const { ksy, files } = await compile(link, "python");
    for (const [name, source] of Object.entries(files)) writeFileSync(`${directory}/${name}`, source);
    writeFileSync(`${directory}/${link}.params.json`, JSON.stringify(ksy.params ?? []));
  }
}
