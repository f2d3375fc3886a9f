/** Writes a program in the layout of a controller (LS-37 to LS-40). */

import { Refused, fields, integer, oneOf } from "./check.js";
import {
  COMMENT_NAMES,
  DEFAULT_RULES,
  LETTER,
  MAX_COMMENT,
  MAX_U32,
  MOTION_LETTERS,
  UNITS,
  characters,
  commentOf,
  isSpeedInRange,
  takesUnit,
  trim,
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
import { beginsSection, readAttributes } from "./ls-sections.js";

/** A control character other than tab; in instructions a line feed is none either. */
const CONTROL = /[\u0000-\u0008\u000a-\u001f\u007f-\u009f]/;
const CONTROL_BUT_LF = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f]/;
const CONTROL_OR_TAB = /[\u0000-\u001f\u007f-\u009f]/;

const LETTERS = Object.fromEntries(Object.entries(MOTION_LETTERS).map(([letter, kind]) => [kind, letter])) as Record<MotionKind, string>;
const KEYWORD = new RegExp(`^[${LETTER}0-9_]+$`);
const KINDS = Object.values(MOTION_LETTERS);
const UNIT_NAMES = [...new Set(UNITS.map(([, unit]) => unit))];
/** What continues a text, and the second target of C. */
const CONTINUED = "\r\n    :  ";
const AXES_IN_A_LINE = 3;

/** The text of a program; what a reader would not read back as the same program is refused. */
export function writeProgram(program: Program, rules: Rules = DEFAULT_RULES): string {
  fields(program, "name", "kind", "attributes", "application", "instructions", "positions");
  const cut = { ...program, attributes: nullOr(program.attributes, (list) => list.map((attribute) => cutComment(attribute, rules))) };
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
  const read = readProgram(written);
  if ("error" in read) throw new Refused("message", `it would be read with the error ${read.error.kind}`);
  if (!same(read.message, withoutEnds(cut))) throw new Refused("message", "it would be read as another program");
  return written;
}

// Values of unknown shape

function text(value: unknown): string {
  if (typeof value !== "string") throw new Refused("message", "no text");
  if (/[\ud800-\udfff]/u.test(value)) throw new Refused("message", "half a character");
  return value;
}

function list<T>(value: readonly T[]): readonly T[] {
  if (!Array.isArray(value)) throw new Refused("message", "no list");
  return value;
}

function nullOr<T, R>(value: T | null, write: (value: T) => R): R | null {
  return value === null ? null : write(value);
}

function refuse(wrong: boolean, kind: string): void {
  if (wrong) throw new Refused(kind);
}

/** The one field of an object that says what it is. */
function tag<T extends string>(value: object, ...names: T[]): T {
  if (typeof value !== "object" || value === null) throw new Refused("message", "no object");
  const name = oneOf(Object.keys(value)[0], names);
  fields(value, name);
  return name;
}

function same(one: unknown, other: unknown): boolean {
  if (Array.isArray(one) && Array.isArray(other)) return one.length === other.length && one.every((value, index) => same(value, other[index]));
  if (typeof one !== "object" || typeof other !== "object" || one === null || other === null) return Object.is(one, other);
  const names = Object.keys(one);
  if (names.length !== Object.keys(other).length) return false;
  return names.every((name) => same((one as Record<string, unknown>)[name], (other as Record<string, unknown>)[name]));
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
  refuse(!isName(text(name)), "name");
  refuse(name.length > rules.name_limit, "name_length");
  if (kind === null) return `/PROG  ${name}`;
  refuse(text(kind) === "" || trim(kind) !== kind || CONTROL.test(kind), "name");
  return `/PROG  ${name}\t  ${kind}`;
}

/** A comment that is too long is refused, or cut (LS-37). */
function cutComment(attribute: Attribute, rules: Rules): Attribute {
  fields(attribute, "name", "value");
  const { name, value } = attribute;
  if (tag(value, "text", "list") === "list" || !("text" in value) || !COMMENT_NAMES.includes(name)) return attribute;
  const comment = commentOf(text(value.text));
  if (characters(comment) <= MAX_COMMENT) return attribute;
  refuse(rules.comment !== "truncate", "comment_length");
  return { name, value: { text: `"${trimEnd([...comment].slice(0, MAX_COMMENT).join(""))}"` } };
}

/** An attribute that is read as another one is refused, also where nothing is behind it (LS-37). */
function writeAttribute(attribute: Attribute): string {
  const written = attributeText(attribute);
  const [part, ...others] = readAttributes(written, { start: 0, end: written.length });
  const isSame = part !== undefined && "value" in part && part.end === written.length && same(part.value, attribute);
  refuse(!isSame || others.length > 0, "attribute");
  return written;
}

function attributeText({ name, value }: Attribute): string {
  if ("text" in value) return `${text(name)}${characters(name) >= 8 ? "\t" : "\t\t"}= ${text(value.text)};`;
  const items = list(value.list).map((item) => {
    refuse(!Array.isArray(item) || item.length !== 2, "message");
    return `${text(item[0])}\t= ${text(item[1])}`;
  });
  return `${text(name)}:  ${items.join(",\r\n      ")};`;
}

function writeApplication(line: string): string {
  refuse(CONTROL.test(text(line)), "application");
  const section = beginsSection(line);
  refuse(section !== null && section !== "/PROG" && section !== "/APPL", "application");
  return trimEnd(line);
}

// Instructions

function writeInstructions(instructions: readonly Instruction[]): string[] {
  let number = 0;
  return instructions.map((instruction) => {
    if (typeof instruction === "object" && instruction !== null && "nested" in instruction) {
      tag(instruction, "nested");
      const nested = text(instruction.nested);
      refuse(trimEnd(nested) !== nested || CONTROL_OR_TAB.test(nested), "instruction");
      return nested;
    }
    number += 1;
    return `${String(number).padStart(4)}:${writeInstruction(instruction)}`;
  });
}

function writeInstruction(instruction: Instruction): string {
  if (instruction === "empty") return "   ;";
  const kind = tag(instruction as object, "comment", "user_frame", "user_tool", "other", "motion");
  if (kind === "motion" && typeof instruction !== "string" && "motion" in instruction) return `${writeMotion(instruction.motion)}    ;`;
  return `${writeText(instruction)} ;`;
}

function writeText(instruction: Instruction): string {
  if (typeof instruction === "string") throw new Refused("message", "no instruction");
  if ("user_frame" in instruction) return `  UFRAME_NUM=${integer(instruction.user_frame, 0, 0xffff)}`;
  if ("user_tool" in instruction) return `  UTOOL_NUM=${integer(instruction.user_tool, 0, 0xffff)}`;
  if ("comment" in instruction) return `  !${continued(instruction.comment)}`;
  if (!("other" in instruction)) throw new Refused("message", "no instruction");
  const other = continued(instruction.other);
  return `${other.startsWith("=") ? " ".repeat(9) : "  "}${other}`;
}

/** A text whose line feeds are continuations. */
function continued(value: string): string {
  refuse(CONTROL_BUT_LF.test(text(value)), "instruction");
  const lines = trimEnd(value).split("\n");
  refuse(lines.slice(0, -1).some((line) => trimEnd(line).endsWith(";")), "instruction");
  return lines.join(CONTINUED);
}

function writeMotion(motion: Motion): string {
  fields(motion, "kind", "via", "via_options", "target", "speed", "termination", "options");
  const { kind, via, target, speed, termination } = motion;
  const letter = LETTERS[oneOf(kind, KINDS)];
  const via_options = continued(motion.via_options);
  refuse((kind === "circular") !== (via !== null) || (via === null && via_options !== ""), "via");
  const first = via === null ? [] : [[writeTarget(via), via_options].filter((word) => word !== "").join(" ")];
  const words = [writeTarget(target), writeSpeed(kind, speed), writeTermination(termination), continued(motion.options)];
  const second = words.filter((word) => word !== "").join(" ");
  return `${letter} ${first.length === 0 ? second : `${first.join("")}    ${CONTINUED}${second}`}`;
}

function writeTarget(target: Target): string {
  tag(target, "position", "register", "other");
  if ("other" in target) return spelled(target.other);
  const letters = "position" in target ? "P" : "PR";
  const numbered = "position" in target ? target.position : target.register;
  fields(numbered, "number", "name");
  const name = numbered.name === null ? "" : `:${spelled(numbered.name)}`;
  return `${letters}[${integer(numbered.number, 0, MAX_U32)}${name}]`;
}

function spelled(value: string): string {
  refuse(CONTROL.test(text(value)), "instruction");
  return value;
}

function writeSpeed(kind: MotionKind, speed: Speed): string {
  tag(speed, "fixed", "register", "named");
  if ("named" in speed) return spelled(speed.named);
  if ("register" in speed) {
    fields(speed.register, "register", "unit");
    return spelled(speed.register.register) + writeUnit(kind, speed.register.unit);
  }
  fields(speed.fixed, "value", "unit");
  const { value, unit } = speed.fixed;
  const written = writeUnit(kind, unit);
  refuse(typeof value !== "number" || !isSpeedInRange(value, unit), "speed");
  const decimals = plainDecimal(value);
  if (unit === "sec") return (decimals.includes(".") ? decimals : `${decimals}.0`) + written;
  return decimals.replace(/^0\./, ".") + written;
}

function writeUnit(kind: MotionKind, unit: Unit): string {
  refuse(!takesUnit(kind, oneOf(unit, UNIT_NAMES)), "speed_unit");
  return UNITS.find(([, name]) => name === unit)?.[0] ?? "";
}

function writeTermination(termination: Termination): string {
  if (termination === null) return "";
  if (termination === "fine") return "FINE";
  tag(termination, "continuous", "continuous_register");
  if ("continuous" in termination) return `CNT${integer(termination.continuous, 0, 100, "continuous")}`;
  return `CNT ${spelled(termination.continuous_register)}`;
}

// Positions

function writePosition(position: Position): string {
  fields(position, "number", "name", "groups");
  const { number, name, groups } = position;
  integer(number, 0, MAX_U32);
  if (name !== null) refuse(text(name).includes('"') || CONTROL_OR_TAB.test(name) || trim(name) !== name, "position");
  refuse(list(groups).length === 0, "position");
  const written = groups.map(writeGroup).join("\r\n");
  return `P[${number}${name === null ? "" : `:"${name}"`}]{\r\n${written}\r\n};`;
}

function writeGroup(group: Group): string {
  fields(group, "number", "user_frame", "user_tool", "configuration", "axes");
  const { number, user_frame, user_tool, configuration, axes } = group;
  const frames = `\tUF : ${writeFrame(user_frame)}, UT : ${writeFrame(user_tool)},\t`;
  refuse(list(axes).length === 0, "position");
  const lines: string[] = [];
  for (let first = 0; first < axes.length; first += AXES_IN_A_LINE) {
    lines.push(`\t${axes.slice(first, first + AXES_IN_A_LINE).map(writeAxis).join(",\t")}`);
  }
  return `   GP${integer(number, 0, 255)}:\r\n${frames}${writeConfiguration(configuration)}\r\n${lines.join(",\r\n")}`;
}

function writeFrame(frame: number | null): string {
  return frame === null ? "F" : String(integer(frame, 0, 0xffff));
}

function writeConfiguration(configuration: Group["configuration"]): string {
  if (configuration === null) return "";
  fields(configuration, "keyword", "text");
  const { keyword } = configuration;
  refuse(!KEYWORD.test(text(keyword)) || characters(keyword) < 3, "position");
  refuse(configuration.text.includes("'") || CONTROL_OR_TAB.test(text(configuration.text)), "position");
  return `\t${keyword} : '${configuration.text}',`;
}

function writeAxis(axis: Axis): string {
  fields(axis, "name", "value", "unit");
  const { name, value } = axis;
  const unit = oneOf(axis.unit, ["deg", "mm"]);
  refuse(!/^([XYZWPR]|R[XYZWPR]|[JE][1-9])$/.test(text(name)), "position");
  refuse(value !== null && !(typeof value === "number" && Number.isFinite(value)), "position");
  const equals = /[0-9]$/.test(name) ? "=" : " =";
  return `${name}${equals}${value === null ? "  ********" : writeCoordinate(value)}${unit === "mm" ? "  mm" : " deg"}`;
}

/** Right-aligned in ten columns, with three decimals if that reads as the same double (LS-39). */
function writeCoordinate(value: number): string {
  const size = Math.abs(value);
  const sign = value < 0 || Object.is(value, -0) ? "-" : "";
  const three = size < 1e21 ? size.toFixed(3) : `${BigInt(size)}.000`;
  const decimals = Number(three) === size ? three : plainDecimal(size);
  const short = size === 0 && sign === "" ? decimals : decimals.replace(/^0\./, ".");
  return (sign + short).padStart(10);
}

/** As few decimals as read as the same double, and no exponent. */
function plainDecimal(value: number): string {
  const [mantissa = "", exponent] = String(value).split("e");
  if (exponent === undefined) return mantissa;
  const [whole = "", decimals = ""] = mantissa.split(".");
  const digits = whole + decimals;
  const point = whole.length + Number(exponent);
  if (point <= 0) return `0.${"0".repeat(-point)}${digits}`;
  return point >= digits.length ? digits.padEnd(point, "0") : `${digits.slice(0, point)}.${digits.slice(point)}`;
}

