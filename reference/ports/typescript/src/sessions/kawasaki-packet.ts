/** A packet of kawasaki-msg: what an end writes at once. */

import type { Dialect, Job, Role, Values } from "../kawasaki-dialect.js";
import { encodeMessage } from "../kawasaki-msg.js";
import { concat } from "../stream.js";

/** Messages that are sent at once (KM-6). */
export class Packet {
  private readonly parts: Uint8Array[] = [];
  private size = 0;

  constructor(
    private readonly dialect: Dialect,
    private readonly limit: number,
  ) {}

  /** Whether there was room for a message; one that the table lacks is left out (KM-29). */
  add(role: Role, values: Values, job?: Job): boolean {
    const message = this.dialect.write(role, values, job);
    if (message === null) return true;
    const bytes = encodeMessage(message, this.dialect.charset);
    if (this.size + bytes.length > this.limit) return false;
    this.parts.push(bytes);
    this.size += bytes.length;
    return true;
  }

  get isEmpty(): boolean {
    return this.parts.length === 0;
  }

  get bytes(): Uint8Array {
    return concat(...this.parts);
  }
}
