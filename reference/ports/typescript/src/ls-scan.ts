/** Reading a text of fanuc-ls from a place on, as the steps of section 5 do. */

import { LETTER, WS, trimEnd, type FaultKind, type LsError, type Place } from "./fanuc-ls.js";

/** The error of a reader, as it is thrown within it; `at` is an index of the text. */
export class LsFault extends Error {
  constructor(
    readonly kind: FaultKind,
    readonly at: number,
  ) {
    super(kind);
  }
}

/** A part of a text, by its indices. */
export interface Span {
  start: number;
  end: number;
}

/** The lines of a part, which ends as a line does: it is cut behind each LF (LS-5). */
export function linesOf(text: string, { start, end }: Span): Span[] {
  const lines: Span[] = [];
  for (let at = start; at < end; ) {
    const next = text.indexOf("\n", at) + 1 || end;
    lines.push({ start: at, end: next });
    at = next;
  }
  return lines;
}

/** The places of indices of a text (LS-34). */
export class Places {
  constructor(private readonly text: string) {}

  of(at: number): Place {
    const before = this.text.slice(0, at);
    const lineStart = before.lastIndexOf("\n") + 1;
    const line = before.split("\n").length;
    return { line, column: [...before.slice(lineStart)].length + 1, offset: utf8Length(before) };
  }

  error(fault: LsFault): LsError {
    return { kind: fault.kind, ...this.of(fault.at) };
  }
}

export function utf8Length(text: string): number {
  return new TextEncoder().encode(text).length;
}

const WHITE = new RegExp(`[${WS}]*`, "y");
const BLANKS = /[ \t]*/y;
const GAP = /[ \t\r\n]*/y;
/** Goes on in the next line of a statement (LS-59). */
const JOINT = /[ \t]*(?:\r*\n[ \t]*:[ \t]*)*/y;
const DIGITS = /[0-9]*/y;
const DECIMAL = /[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)/y;

/** Reads a part of a text. */
export class Cursor {
  private readonly text: string;

  constructor(
    text: string,
    public at: number,
    readonly end: number,
  ) {
    this.text = text.slice(0, end);
  }

  /** The next character, or an empty text at the end. */
  get next(): string {
    return this.text[this.at] ?? "";
  }

  /** What is left. */
  get rest(): string {
    return this.text.slice(this.at);
  }

  slice(start: number, end = this.at): string {
    return this.text.slice(start, end);
  }

  /** Whether a text is here. */
  has(text: string): boolean {
    return this.text.startsWith(text, this.at);
  }

  /** Passes a text, if it is here. */
  skip(text: string): boolean {
    if (!this.has(text)) return false;
    this.at += text.length;
    return true;
  }

  expect(text: string, kind: FaultKind): void {
    if (!this.skip(text)) this.fail(kind);
  }

  /** Passes what a sticky expression matches here. */
  take(expression: RegExp): string {
    const found = this.look(expression);
    this.at += found.length;
    return found;
  }

  look(expression: RegExp): string {
    expression.lastIndex = this.at;
    return expression.exec(this.text)?.[0] ?? "";
  }

  ws(): void {
    this.take(WHITE);
  }

  blanks(): void {
    this.take(BLANKS);
  }

  gap(): void {
    this.take(GAP);
  }

  joint(): void {
    this.take(JOINT);
  }

  digits(): string {
    return this.take(DIGITS);
  }

  /** Digits, up to a number. */
  number(most: number, kind: FaultKind): number {
    const start = this.at;
    const digits = this.digits();
    if (digits === "" || Number(digits) > most) this.fail(kind, start);
    return Number(digits);
  }

  /** A decimal: the nearest double (LS-53). */
  decimal(kind: FaultKind): number {
    const start = this.at;
    const text = this.take(DECIMAL);
    if (text === "" || !Number.isFinite(Number(text))) this.fail(kind, start);
    return Number(text);
  }

  /** Whether a letter or a digit is here, or one of these characters. */
  hasWord(others: string): boolean {
    return this.next !== "" && (isLetter(this.next) || /[0-9]/.test(this.next) || others.includes(this.next));
  }

  fail(kind: FaultKind, at = this.at): never {
    throw new LsFault(kind, at);
  }
}

const LETTER_FIRST = new RegExp(`^[${LETTER}]`);

/** Whether a text begins with a letter (LS-55). */
export function isLetter(text: string): boolean {
  return LETTER_FIRST.test(text);
}

/** Without white space at its end. */
export function withoutEnd(text: string, { start, end }: Span): Span {
  return { start, end: start + trimEnd(text.slice(start, end)).length };
}
