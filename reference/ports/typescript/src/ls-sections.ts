/** Where the parts of an LS file are: sections, attributes and statements (LS-56 to LS-58). */

import { LETTER, MAX_U32, WS, trim, trimEnd, type Attribute } from "./fanuc-ls.js";
import { Cursor, LsFault, isLetter, linesOf, withoutEnd, type Span } from "./ls-scan.js";

const SECTIONS = ["/PROG", "/ATTR", "/APPL", "/MN", "/POS", "/END"] as const;
type Section = (typeof SECTIONS)[number];
const MAIN = SECTIONS.indexOf("/MN");

/** The parts of a file; the sections that are not there are null. */
export interface Parts {
  /** From the name's first character to the kind's last. */
  head: Span;
  name: string;
  kind: string | null;
  attributes: Span | null;
  application: Span | null;
  main: Span | null;
  positions: Span | null;
}

const BEGIN = new RegExp(`^[${WS}]*(/(?:PROG|ATTR|APPL|MN|POS|END))(?![${LETTER}0-9])`);
const BLANK = new RegExp(`^[${WS}]*$`);

/** The section that a line begins (LS-6), and where its name ends. */
function sectionOf(line: string): { section: Section; end: number } | null {
  const found = BEGIN.exec(line);
  return found === null ? null : { section: found[1] as Section, end: found[0].length };
}

/** Divides a file; an error is thrown (LS-56). */
export function divide(text: string): Parts {
  const start = text.search(new RegExp(`[^${WS}\\ufeff]`));
  if (start < 0) throw new LsFault("program", text.length);
  const [first, ...lines] = linesOf(text, { start, end: text.length });
  const head = readHead(text, first ?? { start, end: text.length });
  const begins: Partial<Record<Section, Span>> = {};
  let last: Section = "/PROG";
  for (const line of lines) {
    const content = text.slice(line.start, line.end);
    const found = sectionOf(content);
    if (found === null || found.section === "/PROG" || (found.section === "/APPL" && last === "/APPL")) {
      if (last === "/PROG" && !BLANK.test(content)) throw new LsFault("main", line.start);
      continue;
    }
    const { section } = found;
    const order = SECTIONS.indexOf(section);
    const before = SECTIONS.indexOf(last) < MAIN;
    if (order <= SECTIONS.indexOf(last) || (order > MAIN && before)) throw new LsFault(before ? "main" : "end", line.start);
    if (section === "/MN" && !BLANK.test(content.slice(found.end))) throw new LsFault("main", line.start + found.end);
    begins[section] = line;
    last = section;
    if (section !== "/END") continue;
    const behind = line.end;
    const trailing = text.slice(behind).search(new RegExp(`[^${WS}\\u001a]`));
    if (trailing >= 0) throw new LsFault("trailing", behind + trailing);
    return { ...head, ...spans(begins) };
  }
  throw new LsFault(SECTIONS.indexOf(last) < MAIN ? "main" : "end", text.length);
}

function readHead(text: string, line: Span): Pick<Parts, "head" | "name" | "kind"> {
  const content = text.slice(line.start, line.end);
  if (sectionOf(content)?.section !== "/PROG") throw new LsFault("program", line.start);
  const found = new RegExp(`^/PROG[${WS}]*([^${WS}]+)([^]*)`).exec(content);
  if (found === null) throw new LsFault("program", withoutEnd(text, line).end);
  const [, name = "", rest = ""] = found;
  const start = line.start + content.length - rest.length - name.length;
  return { head: withoutEnd(text, { start, end: line.end }), name, kind: trim(rest) || null };
}

function spans(begins: Partial<Record<Section, Span>>): Pick<Parts, "attributes" | "application" | "main" | "positions"> {
  const lines = SECTIONS.map((section) => begins[section]);
  const span = (section: Section): Span | null => {
    const line = begins[section];
    if (line === undefined) return null;
    const behind = lines.find((other) => other !== undefined && other.start > line.start);
    return { start: line.end, end: behind?.start ?? line.end };
  };
  return { attributes: span("/ATTR"), application: span("/APPL"), main: span("/MN"), positions: span("/POS") };
}

/** A part that was read, or its error. */
export type Part<T> = Span & ({ value: T } | { fault: LsFault });

/** Reads a part; an error is kept. */
export function attempt<T>(span: Span, read: () => T): Part<T> {
  try {
    return { ...span, value: read() };
  } catch (fault) {
    if (fault instanceof LsFault) return { ...span, fault };
    throw fault;
  }
}

// Attributes (LS-57)

const NAME = /[^=:;,\r\n]*/y;

export function readAttributes(text: string, section: Span): Part<Attribute>[] {
  const parts: Part<Attribute>[] = [];
  const cursor = new Cursor(text, section.start, section.end);
  for (cursor.ws(); cursor.at < section.end; cursor.ws()) {
    const start = cursor.at;
    const part = attempt({ start, end: start }, () => readAttribute(cursor));
    if ("fault" in part) cursor.at = nextBeginning(text, section, part.fault.at);
    parts.push({ ...part, end: cursor.at });
  }
  return parts;
}

/** The first line that begins behind a place, and not with white space; or the end. */
function nextBeginning(text: string, section: Span, at: number): number {
  const line = linesOf(text, section).find(({ start }) => start > at && !BLANK.test(text[start] ?? ""));
  return line?.start ?? section.end;
}

function readAttribute(cursor: Cursor): Attribute {
  const name = readName(cursor, "attribute");
  if (!cursor.skip(":")) {
    cursor.expect("=", "attribute_value");
    const text = readValue(cursor, ";");
    cursor.skip(";");
    return { name, value: { text } };
  }
  const list: [string, string][] = [];
  do {
    cursor.ws();
    const item = readName(cursor, "attribute_value");
    cursor.expect("=", "attribute_value");
    list.push([item, readValue(cursor, ";,")]);
  } while (cursor.skip(","));
  cursor.skip(";");
  return { name, value: { list } };
}

function readName(cursor: Cursor, kind: "attribute" | "attribute_value"): string {
  const start = cursor.at;
  const name = trim(cursor.take(NAME));
  if (name === "" || /[ \t"]/.test(name)) cursor.fail(kind, start);
  return name;
}

/** A value up to one of its ends, which is not passed. */
function readValue(cursor: Cursor, ends: string): string {
  const start = cursor.at;
  const end = valueEnd(cursor, ends);
  if (end === null) cursor.fail("attribute_end", start);
  cursor.at = end;
  const lines = cursor.slice(start, end).split("\n").map(trim);
  return lines.filter((line) => line !== "").join(" ");
}

function valueEnd(cursor: Cursor, ends: string): number | null {
  const { rest, at } = cursor;
  let quoted = false;
  for (let place = 0; place < rest.length; place += 1) {
    const character = rest[place] ?? "";
    if (character === '"') {
      quoted = !quoted;
    } else if (quoted && (character === "\r" || character === "\n")) {
      const part = trimEnd(rest.slice(0, place));
      const closed = new RegExp(`"[^\\n]*"[${ends}]$`).test(part);
      return closed ? at + part.length - 1 : null;
    } else if (!quoted && ends.includes(character)) {
      return at + place;
    } else if (character === "\n") {
      const next = rest.slice(place + 1);
      if (isLetter(next) && /^[^\n]*[=:]/.test(next)) return null;
    }
  }
  return null;
}

// Statements (LS-58)

export interface StatementText extends Span {
  nested: boolean;
  number: number | null;
}

const NUMBER = new RegExp(`^[${WS}]*([0-9]+)[ \\t]*:`);

function numberOf(line: string): number | null {
  const digits = NUMBER.exec(line)?.[1];
  return digits === undefined || Number(digits) > MAX_U32 ? null : Number(digits);
}

export function divideStatements(text: string, section: Span): StatementText[] {
  const statements: StatementText[] = [];
  let last = 0;
  // Of the line above, if no semicolon has closed it.
  let open: StatementText | undefined;
  for (const line of linesOf(text, section)) {
    const content = text.slice(line.start, line.end);
    const current: StatementText | undefined = /^[ \t]*:/.test(content) ? open : undefined;
    open = undefined;
    if (BLANK.test(content)) continue;
    if (current !== undefined) {
      current.end = line.end;
      if (!isClosed(content)) open = current;
    } else if (isNested(content, last, statements.at(-1)?.nested === true)) {
      statements.push({ ...line, nested: true, number: null });
    } else {
      const number = numberOf(content);
      last = number ?? last + 1;
      const statement = { ...line, nested: false, number };
      statements.push(statement);
      if (!isClosed(content)) open = statement;
    }
  }
  return statements;
}

function isClosed(line: string): boolean {
  return trimEnd(line).endsWith(";");
}

/** Whether a line belongs to the block of the motion above it (LS-15). */
function isNested(line: string, last: number, block: boolean): boolean {
  const spaces = line.search(/[^ ]/);
  if (spaces < 5 || last === 0) return false;
  const behind = line.slice(spaces);
  return block || (!behind.startsWith(":") && Number(/^[0-9]+/.exec(behind)?.[0]) !== last + 1);
}
