/** fanuc-ls: FANUC teach pendant programs as text. The values of a program, and the errors of a reader. */

export interface Program {
  name: string;
  kind: string | null;
  /** null where there is no `/ATTR`. */
  attributes: Attribute[] | null;
  /** The lines of `/APPL`, or null. */
  application: string[] | null;
  instructions: Instruction[];
  positions: Position[];
}

export interface Attribute {
  name: string;
  /** Quotes belong to a text. */
  value: { text: string } | { list: [string, string][] };
}

/** A line feed in a text stands for a line end that the next line continues with `:`. */
export type Instruction =
  | "empty"
  | { comment: string }
  | { user_frame: number }
  | { user_tool: number }
  | { other: string }
  | { nested: string }
  | { motion: Motion };

export const MOTION_LETTERS = { J: "joint", L: "linear", C: "circular", A: "arc", S: "spline" } as const;
export type MotionKind = (typeof MOTION_LETTERS)[keyof typeof MOTION_LETTERS];

export interface Motion {
  kind: MotionKind;
  via: Target | null;
  via_options: string;
  target: Target;
  speed: Speed;
  termination: Termination;
  options: string;
}

export interface Numbered {
  number: number;
  name: string | null;
}

export type Target = { position: Numbered } | { register: Numbered } | { other: string };

export type Unit = "percent" | "sec" | "msec" | "mm_per_sec" | "cm_per_min" | "inch_per_min" | "deg_per_sec";

export type Speed = { fixed: { value: number; unit: Unit } } | { register: { register: string; unit: Unit } } | { named: string };

export type Termination = "fine" | { continuous: number } | { continuous_register: string } | null;

export interface Position extends Numbered {
  groups: Group[];
}

export interface Group {
  number: number;
  /** null is F, the frame that is active when the program runs. */
  user_frame: number | null;
  user_tool: number | null;
  configuration: { keyword: string; text: string } | null;
  axes: Axis[];
}

export interface Axis {
  name: string;
  /** null was never taught. */
  value: number | null;
  unit: "deg" | "mm";
}

export type FaultKind =
  | "program"
  | "attribute"
  | "attribute_value"
  | "attribute_end"
  | "main"
  | "line_number"
  | "instruction_end"
  | "after_instruction"
  | "target"
  | "bracket"
  | "speed"
  | "speed_unit"
  | "continuous"
  | "position"
  | "group"
  | "frames"
  | "configuration"
  | "axis"
  | "number"
  | "axis_unit"
  | "end"
  | "speed_range"
  | "trailing";

/** Line and column count from 1, the column in characters; the offset is in bytes of UTF-8 (LS-34). */
export interface Place {
  line: number;
  column: number;
  offset: number;
}

export type LsError = Place & ({ kind: FaultKind } | { kind: "name_length"; found: number; limit: number });

export type LsWarning = Place &
  (
    | { kind: "unused_position" | "undefined_position" | "repeated_position" | "untaught_position"; number: number }
    | { kind: "line_number" | "line_count"; expected: number; found: number }
    | { kind: "speed_unit" | "name" }
    | { kind: "comment_length"; found: number }
  );

/** What a document holds, in the order of the text (LS-61). */
export type Entry =
  | { program: { name: string; kind: string | null } }
  | { attribute: Attribute }
  | { application: string }
  | { statement: { number: number | null; instruction: Instruction } }
  | { position: Position };

/** An entry, or what was found in it; offset and length are those of the entry, in bytes. */
export type DocumentItem = { offset: number; length: number } & ({ message: Entry } | { error: LsError } | { warning: LsWarning });

/** What a writer is told (LS-51). */
export interface Rules {
  /** The longest name, in characters. */
  name_limit: number;
  comment: "refuse" | "truncate";
}

export const DEFAULT_RULES: Rules = { name_limit: 36, comment: "refuse" };

/** The most characters of a comment (LS-11). */
export const MAX_COMMENT = 16;
export const MAX_U32 = 0xffff_ffff;

/** The names of COMMENT and LINE_COUNT, in English and German. */
export const COMMENT_NAMES = ["COMMENT", "KOMMENTAR"];
export const LINE_COUNT_NAMES = ["LINE_COUNT", "ZEILEN"];

/** The units of a speed as they are spelled; the first of each is written (LS-46). */
export const UNITS: readonly (readonly [string, Unit])[] = [
  ["%", "percent"],
  ["sec", "sec"],
  ["msec", "msec"],
  ["mm/sec", "mm_per_sec"],
  ["cm/min", "cm_per_min"],
  ["inch/min", "inch_per_min"],
  ["deg/sec", "deg_per_sec"],
  ["sek", "sec"],
  ["msek", "msec"],
  ["mm/sek", "mm_per_sec"],
  ["deg/sek", "deg_per_sec"],
];

/** Whether a motion takes a unit (LS-20). */
export function takesUnit(kind: MotionKind, unit: Unit): boolean {
  return kind === "joint" ? unit === "percent" || unit === "sec" || unit === "msec" : unit !== "percent";
}

/** Whether a writer takes a speed (LS-21). */
export function isSpeedInRange(value: number, unit: Unit): boolean {
  return value >= 0.001 && value <= (unit === "percent" ? 100 : 100_000);
}

/** The characters of a comment that count: without its quotes and the white space at its end (LS-11). */
export function commentOf(text: string): string {
  return trimEnd(text.startsWith('"') && text.endsWith('"') ? text.slice(1, -1) : text);
}

/** White space, as a class of a regular expression (LS-55). */
export const WS = "\\t\\n\\v\\f\\r \\u0085\\u00a0\\u1680\\u2000-\\u200a\\u2028\\u2029\\u202f\\u205f\\u3000";
/** Letters, likewise: of ASCII, and every other character beyond it that is no white space. */
export const LETTER =
  "A-Za-z\\u0080-\\u0084\\u0086-\\u009f\\u00a1-\\u167f\\u1681-\\u1fff\\u200b-\\u2027\\u202a-\\u202e\\u2030-\\u205e\\u2060-\\u2fff\\u3001-\\uffff";
const ENDS = new RegExp(`^[${WS}]+|[${WS}]+$`, "g");
const END = new RegExp(`[${WS}]+$`);

/** Without white space at its ends. */
export function trim(text: string): string {
  return text.replace(ENDS, "");
}

export function trimEnd(text: string): string {
  return text.replace(END, "");
}

/** How many characters: code points. */
export function characters(text: string): number {
  return [...text].length;
}
