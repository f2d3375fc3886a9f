// The playground: asks the codecs, which are the module of the JavaScript package, what bytes are, and shows it with the text of the specification.
import { Specification } from "./specification.js";

const SHOWN = 200; // frames of a long stream
const COLOURS = 6; // of parts, as the style sheet has them

const $ = (id) => document.getElementById(id);
const encoder = new TextEncoder(), decoder = new TextDecoder();
const code = await (await fetch("cellwire.wasm")).arrayBuffer();
let codecs = null;

/** The answer of the codecs to a request. */
async function ask(request) {
  codecs ??= (await WebAssembly.instantiate(code)).instance.exports;
  const bytes = encoder.encode(JSON.stringify(request));
  try {
    const at = codecs.reserve(bytes.length);
    new Uint8Array(codecs.memory.buffer, at, bytes.length).set(bytes);
    const length = codecs.answer();
    const answer = JSON.parse(decoder.decode(new Uint8Array(codecs.memory.buffer, codecs.answered(), length)));
    return answer.wrong === undefined ? answer : { refused: answer.wrong };
  } catch (error) {
    codecs = null; // what has failed is not asked again
    return { refused: `the decoder has failed: please report these bytes as a bug (${error})` };
  }
}

const element = (name, text = "", attributes = {}) => {
  const made = Object.assign(document.createElement(name), { textContent: text });
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
};

const links = await ask("links");
const vectors = new Map();
let link = null, specification = null;

/** The vectors of the link; one file for each. */
async function vectorsOf(name) {
  if (!vectors.has(name)) vectors.set(name, (await (await fetch(`vectors/${name}.json`)).json()).vectors);
  return vectors.get(name);
}

async function choose(name) {
  link = links.find((it) => it.name === name);
  specification = new Specification(name);
  $("side").replaceChildren(...link.sides.map((side) => element("option", side)));
  $("settings").replaceChildren(...link.settings.map(setting));
  $("options").hidden = link.settings.length === 0;
  const all = await vectorsOf(name);
  const option = (vector) => element("option", `${vector.id}: ${vector.comment}`, { value: vector.id });
  $("vector").replaceChildren(element("option", `${all.length} in the reference`, { value: "" }), ...all.map(option));
  $("examples").replaceChildren("Examples:", ...examples(all).map((vector) => {
    const button = element("button", vector.comment, { type: "button" });
    button.addEventListener("click", () => load(vector));
    return button;
  }));
  return all;
}

/** Some that differ: messages of each side, and errors of other kinds. */
function examples(all) {
  const kinds = new Set();
  const isNew = (vector) => {
    const kind = vector.error?.kind ?? `${vector.from} ${Object.keys(vector.message)} ${vector.message.kind ?? vector.message.command ?? vector.message.function}`;
    return vector.comment.length < 70 && !vector.options && !kinds.has(kind) && kinds.add(kind);
  };
  return [...all.filter((it) => it.message).filter(isNew).slice(0, 6), ...all.filter((it) => it.error).filter(isNew).slice(0, 4)];
}

function setting(it) {
  const text = (value) => typeof value === "string" ? value : JSON.stringify(value);
  const label = element("label", `${it.name} `, { title: it.about });
  const input = it.choices.length
    ? element("select")
    : element("input", "", { placeholder: text(it.default), "aria-description": it.values, size: 14 });
  if (it.choices.length) {
    input.append(...it.choices.map((choice) => element("option", text(choice))));
    input.value = text(it.default);
  }
  Object.assign(input.dataset, { setting: it.name, default: it.choices.length ? text(it.default) : "" });
  label.append(input);
  return label;
}

/** The settings other than the defaults. */
function settings() {
  const given = {};
  for (const input of $("settings").querySelectorAll("[data-setting]")) {
    if (input.value === input.dataset.default) continue;
    try {
      given[input.dataset.setting] = JSON.parse(input.value);
    } catch {
      given[input.dataset.setting] = input.value;
    }
  }
  return given;
}

/** Puts a vector into the form. */
function load(vector) {
  $("side").value = vector.from ?? link.sides[0];
  for (const input of $("settings").querySelectorAll("[data-setting]")) {
    const value = vector.options?.[input.dataset.setting];
    input.value = value === undefined ? input.dataset.default : typeof value === "string" ? value : JSON.stringify(value);
  }
  $("vector").value = vector.id;
  $("hex").value = vector.hex;
  return show();
}

/** Hex digits of what was pasted: without 0x, \x and what stands between bytes. */
const digits = (text) => text.replace(/0x|\\x/gi, " ").replace(/[\s,;:|_-]+/g, " ");

async function show() {
  const answer = await ask({ explain: { link: link.name, side: $("side").value, settings: settings(), hex: digits($("hex").value) } });
  const { bytes = [], frames = [], refused = "" } = answer;
  $("refused").textContent = refused;
  $("hex").setAttribute("aria-invalid", String(refused !== ""));
  $("json").textContent = JSON.stringify(frames, null, 1);
  const shown = frames.slice(0, SHOWN).map((frame, at) => card(frame, at, bytes));
  if (frames.length > SHOWN) shown.push(element("p", `The first ${SHOWN} of ${frames.length} frames.`));
  $("frames").replaceChildren(...shown);
  $("clause").replaceChildren(element("p", frames.length ? "Point at a byte or a field: its clause is shown here." : "", { class: "hint" }));
}

/** A frame: its bytes, and its parts or its error. */
function card(frame, at, bytes) {
  const made = element("article", "", { class: frame.error ? "frame error" : "frame" });
  const last = frame.offset + frame.length - 1;
  const what = frame.error ? `error: ${frame.error.kind}` : "message";
  made.append(element("h2", `${at + 1}. ${what}, bytes ${frame.offset} to ${last}${frame.at_end ? ", at the end" : ""}`));
  const cells = bytes.slice(frame.offset, frame.offset + frame.length)
    .map((byte) => element("span", byte.toString(16).toUpperCase().padStart(2, "0"), { class: "byte" }));
  const rows = frame.error ? [errorRow(frame)] : frame.parts.map((part) => row(part, frame, cells));
  const list = element("div", "", { class: "bytes" });
  list.append(...cells);
  const table = element("table"), body = element("tbody");
  const head = element("tr");
  head.append(...["bytes", frame.error ? "error" : "field", "value", "clause"].map((title) => element("th", title, { scope: "col" })));
  body.append(...rows.map((it) => it.row));
  table.append(element("thead"), body);
  table.tHead.append(head);
  made.append(list, table);
  for (const it of rows) connect(it, rows, cells);
  return made;
}

function errorRow(frame) {
  const { kind, ...fields } = frame.error;
  const value = Object.entries(fields).map(([name, value]) => `${name} ${typeof value === "object" ? JSON.stringify(value) : value}`);
  const range = { start: 0, end: frame.length };
  return { row: line(`0–${frame.length - 1}`, kind, value.join(", "), frame.clause ?? ""), range, clause: frame.clause, name: kind };
}

function row(part, frame, cells) {
  const { start, end } = part.bytes;
  const own = part.name.startsWith("/");
  const at = (value, key) => value?.[Array.isArray(value) ? Number(key) : key];
  const value = own
    ? JSON.stringify(part.name.slice(1).split("/").reduce(at, frame.message))
    : cells.slice(start, end).map((cell) => cell.textContent).join(" ");
  const name = own ? part.name.slice(1).replaceAll("/", ".") : part.name;
  const made = line(end - start > 1 ? `${start}–${end - 1}` : `${start}`, name, value, part.clause);
  made.classList.add(own ? "own" : "envelope");
  return { row: made, range: part.bytes, clause: part.clause, name, own };
}

function line(bytes, name, value, clause) {
  const made = element("tr", "", { tabindex: "0" });
  made.append(...[bytes, name, value, /^\d/.test(clause) ? `section ${clause}` : clause].map((text) => element("td", text)));
  return made;
}

/** Pointing at a row marks its bytes, and at a byte its rows. */
function connect(it, rows, cells) {
  const colour = it.own ? `part-${rows.filter((other) => other.own).indexOf(it) % COLOURS}` : it.own === false ? "part-none" : "part-error";
  const own = cells.slice(it.range.start, it.range.end);
  it.row.classList.add(colour);
  for (const cell of own) if (!/part-/.test(cell.className)) cell.classList.add(colour);
  const mark = () => {
    for (const marked of document.querySelectorAll(".marked")) marked.classList.remove("marked");
    for (const marked of [it.row, ...own]) marked.classList.add("marked");
    if (it.clause) specification.show(it.clause, it.name, $("clause"));
  };
  it.row.addEventListener("mouseenter", mark);
  it.row.addEventListener("focus", mark);
  for (const cell of own) {
    cell.addEventListener("mouseenter", mark);
    cell.addEventListener("click", () => it.row.focus());
  }
  it.row.addEventListener("keydown", (event) => {
    const next = { ArrowDown: it.row.nextElementSibling, ArrowUp: it.row.previousElementSibling }[event.key];
    if (!next) return;
    event.preventDefault();
    next.focus();
  });
}

async function begin(name) {
  const all = await choose(name);
  await load(all[0]);
}

$("link").append(...links.map((it) => element("option", it.name, { title: it.about })));
$("link").addEventListener("change", () => begin($("link").value));
$("vector").addEventListener("change", async () => {
  const vector = (await vectorsOf(link.name)).find((it) => String(it.id) === $("vector").value);
  if (vector) await load(vector);
});
$("input").addEventListener("submit", (event) => event.preventDefault());
for (const id of ["hex", "side", "settings"]) $(id).addEventListener("input", () => {
  $("vector").value = "";
  show();
});
await begin(links[0].name);
