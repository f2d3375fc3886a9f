// Writes links.d.ts from the schemas of the reference and the module's table: node types.mjs CELLWIRE_WASM REFERENCE
// With --claims in the place of the folder: the links and ends of the module, as testee.py claims them.
import { readFileSync } from "node:fs";
import { load } from "./cellwire.js";

const [module, folder] = process.argv.slice(2);
const { links } = await load(readFileSync(module));
if (folder === "--claims") {
  console.log(links.flatMap(({ name, ends }) => [name, ...Object.keys(ends).map((end) => `${name}/${end}`)]).join("\n"));
  process.exit();
}
const read = (name) => JSON.parse(readFileSync(`${folder}/${name}`));
const schemas = Object.fromEntries(["messages", "events", "sessions"].map((name) => [`${name}.schema.json`, read(`${name}.schema.json`)]));
const fields = read("defaults.json").fields;
const key = (name) => /^[a-z_]\w*$/i.test(name) ? name : JSON.stringify(name);
const object = (entries) => `{ ${entries.join("; ")} }`;

/** The type of a schema in a file. */
function type(schema, file) {
  if (schema.$ref) {
    const [other, path] = schema.$ref.split("#/$defs/");
    return type(schemas[other || file].$defs[path], other || file);
  }
  const each = (list) => [...new Set(list.map((it) => type(it, file)))].join(" | ");
  if ("const" in schema) return JSON.stringify(schema.const);
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" | ");
  if (schema.properties) {
    const required = new Set(schema.required ?? []);
    const whole = schema.oneOf?.every((it) => Object.keys(it).join() === "required") ? {} : schema;
    const own = object(Object.entries(schema.properties).map(([name, it]) => `${key(name)}${required.has(name) ? "" : "?"}: ${type(it, file)}`));
    const others = (whole.oneOf ?? whole.anyOf ?? []).filter((it) => it.properties);
    return others.length ? `${own} & (${each(others)})` : own;
  }
  if (schema.oneOf || schema.anyOf) return each(schema.oneOf ?? schema.anyOf);
  if (Array.isArray(schema.type)) return each(schema.type.map((name) => ({ ...schema, type: name })));
  if (schema.type === "array") {
    const item = schema.items ? type(schema.items, file) : "unknown";
    const { minItems, maxItems } = schema;
    return minItems === maxItems && maxItems <= 16 ? `[${Array(maxItems).fill(item).join(", ")}]` : `(${item})[]`;
  }
  const plain = { integer: "number", number: "number", string: "string", boolean: "boolean", null: "null" };
  return plain[schema.type] ?? "Record<string, unknown>";
}

const defined = (file, name) => name in schemas[file].$defs ? type(schemas[file].$defs[name], file) : "Record<string, never>";

/** The type of a configuration's field. */
function field({ link, range, unit, default: value }) {
  const orNull = range.includes("null:") ? " | null" : "";
  const nested = configuration(link, range);
  if (nested) return `Partial<${nested}>${orNull}`;
  if (unit === "code") return "unknown";
  if (unit === "ns") return `number | bigint${orNull}`;
  if (value === null) return "number | null";
  if (typeof value === "object") return "unknown";
  const words = typeof value === "string" ? [...range.matchAll(/[a-z_0-9]+/g)].map(([word]) => JSON.stringify(word)) : [];
  return (words.length > 1 ? words.join(" | ") : typeof value) + orNull;
}

function configuration(link, name) {
  const own = fields.filter((it) => it.link === link && it.config === name);
  return own.length ? `{\n${own.map((it) => `  /** ${it.about}; ${it.range}; default ${JSON.stringify(it.default)}${it.unit === "ns" ? " ns" : ""} */\n  ${key(it.field)}: ${field(it)};`).join("\n")}\n}` : null;
}

const inputs = schemas["sessions.schema.json"].$defs.input.properties;

/** Kawasaki's table of messages and layout of a job are three fields of their own. */
const beside = { "kawasaki-msg": '{ charset: "ascii" | "latin1"; messages: Record<string, unknown>; job: Record<string, unknown>[] }' };

function end(link, name, calls) {
  const config = configuration(link, `${name[0].toUpperCase()}${name.slice(1)}Config`) ?? "{}";
  return object([
    `config: ${config}${beside[link] ? ` & ${beside[link]}` : ""}`,
    `event: ${defined("events.schema.json", `${link}.event.${name}`)}`,
    `calls: ${object(calls.map((call) => `${key(call)}: ${type(inputs[call], "sessions.schema.json")}`))}`,
  ]);
}

console.log("// Written from the schemas of the reference.\nexport interface Links {");
for (const { name, sides, about, ends } of links) {
  const side = (each) => [`${name}.message.${each}`, `${name}.message`].find((it) => it in schemas["messages.schema.json"].$defs);
  console.log(`/** ${about} */\n"${name}": {`);
  console.log(`options: ${defined("messages.schema.json", `${name}.options`)};`);
  console.log(`messages: ${object(sides.map((each) => `${key(each)}: ${defined("messages.schema.json", side(each))}`))};`);
  console.log(`error: ${defined("messages.schema.json", `${name}.error`)};`);
  console.log(`ends: {\n${Object.entries(ends).map(([each, calls]) => `${key(each)}: ${end(name, each, calls)};`).join("\n")}\n};\n};`);
}
console.log("}");
