/** Times of ALTER that both ends have to know (sections 4.6 and 9). All are in ns. */

import type { AlterError, Framing } from "../val2-alter.js";
import { lineTime } from "./session.js";

const MS = 1e6;

/** A cycle of the controller. */
export const CYCLE = 28 * MS;

/** From the end of the message to the end of the reply: less in the cumulative modes (AL-83). */
export function windowOf(mode: number): number {
  return isCumulative(mode) ? 15 * MS : 17 * MS;
}

/** How long after a message of so many bytes the reply has to end (AL-61, AL-72). */
export function replyWindow(mode: number, baud: number, bytes: number): number {
  return Math.min(windowOf(mode), Math.max(CYCLE - lineTime(bytes, baud), 0));
}

export function isCumulative(mode: number): boolean {
  return (mode & 1) !== 0;
}

/** Standard messages have a transformation. */
export function hasTransform(mode: number): boolean {
  return (mode & 4) !== 0;
}

/** Values change the path of the arm. */
export function usesInputs(mode: number): boolean {
  return (mode & 16) !== 0;
}

/** A reply with so many values and no doubled byte, in bytes. */
export function shortestReply(framing: Framing, values: number): number {
  return framing.leading_dle + 6 + 2 * values;
}

/** A standard message without a doubled byte, in bytes. */
export function shortestMessage(framing: Framing, mode: number): number {
  return framing.leading_dle + 4 + (hasTransform(mode) ? 30 : 6);
}

/** The error code of what the controller could not read; 6 is a timeout (section 4.6). */
export const TIMEOUT = 6;
export const WRONG_FIELDS = 2;
export const TOO_LONG = 3;

export function errorCode(error: AlterError): number {
  switch (error.kind) {
    case "checksum":
      return 1;
    case "too_long":
      return TOO_LONG;
    case "incomplete":
      return 4;
    case "start_mark":
    case "end_mark":
      return 5;
    default:
      return WRONG_FIELDS;
  }
}
