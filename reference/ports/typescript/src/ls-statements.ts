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
function inner(text: string, { start, end }: Span): Span {
  const part = text.slice(start, end);
  const from = start + (/^[ \t\r\n]*/.exec(part)?.[0].length ?? 0);
  const to = end - (/[ \t\r\n]*$/.exec(part)?.[0].length ?? 0);
  return { start: Math.min(from, to), end: to };
}

/** A text whose lines continue with `:`. */
export function joined(text: string): string {
  const lines = text.replace(/^[ \t\r\n]+|[ \t\r\n]+$/g, "").split("\n");
  return lines
    .map((line) => line.replace(/^[ \t\r]+|[ \t\r]+$/g, ""))
    .map((line, index) => (index === 0 ? line : line.replace(/^:[ \t]*/, "")))
    .join("\n");
}

function readInstruction(text: string, span: Span): { instruction: Instruction; place: number } {
  const { start, end } = inner(text, span);
  const t = text.slice(start, end);
  return { instruction: instructionOf(text, t, { start, end }), place: start };
}

function instructionOf(text: string, t: string, span: Span): Instruction {
  if (t === "") return "empty";
  if (t.startsWith("!")) {
    const blanks = /^[ \t]*/.exec(t.slice(1))?.[0] ?? "";
    return { comment: blanks + joined(t.slice(1 + blanks.length)) };
  }
  if (/^[JLCAS][ \t]/.test(t)) return { motion: readMotion(new Cursor(text, span.start, span.end)) };
  const [, what, digits] = /^(UFRAME|UTOOL)_NUM=[ \t]*([0-9]+)$/.exec(t) ?? [];
  if (digits !== undefined && Number(digits) <= 0xffff) {
    return what === "UFRAME" ? { user_frame: Number(digits) } : { user_tool: Number(digits) };
  }
  return { other: joined(t) };
}

function readMotion(cursor: Cursor): Motion {
  const kind = MOTION_LETTERS[cursor.next as keyof typeof MOTION_LETTERS];
  cursor.at += 1;
  cursor.joint();
  let target = readTarget(cursor);
  let via: Target | null = null;
  let via_options = "";
  if (kind === "circular") {
    via = target;
    const feed = cursor.rest.indexOf("\n");
    if (feed >= 0) {
      via_options = trim(cursor.rest.slice(0, feed));
      cursor.at += feed;
    }
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

function readTarget(cursor: Cursor): Target {
  const { letters, inside, text } = readReference(cursor, "target");
  const colon = inside.indexOf(":");
  const digits = trim(colon < 0 ? inside : inside.slice(0, colon));
  if ((letters !== "P" && letters !== "PR") || !/^[0-9]+$/.test(digits) || Number(digits) > MAX_U32) return { other: text };
  const numbered = { number: Number(digits), name: colon < 0 ? null : trim(inside.slice(colon + 1)) };
  return letters === "P" ? { position: numbered } : { register: numbered };
}

const SPEED_WORD = /[A-Za-z_.]*/y;

function readSpeed(cursor: Cursor): Speed {
  const start = cursor.at;
  if (cursor.skip("...")) {
    const unit = unitHere(cursor);
    if (unit !== null) return { register: { register: "...", unit } };
    cursor.at = start;
  }
  const word = cursor.look(SPEED_WORD);
  const behind = cursor.slice(start + word.length, start + word.length + 1);
  if (word !== "" && behind === "[") {
    const register = readReference(cursor, "speed").text;
    cursor.joint();
    return { register: { register, unit: readUnit(cursor) } };
  }
  if (word !== "" && /^[ \t\r\n]?$/.test(behind) && hasNoTermination(cursor)) {
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

function hasNoTermination(cursor: Cursor): boolean {
  const start = cursor.at;
  try {
    return readTermination(cursor) === null;
  } catch (fault) {
    if (fault instanceof LsFault) return false;
    throw fault;
  } finally {
    cursor.at = start;
  }
}

function readTermination(cursor: Cursor): Termination {
  const start = cursor.at;
  if (cursor.skip("FINE")) {
    if (!cursor.hasWord("_")) return "fine";
    cursor.at = start;
    return null;
  }
  if (!cursor.skip("CNT")) return null;
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
