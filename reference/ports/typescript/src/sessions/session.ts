/** What the sessions of all ends have in common. */

import { Refused } from "../check.js";

/** Times are whole nanoseconds of a clock of the caller's, as numbers; this is never. */
export const NEVER = Number.POSITIVE_INFINITY;

/** An input that the state does not allow: it has changed nothing. */
export interface Unexpected {
  event: "unexpected";
}

/**
 * One end of a link, without a clock and without a socket. Its owner gives it what happens and the time at which it happens, takes
 * events and bytes, and calls `timeout` when the deadline has come.
 */
export interface Session<E> {
  connected(now: number): void;
  disconnected(now: number): void;
  input(bytes: Uint8Array, now: number): void;
  timeout(now: number): void;
  /** The last byte has left the port. */
  transmitted(now: number): void;
  /** The next piece to transmit, if there is one. */
  transmit(now: number): Uint8Array | null;
  /** The oldest event that was not taken yet. */
  event(): E | null;
  /** When the session wants `timeout`, or may send, at the latest. */
  deadline(): number;
}

/** Events that wait to be taken. */
export class Events<E> {
  private readonly waiting: E[] = [];

  push(event: E): void {
    this.waiting.push(event);
  }

  take(): E | null {
    return this.waiting.shift() ?? null;
  }

  /** How many of these wait. */
  count(test: (event: E) => boolean): number {
    return this.waiting.filter(test).length;
  }
}

/** Whether a deadline is due: at its own instant. */
export function isDue(deadline: number, now: number): boolean {
  return now >= deadline;
}

/** The time of so many bytes of so many bits at a rate, rounded down to a nanosecond; rate 0 never ends. */
export function lineTime(bytes: number, baud: number, bits = 10): number {
  return baud === 0 ? NEVER : Math.floor((bytes * bits * 1e9) / baud);
}

/** Refuses a configuration. */
export function require(condition: boolean, about: string): void {
  if (!condition) throw new Refused("config", about);
}
