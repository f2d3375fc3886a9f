/** Lines that return what is sent, as adapters for two wires often do (FM-88, IB-41, LE-113, VV-42 of the reference). */

import { concat, numberAt } from "../stream.js";

export type EchoError = { kind: "not_set"; length: number } | { kind: "collision"; offset: number; expected: number; found: number };

export interface EchoEvent {
  event: "echo";
  error: EchoError;
}

/** The bytes of noise that an adapter may give before a frame that comes back. */
const MOST_NOISE = 2;
const NOTHING = new Uint8Array(0);

/** Takes out of the input of a connection what the line returns of the output. */
export class Echo {
  /** The last frame, if it is compared or looked for. */
  private frame: Uint8Array = NOTHING;
  /** The bytes since it was sent, as far as they may be the frame. */
  private come: Uint8Array = NOTHING;

  /** `returns`: the line returns what is sent. */
  constructor(private returns: boolean) {}

  /** A frame is sent. `isProof`: no answer to it begins with the same bytes. */
  sent(frame: Uint8Array, isProof: boolean): void {
    this.frame = this.returns || isProof ? frame : NOTHING;
    this.come = NOTHING;
  }

  /** The bytes that have come, without the line's own; and what is wrong, once for a frame. */
  receive(bytes: Uint8Array): { rest: Uint8Array; error: EchoError | null } {
    const before = this.come.length;
    return this.returns ? this.compare(bytes, before) : this.look(bytes, before);
  }

  /** The same, of an end: reports what is wrong. `empty` forgets what was not read yet: the beginning of a frame that came back. */
  remove(bytes: Uint8Array, events: { push(event: EchoEvent): void }, empty: () => void = () => {}): Uint8Array {
    const { rest, error } = this.receive(bytes);
    if (error?.kind === "not_set") empty();
    if (error !== null) events.push({ event: "echo", error });
    return rest;
  }

  /** An end has found the last frame, of so many bytes, among what it reads: reports it, if that is news (LE-115). */
  found(length: number, events: { push(event: EchoEvent): void }): void {
    if (!this.returns) events.push({ event: "echo", error: { kind: "not_set", length } });
    this.returns = true;
    this.sent(NOTHING, true);
  }

  /** FM-88, IB-41, LE-113, VV-42 */
  private compare(bytes: Uint8Array, before: number): { rest: Uint8Array; error: EchoError | null } {
    const { frame } = this;
    this.come = concat(this.come, bytes).slice(0, frame.length);
    const rest = bytes.subarray(this.come.length - before);
    const offset = this.come.findIndex((byte, at) => byte !== frame[at]);
    if (offset < before) return { rest, error: null };
    return { rest, error: { kind: "collision", offset, expected: numberAt(frame, offset), found: numberAt(this.come, offset) } };
  }

  /** FM-92, IB-42, LE-114, VV-43 */
  private look(bytes: Uint8Array, before: number): { rest: Uint8Array; error: EchoError | null } {
    const { length } = this.frame;
    this.come = concat(this.come, bytes).slice(0, length + MOST_NOISE);
    for (let noise = 0; length > 0 && noise <= MOST_NOISE; noise += 1) {
      if (!this.frame.every((byte, at) => byte === this.come[noise + at])) continue;
      this.returns = true;
      this.sent(NOTHING, true);
      return { rest: bytes.subarray(noise + length - before), error: { kind: "not_set", length } };
    }
    return { rest: bytes, error: null };
  }
}
