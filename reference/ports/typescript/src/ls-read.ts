/** The two readers of an LS file: a program, and a document with its findings (LS-32, LS-33, section 5.6). */

import {
  COMMENT_NAMES,
  LINE_COUNT_NAMES,
  MAX_COMMENT,
  MAX_U32,
  characters,
  commentOf,
  isSpeedInRange,
  takesUnit,
  trim,
  trimEnd,
  type Attribute,
  type DocumentItem,
  type Entry,
  type FaultKind,
  type LsError,
  type LsWarning,
  type Position,
  type Program,
  type Rules,
} from "./fanuc-ls.js";
import { LsFault, Places, linesOf, utf8Length, withoutEnd, type Span } from "./ls-scan.js";
import { attempt, divide, divideStatements, readAttributes, type Part, type Parts, type StatementText } from "./ls-sections.js";
import { namedPositions, readStatement, type Statement } from "./ls-statements.js";
import { dividePositions, numberOfPosition, readPosition } from "./ls-positions.js";

/** The text of a file: UTF-8, or else Latin-1 (LS-4). */
export function textOf(bytes: Uint8Array): string {
  try {
    return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    return Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  }
}

interface Read {
  parts: Parts;
  attributes: Part<Attribute>[];
  statements: { text: StatementText; part: Part<Statement> }[];
  positions: Part<Position>[];
}

function read(text: string): Read {
  const parts = divide(text);
  return {
    parts,
    attributes: within(parts.attributes, (section) => readAttributes(text, section)),
    statements: within(parts.main, (section) => divideStatements(text, section)).map((statement) => ({
      text: statement,
      part: attempt(visible(text, statement), () => readStatement(text, statement)),
    })),
    positions: within(parts.positions, (section) => dividePositions(text, section)).map((span) => attempt(span, () => readPosition(text, span))),
  };
}

function within<T>(section: Span | null, divide: (section: Span) => T[]): T[] {
  return section === null ? [] : divide(section);
}

/** From the first to the last character that is no white space. */
function visible(text: string, span: Span): Span {
  const { start, end } = withoutEnd(text, span);
  return { start: end - trim(text.slice(start, end)).length, end };
}

/** Reads a program, or gives the first fault of its text (LS-33). */
export function readProgram(text: string): { message: Program } | { error: LsError } {
  try {
    const { parts, attributes, statements, positions } = read(text);
    const values = valuesOf(attributes);
    const instructions = valuesOf(statements.map(({ part }) => part)).map(({ instruction }) => instruction);
    const { name, kind, application } = parts;
    return {
      message: {
        name,
        kind,
        attributes: parts.attributes === null ? null : values,
        application: application === null ? null : linesOf(text, application).map(({ start, end }) => trimEnd(text.slice(start, end))),
        instructions,
        positions: valuesOf(positions),
      },
    };
  } catch (fault) {
    if (fault instanceof LsFault) return { error: new Places(text).error(fault) };
    throw fault;
  }
}

function valuesOf<T>(parts: Part<T>[]): T[] {
  return parts.map((part) => {
    if ("fault" in part) throw part.fault;
    return part.value;
  });
}

/** Reads a document: its entries and findings, or the error of a file that cannot be read (LS-32). */
export function readDocument(text: string, rules: Rules): DocumentItem[] {
  try {
    return new Findings(text, read(text), rules).items();
  } catch (fault) {
    if (fault instanceof LsFault) return [{ offset: 0, length: utf8Length(text), error: new Places(text).error(fault) }];
    throw fault;
  }
}

type Finding = { error: LsError } | { warning: LsWarning };
type Kinds<T> = T extends { kind: infer K } ? K : never;

/** What a document found, entry by entry. */
class Findings {
  private readonly places: Places;
  private readonly lineNumbers: Map<StatementText, { expected: number; found: number }>;
  /** The positions that statements name; null: all are used. */
  private readonly used: Set<number> | null;
  private readonly defined: Set<number>;

  constructor(
    private readonly text: string,
    private readonly read: Read,
    private readonly rules: Rules,
  ) {
    this.places = new Places(text);
    this.lineNumbers = lineNumbers(read.statements.map((statement) => statement.text));
    const named = read.statements.map((statement) => namedPositions(this.slice(statement.text)));
    this.used = named.includes(null) ? null : new Set(named.flatMap((numbers) => numbers ?? []));
    this.defined = new Set(read.positions.map((part) => numberOfPosition(this.slice(part))));
  }

  items(): DocumentItem[] {
    const { parts, attributes, statements, positions } = this.read;
    const { name, kind, head, application } = parts;
    const lines = application === null ? [] : linesOf(this.text, application);
    const missing = new Set<number>();
    const seen = new Map<number, number>();
    return [
      ...this.entry(head, { message: { program: { name, kind } } }, this.ofName()),
      ...attributes.flatMap((part) => this.part(part, (attribute) => ({ attribute }), this.ofAttribute(part))),
      ...lines.flatMap((line) => {
        const content = trimEnd(this.slice(line));
        return content === "" ? [] : this.entry(visible(this.text, line), { message: { application: content } }, []);
      }),
      ...statements.flatMap(({ text, part }) => {
        const found = [...this.ofNumber(text, part), ...this.ofMotion(part, missing)];
        return this.part(part, ({ number, instruction }) => ({ statement: { number, instruction } }), found);
      }),
      ...positions.flatMap((part) => this.part(part, (position) => ({ position }), this.ofPosition(part, seen))),
    ];
  }

  private slice({ start, end }: Span): string {
    return this.text.slice(start, end);
  }

  private part<T>(part: Part<T>, entry: (value: T) => Entry, findings: Finding[]): DocumentItem[] {
    const content = "fault" in part ? { error: this.places.error(part.fault) } : { message: entry(part.value) };
    return this.entry(visible(this.text, part), content, findings);
  }

  private entry(span: Span, content: { message: Entry } | { error: LsError }, findings: Finding[]): DocumentItem[] {
    const { offset } = this.places.of(span.start);
    const length = utf8Length(this.slice(span));
    return [content, ...findings].map((item) => ({ offset, length, ...item }));
  }

  private warning(at: number, kind: Kinds<LsWarning>, values: object = {}): Finding {
    return { warning: { kind, ...values, ...this.places.of(at) } as LsWarning };
  }

  private ofName(): Finding[] {
    const { name, head } = this.read.parts;
    if (!isName(name)) return [this.warning(head.start, "name")];
    const limit = this.rules.name_limit;
    const found = characters(name);
    if (found <= limit) return [];
    return [{ error: { kind: "name_length", found, limit, ...this.places.of(head.start) } }];
  }

  private ofAttribute(part: Part<Attribute>): Finding[] {
    if ("fault" in part || !("text" in part.value.value)) return [];
    const { name } = part.value;
    const { text } = part.value.value;
    const findings: Finding[] = [];
    const length = characters(commentOf(text));
    if (COMMENT_NAMES.includes(name) && length > MAX_COMMENT) findings.push(this.warning(part.start, "comment_length", { found: length }));
    const found = this.read.statements.filter((statement) => !statement.text.nested).length;
    const expected = /^[0-9]+$/.test(text) ? Number(text) : NaN;
    const wrong = expected !== 0 && expected <= MAX_U32 && expected !== found;
    if (wrong && part === this.lastLineCount() && this.statementsAreGood()) {
      findings.push(this.warning(part.start, "line_count", { expected, found }));
    }
    return findings;
  }

  private lastLineCount(): Part<Attribute> | undefined {
    const isOne = ({ name, value }: Attribute): boolean => LINE_COUNT_NAMES.includes(name) && "text" in value;
    return this.read.attributes.filter((part) => "value" in part && isOne(part.value)).at(-1);
  }

  /** No statement has an error, or a finding of its number or speed (LS-50). */
  private statementsAreGood(): boolean {
    return this.lineNumbers.size === 0 && this.read.statements.every(({ part }) => "value" in part && this.ofSpeed(part.value).length === 0);
  }

  private ofNumber(statement: StatementText, part: Span): Finding[] {
    const found = this.lineNumbers.get(statement);
    return found === undefined ? [] : [this.warning(part.start, "line_number", found)];
  }

  private ofSpeed({ instruction, place }: Statement): Finding[] {
    if (typeof instruction === "string" || !("motion" in instruction)) return [];
    const { kind, speed } = instruction.motion;
    if ("named" in speed) return [];
    const { unit } = "fixed" in speed ? speed.fixed : speed.register;
    if (!takesUnit(kind, unit)) return [this.warning(place, "speed_unit")];
    if ("register" in speed || isSpeedInRange(speed.fixed.value, unit)) return [];
    return [{ error: { kind: "speed_range" satisfies FaultKind, ...this.places.of(place) } }];
  }

  private ofMotion(part: Part<Statement>, missing: Set<number>): Finding[] {
    if ("fault" in part) return [];
    const { instruction, place } = part.value;
    const findings = this.ofSpeed(part.value);
    if (typeof instruction === "string" || !("motion" in instruction)) return findings;
    const targets = [instruction.motion.via, instruction.motion.target];
    const numbers = targets.flatMap((target) => (target !== null && "position" in target ? [target.position.number] : []));
    for (const number of numbers.sort((one, other) => one - other)) {
      if (this.defined.has(number) || missing.has(number)) continue;
      missing.add(number);
      findings.push(this.warning(place, "undefined_position", { number }));
    }
    return findings;
  }

  private ofPosition(part: Part<Position>, seen: Map<number, number>): Finding[] {
    const number = numberOfPosition(this.slice(part));
    // A position with a fault counts once (LS-36).
    const times = "fault" in part ? (seen.get(number) ?? 1) : (seen.get(number) ?? 0) + 1;
    seen.set(number, times);
    if ("fault" in part) return [];
    const findings: Finding[] = [];
    if (times === 1 && this.used !== null && !this.used.has(number)) findings.push(this.warning(part.start, "unused_position", { number }));
    if (times === 2) findings.push(this.warning(part.start, "repeated_position", { number }));
    const untaught = part.value.groups.some((group) => group.axes.some((axis) => axis.value === null));
    if (untaught) findings.push(this.warning(part.start, "untaught_position", { number }));
    return findings;
  }
}

/** Letters of ASCII, digits and `_`, and no digit first. */
export function isName(name: string): boolean {
  return /^[A-Za-z_][A-Za-z0-9_]*$/.test(name);
}

/** Which statements have a number that is off (LS-63). */
function lineNumbers(statements: StatementText[]): Map<StatementText, { expected: number; found: number }> {
  const found = new Map<StatementText, { expected: number; found: number }>();
  let [last, counts, off] = [0, true, false];
  for (const statement of statements.filter(({ nested }) => !nested)) {
    const { number } = statement;
    if (number === null) {
      counts = false;
      continue;
    }
    const now = number !== last + 1;
    if (now && off) counts = false;
    if (now && counts) found.set(statement, { expected: last + 1, found: number });
    [off, last] = [now, number];
  }
  return found;
}
