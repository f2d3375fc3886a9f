/** Writes a program in the layout of a controller (LS-37 to LS-40). */

import { Refused, fields } from "./check.js";
import {
  COMMENT_NAMES,
  DEFAULT_RULES,
  MAX_COMMENT,
  MOTION_LETTERS,
  UNITS,
  characters,
  commentOf,
  isSpeedInRange,
  takesUnit,
  trimEnd,
  type Attribute,
  type Axis,
  type Group,
  type Instruction,
  type Motion,
  type MotionKind,
  type Position,
  type Program,
  type Rules,
  type Speed,
  type Target,
  type Termination,
  type Unit,
} from "./fanuc-ls.js";
import { isName, readProgram } from "./ls-read.js";
import { readAttributes } from "./ls-sections.js";

/** A control character other than tab. */
const CONTROL = /[\u0000-\u0008\u000a-\u001f\u007f-\u009f]/;
const CONTROL_OR_TAB = /[\u0000-\u001f\u007f-\u009f]/;

const LETTERS = Object.fromEntries(Object.entries(MOTION_LETTERS).map(([letter, kind]) => [kind, letter])) as Record<MotionKind, string>;
/** What continues a text, and the second target of C. */
const CONTINUED = "\r\n    :  ";
const AXES_IN_A_LINE = 3;

/** The text of a program; what a reader would not read back as the same program is refused, and what LS-37 refuses beyond that. */
export function writeProgram(program: Program, rules: Rules = DEFAULT_RULES): string {
  const cut = { ...program, attributes: nullOr(program.attributes, (attributes) => list(attributes).map((each) => cutComment(each, rules))) };
  const lines = [
    writeHead(cut, rules),
    ...(cut.attributes === null ? [] : ["/ATTR", ...cut.attributes.map(writeAttribute)]),
    ...(cut.application === null ? [] : ["/APPL", ...list(cut.application).map(writeApplication)]),
    "/MN",
    ...writeInstructions(list(cut.instructions)),
    "/POS",
    ...list(cut.positions).map(writePosition),
    "/END",
  ];
  const written = lines.map((line) => `${line}\r\n`).join("");
  if (/[\ud800-\udfff]/u.test(written)) throw new Refused("message", "half a character");
  const read = readProgram(written);
  if ("error" in read) throw new Refused("message", `it would be read with the error ${read.error.kind}`);
  if (!same(read.message, withoutEnds(cut))) throw new Refused("message", "it would be read as another program");
  return written;
}

// Values of unknown shape

function text(value: unknown): string {
  if (typeof value !== "string") throw new Refused("message", "no text");
  return value;
}

function list<T>(value: readonly T[]): readonly T[] {
  if (!Array.isArray(value)) throw new Refused("message", "no list");
  return value;
}

function nullOr<T, R>(value: T | null, write: (value: T) => R): R | null {
  return value === null ? null : write(value);
}

type Tagged<T> = T extends unknown ? { [K in keyof T]-?: [K, T[K]] }[keyof T] : never;

/** The name of the one field of an object, which says what it is, and its value. */
function tagged<T extends object>(value: T): Tagged<T> {
  return (Object.entries(Object(value) as T)[0] ?? []) as unknown as Tagged<T>;
}

function same(one: unknown, other: unknown): boolean {
  if (typeof one !== "object" || typeof other !== "object" || one === null || other === null) return Object.is(one, other);
  const names = Object.keys(one);
  const isSame = (name: string): boolean => same((one as Record<string, unknown>)[name], (other as Record<string, unknown>)[name]);
  return names.length === Object.keys(other).length && names.every(isSame);
}

/** A program without the white space at the ends of its texts, which is not written. */
function withoutEnds(program: Program): Program {
  const instructions = program.instructions.map((instruction): Instruction => {
    if (typeof instruction === "string") return instruction;
    if ("comment" in instruction) return { comment: trimEnd(instruction.comment) };
    if ("other" in instruction) return { other: trimEnd(instruction.other) };
    return instruction;
  });
  return { ...program, instructions, application: nullOr(program.application, (lines) => lines.map(trimEnd)) };
}

// Head, attributes, lines of /APPL

function writeHead({ name, kind }: Program, rules: Rules): string {
  if (!isName(name)) throw new Refused("name");
  if (name.length > rules.name_limit) throw new Refused("name_length");
  if (kind === null) return `/PROG  ${name}`;
  if (CONTROL.test(kind)) throw new Refused("name");
  return `/PROG  ${name}\t  ${kind}`;
}

/** A comment that is too long is refused, or cut (LS-37). */
function cutComment(attribute: Attribute, rules: Rules): Attribute {
  fields(attribute, "name", "value");
  const { name } = attribute;
  const [kind, value] = tagged(attribute.value);
  if (kind !== "text" || !COMMENT_NAMES.includes(name)) return attribute;
  const comment = commentOf(text(value));
  if (characters(comment) <= MAX_COMMENT) return attribute;
  if (rules.comment !== "truncate") throw new Refused("comment_length");
  return { name, value: { text: `"${trimEnd([...comment].slice(0, MAX_COMMENT).join(""))}"` } };
}

/** An attribute that has a fault where nothing is behind it is refused (LS-37). */
function writeAttribute(attribute: Attribute): string {
  const written = attributeText(attribute);
  const parts = readAttributes(written, { start: 0, end: written.length });
  if (parts.some((part) => "fault" in part)) throw new Refused("attribute");
  return written;
}

function attributeText(attribute: Attribute): string {
  const name = text(attribute.name);
  const [kind, value] = tagged(attribute.value);
  if (kind === "text") return `${name}${characters(name) >= 8 ? "\t" : "\t\t"}= ${text(value)};`;
  const items = list(value).map(([item, inner]) => `${text(item)}\t= ${text(inner)}`);
  return `${name}:  ${items.join(",\r\n      ")};`;
}

function writeApplication(line: string): string {
  if (CONTROL.test(line)) throw new Refused("application");
  return trimEnd(text(line));
}

// Instructions

type What = ["empty", null] | Tagged<Exclude<Instruction, "empty">>;

function writeInstructions(instructions: readonly Instruction[]): string[] {
  let number = 0;
  return instructions.map((instruction) => {
    const what: What = instruction === "empty" ? ["empty", null] : tagged(instruction);
    if (what[0] === "nested") {
      if (CONTROL_OR_TAB.test(what[1])) throw new Refused("instruction");
      return what[1];
    }
    number += 1;
    const written = writeInstruction(what);
    if (CONTROL.test(written.replaceAll(CONTINUED, ""))) throw new Refused("instruction");
    return `${String(number).padStart(4)}:${written} ;`;
  });
}

function writeInstruction([kind, value]: What): string {
  switch (kind) {
    case "empty":
      return "  ";
    case "motion":
      return `${writeMotion(value)}   `;
    case "user_frame":
      return `  UFRAME_NUM=${value}`;
    case "user_tool":
      return `  UTOOL_NUM=${value}`;
    case "comment":
      return `  !${continued(value)}`;
    default:
      return `${text(value).startsWith("=") ? " ".repeat(9) : "  "}${continued(value)}`;
  }
}

/** A text whose line feeds are continuations. */
function continued(value: string): string {
  return trimEnd(text(value)).split("\n").join(CONTINUED);
}

function writeMotion(motion: Motion): string {
  fields(motion, "kind", "via", "via_options", "target", "speed", "termination", "options");
  const { kind, via, via_options, target, speed, termination, options } = motion;
  const first = via === null ? "" : `${spaced(writeTarget(via), text(via_options))}    ${CONTINUED}`;
  const second = spaced(writeTarget(target), writeSpeed(kind, speed), writeTermination(termination), continued(options));
  return `${LETTERS[kind]} ${first}${second}`;
}

function spaced(...words: string[]): string {
  return words.filter((word) => word !== "").join(" ");
}

function writeTarget(target: Target): string {
  const [kind, value] = tagged(target);
  if (kind === "other") return text(value);
  fields(value, "number", "name");
  return `${kind === "position" ? "P" : "PR"}[${value.number}${value.name === null ? "" : `:${value.name}`}]`;
}

function writeSpeed(kind: MotionKind, speed: Speed): string {
  const [form, value] = tagged(speed);
  if (form === "named") return text(value);
  if (form === "register") {
    fields(value, "register", "unit");
    return value.register + writeUnit(kind, value.unit);
  }
  fields(value, "value", "unit");
  const unit = writeUnit(kind, value.unit);
  if (!isSpeedInRange(value.value, value.unit)) throw new Refused("speed");
  const decimals = String(value.value);
  if (value.unit === "sec") return (decimals.includes(".") ? decimals : `${decimals}.0`) + unit;
  return decimals.replace(/^0\./, ".") + unit;
}

function writeUnit(kind: MotionKind, unit: Unit): string {
  if (!takesUnit(kind, unit)) throw new Refused("speed_unit");
  return UNITS.find(([, name]) => name === unit)?.[0] ?? "";
}

function writeTermination(termination: Termination): string {
  if (termination === null) return "";
  if (termination === "fine") return "FINE";
  const [kind, value] = tagged(termination);
  return kind === "continuous" ? `CNT${value}` : `CNT ${value}`;
}

// Positions

function writePosition(position: Position): string {
  fields(position, "number", "name", "groups");
  const { number, name, groups } = position;
  if (name !== null && CONTROL_OR_TAB.test(name)) throw new Refused("position");
  if (list(groups).length === 0) throw new Refused("position");
  const written = groups.map(writeGroup).join("\r\n");
  return `P[${number}${name === null ? "" : `:"${name}"`}]{\r\n${written}\r\n};`;
}

function writeGroup(group: Group): string {
  fields(group, "number", "user_frame", "user_tool", "configuration", "axes");
  const { number, user_frame, user_tool, configuration, axes } = group;
  const frames = `\tUF : ${user_frame ?? "F"}, UT : ${user_tool ?? "F"},\t`;
  const lines: string[] = [];
  for (let first = 0; first < list(axes).length; first += AXES_IN_A_LINE) {
    lines.push(`\t${axes.slice(first, first + AXES_IN_A_LINE).map(writeAxis).join(",\t")}`);
  }
  return `   GP${number}:\r\n${frames}${writeConfiguration(configuration)}\r\n${lines.join(",\r\n")}`;
}

function writeConfiguration(configuration: Group["configuration"]): string {
  if (configuration === null) return "";
  if (CONTROL_OR_TAB.test(configuration.text)) throw new Refused("position");
  return `\t${configuration.keyword} : '${configuration.text}',`;
}

function writeAxis(axis: Axis): string {
  fields(axis, "name", "value", "unit");
  const { name, value, unit } = axis;
  if (value !== null && !Number.isFinite(value)) throw new Refused("position");
  const equals = /[0-9]$/.test(name) ? "=" : " =";
  return `${name}${equals}${value === null ? "  ********" : writeCoordinate(value)}${unit === "mm" ? "  mm" : " deg"}`;
}

/** Right-aligned in ten columns, with three decimals if that reads as the same double (LS-39). */
function writeCoordinate(value: number): string {
  const size = Math.abs(value);
  const sign = value < 0 || Object.is(value, -0) ? "-" : "";
  const fixed = size.toFixed(3);
  // From 10²¹ on, toFixed writes an exponent.
  const three = fixed.includes("e") ? `${BigInt(size)}.000` : fixed;
  const decimals = Number(three) === size ? three : plainDecimal(size);
  const short = size === 0 && sign === "" ? decimals : decimals.replace(/^0\./, ".");
  return (sign + short).padStart(10);
}

/** As few decimals as read as the same double, and no exponent; of a number that has decimals. */
function plainDecimal(value: number): string {
  const [mantissa = "", exponent] = String(value).split("e-");
  return exponent === undefined ? mantissa : `0.${"0".repeat(Number(exponent) - 1)}${mantissa.replace(".", "")}`;
}
