/** The positions of an LS file (LS-60). */

import { LETTER, MAX_U32, WS, trim, type Axis, type Group, type Position } from "./fanuc-ls.js";
import { Cursor, LsFault, linesOf, type Span } from "./ls-scan.js";

/** Where the positions of a section are; a text that does not begin with `P[` is none. */
export function dividePositions(text: string, section: Span): Span[] {
  const starts: { line: number; start: number }[] = [];
  const visible = new RegExp(`[^${WS}]`);
  for (const line of linesOf(text, section)) {
    const white = text.slice(line.start, line.end).search(visible);
    const start = line.start + white;
    if (white >= 0 && (starts.length === 0 || text.startsWith("P[", start))) starts.push({ line: line.start, start });
  }
  return starts.map(({ start }, index) => ({ start, end: starts[index + 1]?.line ?? section.end }));
}

/** The number behind `P[` of a position that may have a fault (LS-36); NaN, if there is none. */
export function numberOfPosition(text: string): number {
  return Number(new RegExp(`^P\\[[${WS}]*([0-9]+)`).exec(text)?.[1]);
}

export function readPosition(text: string, { start, end }: Span): Position {
  const cursor = new Cursor(text, start, end);
  cursor.expect("P[", "position");
  cursor.gap();
  const number = cursor.number(MAX_U32, "position");
  cursor.gap();
  const name = cursor.skip(":") ? readName(cursor) : null;
  cursor.gap();
  cursor.expect("]", "position");
  cursor.gap();
  cursor.expect("{", "position");
  cursor.gap();
  const groups: Group[] = [];
  while (cursor.skip("GP")) groups.push(readGroup(cursor));
  cursor.expect("}", "group");
  cursor.gap();
  cursor.expect(";", "group");
  cursor.gap();
  if (trim(cursor.rest) !== "") cursor.fail("position");
  return { number, name, groups };
}

function readName(cursor: Cursor): string {
  cursor.gap();
  const start = cursor.at;
  const quoted = cursor.skip('"');
  const name = cursor.take(quoted ? /[^"\r\n]*/y : /[^\]\r\n]*/y);
  if (!cursor.has(quoted ? '"' : "]")) throw new LsFault("position", start);
  cursor.skip('"');
  return trim(name);
}

/** Behind `GP`, and the white space behind it. */
function readGroup(cursor: Cursor): Group {
  const number = cursor.number(255, "group");
  cursor.gap();
  cursor.expect(":", "group");
  const user_frame = readFrame(cursor, "UF");
  const user_tool = readFrame(cursor, "UT");
  cursor.gap();
  const configuration = readConfiguration(cursor);
  const axes = [readAxis(cursor)];
  for (;;) {
    cursor.gap();
    if (cursor.skip(",")) cursor.gap();
    else if (cursor.look(AXIS) === "") return { number, user_frame, user_tool, configuration, axes };
    axes.push(readAxis(cursor));
  }
}

function readFrame(cursor: Cursor, name: "UF" | "UT"): number | null {
  cursor.gap();
  cursor.expect(name, "frames");
  cursor.gap();
  cursor.expect(":", "frames");
  cursor.gap();
  const frame = cursor.skip("F") ? null : cursor.number(0xffff, "frames");
  cursor.gap();
  cursor.expect(",", "frames");
  return frame;
}

const WORD = new RegExp(`[${LETTER}0-9_]*`, "y");

function readConfiguration(cursor: Cursor): Group["configuration"] {
  const keyword = cursor.look(WORD);
  if ([...keyword].length < 3) return null;
  cursor.at += keyword.length;
  cursor.gap();
  cursor.expect(":", "configuration");
  cursor.gap();
  const quote = cursor.at;
  cursor.expect("'", "configuration");
  const text = cursor.take(/[^'\r\n]*/y);
  if (!cursor.skip("'")) cursor.fail("configuration", quote);
  cursor.gap();
  cursor.expect(",", "configuration");
  cursor.gap();
  return { keyword, text };
}

const AXIS = /R[XYZWPR]|[JE][1-9]|[XYZWPR]/y;

function readAxis(cursor: Cursor): Axis {
  const name = cursor.take(AXIS);
  if (name === "") cursor.fail("axis");
  cursor.gap();
  cursor.expect("=", "axis");
  cursor.gap();
  const value = cursor.take(/\**/y) !== "" ? null : cursor.decimal("number");
  cursor.gap();
  for (const unit of ["deg", "mm"] as const) {
    if (cursor.skip(unit)) return { name, value, unit };
  }
  throw new LsFault("axis_unit", cursor.at);
}
