/** What is in a statement of an LS file: instructions and motions (LS-58, LS-59). */

import {
  LETTER,
  MAX_U32,
  MOTION_LETTERS,
  UNITS,
  WS,
  trim,
  type FaultKind,
  type Instruction,
  type Motion,
  type Speed,
  type Target,
  type Termination,
  type Unit,
} from "./fanuc-ls.js";
import { Cursor, LsFault, withoutEnd, type Span } from "./ls-scan.js";
import type { StatementText } from "./ls-sections.js";

export interface Statement {
  number: number | null;
  instruction: Instruction;
  /** Where its instruction begins. */
  place: number;
}

export function readStatement(text: string, statement: StatementText): Statement {
  const { start, end } = withoutEnd(text, statement);
  if (statement.nested) return { number: null, instruction: { nested: text.slice(start, end) }, place: start };
  const cursor = new Cursor(text, start, end);
  cursor.ws();
  const place = cursor.at;
  const digits = cursor.digits();
  cursor.blanks();
  if (!cursor.skip(":") || Number(digits) > MAX_U32) cursor.fail("line_number", place);
  const number = digits === "" ? null : Number(digits);
  const body = cursor.rest;
  if (body.endsWith(";")) return { number, ...readInstruction(text, { start: cursor.at, end: end - 1 }) };
  const lastLine = body.slice(body.lastIndexOf("\n") + 1);
  if (trim(body).startsWith("!") || !lastLine.includes(";")) throw new LsFault("instruction_end", end);
  cursor.at += body.lastIndexOf(";") + 1;
  cursor.ws();
  throw new LsFault("after_instruction", cursor.at);
}

/** Without spaces, tabs, CR and LF at its ends. */
function inner(text: string): string {
  return text.replace(/^[ \t\r\n]+|[ \t\r\n]+$/g, "");
}

/** A text whose lines continue with `:`. */
function joined(text: string): string {
  return inner(text)
    .split("\n")
    .map((line) => line.replace(/^[ \t\r]+|[ \t\r]+$/g, ""))
    .map((line, index) => (index === 0 ? line : line.replace(/^:[ \t]*/, "")))
    .join("\n");
}

function readInstruction(text: string, { start, end }: Span): { instruction: Instruction; place: number } {
  const part = text.slice(start, end);
  const t = inner(part);
  const place = start + part.indexOf(t);
  return { instruction: instructionOf(text, t, { start: place, end: place + t.length }), place };
}

function instructionOf(text: string, t: string, span: Span): Instruction {
  if (t === "") return "empty";
  if (t.startsWith("!")) {
    const blanks = /^[ \t]*/.exec(t.slice(1))?.[0] ?? "";
    return { comment: blanks + joined(t.slice(1 + blanks.length)) };
  }
  if (/^[JLCAS][ \t]/.test(t)) return { motion: readMotion(new Cursor(text, span.start, span.end)) };
  const [, what, digits] = /^(UFRAME|UTOOL)_NUM=[ \t]*([0-9]+)$/.exec(t) ?? [];
  if (Number(digits) <= 0xffff) {
    return what === "UFRAME" ? { user_frame: Number(digits) } : { user_tool: Number(digits) };
  }
  return { other: joined(t) };
}

function readMotion(cursor: Cursor): Motion {
  const kind = MOTION_LETTERS[cursor.take(/[JLCAS]/y) as keyof typeof MOTION_LETTERS];
  cursor.joint();
  let target = readTarget(cursor);
  let via: Target | null = null;
  let via_options = "";
  if (kind === "circular") {
    via = target;
    via_options = trim(cursor.take(/[^\n]*(?=\n)/y));
    cursor.joint();
    target = readTarget(cursor);
  }
  cursor.joint();
  const speed = readSpeed(cursor);
  cursor.joint();
  const termination = readTermination(cursor);
  cursor.joint();
  return { kind, via, via_options, target, speed, termination, options: joined(cursor.rest) };
}

interface Reference {
  letters: string;
  inside: string;
  /** As it is spelled. */
  text: string;
}

/** Letters and brackets, which nest; on one line. */
function readReference(cursor: Cursor, kind: FaultKind): Reference {
  const start = cursor.at;
  const letters = cursor.take(/[A-Za-z]*/y);
  if (letters === "") cursor.fail(kind);
  cursor.expect("[", kind);
  const inside = cursor.at;
  for (let depth = 1; depth > 0; cursor.at += 1) {
    const { next } = cursor;
    if (next === "" || next === "\r" || next === "\n") cursor.fail("bracket", inside);
    if (next === "[") depth += 1;
    if (next === "]") depth -= 1;
  }
  return { letters, inside: cursor.slice(inside, cursor.at - 1), text: cursor.slice(start) };
}

const NUMBERED = new RegExp(`^[${WS}]*([0-9]+)[${WS}]*(?::([^]*))?$`);

function readTarget(cursor: Cursor): Target {
  const { letters, inside, text } = readReference(cursor, "target");
  const [, digits, name] = NUMBERED.exec(inside) ?? [];
  if ((letters !== "P" && letters !== "PR") || !(Number(digits) <= MAX_U32)) return { other: text };
  const numbered = { number: Number(digits), name: name === undefined ? null : trim(name) };
  return letters === "P" ? { position: numbered } : { register: numbered };
}

const SPEED_WORD = /[A-Za-z_.]*/y;
const TERMINATION = new RegExp(`FINE(?![${LETTER}0-9_])|CNT`, "y");

function readSpeed(cursor: Cursor): Speed {
  const start = cursor.at;
  if (cursor.skip("...")) {
    const unit = unitHere(cursor);
    if (unit !== null) return { register: { register: "...", unit } };
    cursor.at = start;
  }
  const word = cursor.look(SPEED_WORD);
  const behind = cursor.slice(start + word.length, start + word.length + 1);
  if (behind === "[") {
    const register = readReference(cursor, "speed").text;
    cursor.joint();
    return { register: { register, unit: readUnit(cursor) } };
  }
  if (word !== "" && /^[ \t\r\n]?$/.test(behind) && cursor.look(TERMINATION) === "") {
    cursor.at += word.length;
    return { named: word };
  }
  const value = cursor.decimal("speed");
  cursor.joint();
  return { fixed: { value, unit: readUnit(cursor) } };
}

/** The unit that is here, which is passed; null, if there is none. */
function unitHere(cursor: Cursor): Unit | null {
  const start = cursor.at;
  const found = UNITS.find(([spelled]) => cursor.skip(spelled));
  if (found === undefined) return null;
  if (found[1] === "percent" || !cursor.hasWord("/")) return found[1];
  cursor.at = start;
  return null;
}

function readUnit(cursor: Cursor): Unit {
  return unitHere(cursor) ?? cursor.fail("speed_unit");
}

function readTermination(cursor: Cursor): Termination {
  const word = cursor.take(TERMINATION);
  if (word === "") return null;
  if (word === "FINE") return "fine";
  cursor.joint();
  if (/[A-Za-z]/.test(cursor.next)) return { continuous_register: readReference(cursor, "continuous").text };
  const place = cursor.at;
  const continuous = cursor.number(100, "continuous");
  if (cursor.next === "." || cursor.next === "_") cursor.fail("continuous", place);
  return { continuous };
}

/** The positions that a text of a statement names; null, if one is chosen when the program runs (LS-62). */
export function namedPositions(text: string): number[] | null {
  const names = new RegExp(`(?<![${LETTER}0-9_])P\\[[${WS}]*([0-9]*)`, "g");
  const numbers = [...text.matchAll(names)].map(([, digits = ""]) => (digits === "" ? NaN : Number(digits)));
  return numbers.every((number) => number <= MAX_U32) ? numbers : null;
}
