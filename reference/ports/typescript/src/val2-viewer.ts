/** VAL II viewer: a workstation asks a host for the pose of its arm, which it draws. */

import { fields, integer, integers } from "./check.js";
import { Decoder, bytesOf, latin1, type Found } from "./stream.js";

/** ENQ, the request (VV-8). */
export const REQUEST = 0x05;
export const XON = 0x11;
export const XOFF = 0x13;
/** The longest line, in bytes (VV-7). */
export const MAX_LINE = 100;

const HEAD = "$POSE,";
const DOLLAR = 0x24;
const LF = 0x0a;
const WORDS = 12;

export interface Pose {
  /** The packets that the host has sent before, modulo 65536. */
  count: number;
  /** The columns n, o, a (16384 is 1.0) and the position X, Y, Z in 1/32 mm, as in ALTER (VV-9). */
  pose: number[];
}

export type ViewerError =
  | { kind: "format" | "number"; offset: number }
  | { kind: "checksum"; expected: number; found: number }
  | { kind: "too_long"; limit: number }
  | { kind: "incomplete" | "noise"; length: number };

/** Whether the line that an error covers was a whole one, and so the answer to a request (VV-26). */
export function isWholeLine(error: ViewerError): boolean {
  return error.kind !== "incomplete" && error.kind !== "noise";
}

/** The line of a pose (VV-5, VV-6, VV-17). */
export function encodePose(message: Pose): Uint8Array {
  fields(message, "count", "pose");
  const numbers = [integer(message.count, 0, 0xffff), ...integers(message.pose, -0x8000, 0x7fff, WORDS)];
  const line = `${HEAD}${numbers.join(",")}`;
  return bytesOf(`${line}*${hex(xor(bytesOf(line.slice(1))))}\r\n`);
}

/** Reads a line that ends with LF, from left to right (VV-12); nothing behind it is looked at. */
function decodeLine(line: Uint8Array): { message: Pose } | { error: ViewerError } {
  const text = latin1(line);
  let at = 0;
  const format = (): { error: ViewerError } => ({ error: { kind: "format", offset: at } });
  for (; at < HEAD.length; at += 1) {
    if (text[at] !== HEAD[at]) return format();
  }
  const numbers: number[] = [];
  for (let index = 0; index <= WORDS; index += 1) {
    if (index > 0) {
      if (text[at] !== ",") return format();
      at += 1;
    }
    const digits = /^-?[0-9]*/.exec(text.slice(at))?.[0] ?? "";
    const [min, max] = index === 0 ? [0, 0xffff] : [-0x8000, 0x7fff];
    const value = Number(digits);
    if (!/^(0|-?[1-9][0-9]{0,4})$/.test(digits) || value < min || value > max) return { error: { kind: "number", offset: at } };
    numbers.push(value);
    at += digits.length;
  }
  if (text[at] !== "*") return format();
  const expected = xor(line.subarray(1, at));
  const digits = at + 1;
  for (at = digits; at < digits + 2; at += 1) {
    if (!/^[0-9A-F]$/.test(text[at] ?? "")) return format();
  }
  const found = parseInt(text.slice(digits, at), 16);
  if (found !== expected) return { error: { kind: "checksum", expected, found } };
  if (text[at] !== "\r") return format();
  at += 1;
  if (text[at] !== "\n") return format();
  return { message: { count: numbers[0] as number, pose: numbers.slice(1) } };
}

function xor(bytes: Uint8Array): number {
  return bytes.reduce((all, byte) => all ^ byte, 0);
}

function hex(byte: number): string {
  return byte.toString(16).toUpperCase().padStart(2, "0");
}

/** The workstation's decoder of what the host sends, without XON and XOFF (VV-11 to VV-16). */
export class ViewerDecoder extends Decoder<Pose, ViewerError> {
  protected read(): Found<Pose, ViewerError> | null {
    const { held } = this;
    if (held.length === 0) return null;
    const window = held.subarray(0, MAX_LINE);
    const begun = held[0] === DOLLAR;
    const stop = window.findIndex((byte, place) => byte === LF || (byte === DOLLAR && place > 0));
    let length = window.length;
    if (window[stop] === LF) {
      return { length: stop + 1, ...decodeLine(window) };
    } else if (stop !== -1) {
      length = stop;
    } else if (window.length === MAX_LINE) {
      if (begun) return { length, error: { kind: "too_long", limit: MAX_LINE } };
    } else if (!this.ended) {
      return null;
    }
    return { length, error: { kind: begun ? "incomplete" : "noise", length } };
  }
}
