/** What both ends of Modbus have to know of their transport (FM-3 to FM-5, FM-77). */

import { NEVER, lineTime } from "./session.js";

/** Over TCP, in RTU frames on a serial line, or in RTU frames through TCP. */
export type Transport = "tcp" | "rtu" | "rtu_over_tcp";

const BITS = 11;
const MS = 1e6;
const STALL = 500 * MS;
const FAST = 19200;

/** The silence that ends a frame on a serial line: 3.5 characters, truncated to µs (FM-4). */
export function silenceOf(baud: number): number {
  return baud === 0 || baud > FAST ? 1.75 * MS : Math.floor(38.5e6 / baud) * 1000;
}

/** Without a byte for so long the input ends; never over TCP. */
export function silence(transport: Transport, baud: number): number {
  return { tcp: NEVER, rtu: silenceOf(baud), rtu_over_tcp: STALL }[transport];
}

/** How long the rest of an incomplete request is waited for: 32 characters and 20 ms (FM-79). */
export function pieceTime(transport: Transport, baud: number): number {
  return transport === "rtu" ? lineTime(32, Math.max(baud, 1), BITS) + 20 * MS : 50 * MS;
}

/** The time of the longest frame on a serial line; a rate of 0 is taken for 1 (FM-77). */
export function longestFrame(baud: number): number {
  return lineTime(256, Math.max(baud, 1), BITS);
}
