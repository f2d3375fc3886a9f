/** The decoder of one side of VAL II ALTER (section 5), which searches the bytes of a corrupt frame again. */

import { concat, type Item, type ItemReader } from "./stream.js";
import {
  DEFAULT_FRAMING,
  DLE,
  ETX,
  MAX_DATA,
  STX,
  checksumOf,
  decodeData,
  hasNamedCodes,
  type AlterError,
  type AlterMessage,
  type Framing,
  type Side,
} from "./val2-alter.js";

/** What `read` makes of bytes that begin with a start mark: `extent` bytes were read as a corrupt frame. */
type Reading =
  | { kind: "more" }
  | { kind: "message"; message: AlterMessage; length: number; checksum: number }
  | { kind: "error"; error: AlterError; extent: number };

const MORE: Reading = { kind: "more" };

export class AlterDecoder<M extends AlterMessage = AlterMessage> implements ItemReader<M, AlterError> {
  private held: Uint8Array = new Uint8Array(0);
  private ended = false;
  /** The end of what was returned last. */
  private position = 0;
  /** Bytes behind the position that belong to no frame. */
  private skipped = 0;
  /** DLEs in front of the held ones that a start mark does not need. */
  private spare = 0;
  /** The first byte held is also the checksum of the frame before (AL-34). */
  private lent = false;
  /** How many of the bytes held were read as a corrupt frame before (AL-35). */
  private readBefore = 0;
  /** The error of the corrupt frame whose bytes are being skipped. */
  private error: AlterError | null = null;
  private readonly limit: number;
  /** Is called when a frame is found to be corrupt, which is before the bytes that its error covers are known (AL-38). */
  onCorrupt: (error: AlterError) => void = () => undefined;

  constructor(
    private readonly side: Side,
    private readonly framing: Framing = DEFAULT_FRAMING,
  ) {
    this.limit = MAX_DATA[side];
  }

  push(bytes: Uint8Array): void {
    this.held = concat(this.held, bytes);
  }

  end(): void {
    this.ended = true;
  }

  /** Bytes that belong to no message and no error yet; a byte that is lent belongs to its message (AL-52). */
  get pending(): number {
    return this.skipped + this.spare + this.held.length - this.lentBytes;
  }

  /** Forgets what belongs to no message and no error yet; offsets count on (AL-92). */
  discard(): void {
    this.position += this.pending;
    this.held = new Uint8Array(0);
    this.skipped = this.spare = this.readBefore = 0;
    this.lent = this.ended = false;
    this.error = null;
  }

  next(): Item<M, AlterError> | null {
    for (;;) {
      const atMark = this.seek();
      // A second reading is judged by the corrupt frame's own bytes alone (AL-84); of a first one there are none.
      if (this.read(this.held.subarray(0, this.readBefore), false).kind === "error") {
        this.skip(1);
        continue;
      }
      if (atMark || this.ended) {
        const error = this.takeSkipped();
        if (error !== null) return error;
      }
      if (!atMark) {
        this.ended = false;
        return null;
      }
      const reading = this.read(this.held, this.ended);
      switch (reading.kind) {
        case "more":
          return null;
        case "message":
          return this.takeMessage(reading.message as M, reading.length, reading.checksum);
        case "error": {
          const { error, extent } = reading;
          this.error = { ...error, offset: error.offset + this.position + this.spare - this.lentBytes };
          this.readBefore = Math.max(this.readBefore, extent);
          this.skip(1);
          this.onCorrupt(this.error);
        }
      }
    }
  }

  private get lentBytes(): number {
    return this.lent ? 1 : 0;
  }

  /** The error that covers the bytes that were skipped, if there are any. */
  private takeSkipped(): Item<M, AlterError> | null {
    const [offset, length] = [this.position, this.skipped];
    if (length === 0) return null;
    const error: AlterError = this.error ?? { kind: "start_mark", offset, length };
    this.error = null;
    this.position += length;
    this.skipped = 0;
    return { offset, length, error };
  }

  private takeMessage(message: M, size: number, checksum: number): Item<M, AlterError> {
    const [offset, length] = [this.position, this.spare + size - this.lentBytes];
    this.spare = 0;
    this.lent = false;
    this.remove(size);
    if (!this.framing.stuffed_checksum && checksum === DLE) {
      this.held = concat(Uint8Array.of(DLE), this.held);
      this.lent = true;
      this.readBefore = Math.max(this.readBefore, 1);
    }
    this.position += length;
    return { offset, length, message };
  }

  /** Removes what cannot belong to a start mark; whether the bytes held begin with one then (AL-27, AL-33). */
  private seek(): boolean {
    const least = this.framing.leading_dle;
    for (;;) {
      const dle = this.held.indexOf(DLE);
      this.skip(dle < 0 ? this.held.length : dle);
      let run = 0;
      while (this.held[run] === DLE) run += 1;
      const after = this.held[run];
      if (after === STX && run >= least) {
        this.setAside(run - least);
        return true;
      }
      if (after === undefined) {
        if (this.ended) this.skip(run);
        else this.setAside(Math.max(run - least, 0));
        return false;
      }
      this.skip(run);
    }
  }

  /** Removes DLEs that a start mark does not need; a lent one is not counted. */
  private setAside(count: number): void {
    this.spare += count - this.lentBytes;
    this.lent = false;
    this.remove(count);
  }

  /** Bytes belong to no frame, nor do the spare DLEs before them. */
  private skip(count: number): void {
    if (count === 0) return;
    this.skipped += this.spare + count - this.lentBytes;
    this.spare = 0;
    this.lent = false;
    this.remove(count);
  }

  private remove(count: number): void {
    this.held = this.held.subarray(count);
    this.readBefore = Math.max(this.readBefore - count, 0);
  }

  /** Reads bytes that begin with a start mark; offsets count from their first byte. */
  private read(bytes: Uint8Array, ended: boolean): Reading {
    const stx = bytes.indexOf(STX);
    if (stx < 0) return MORE;
    const cut: Reading = ended
      ? { kind: "error", error: { kind: "incomplete", offset: 0, length: bytes.length }, extent: bytes.length }
      : MORE;
    const data: number[] = [];
    let at = stx + 1;
    for (;;) {
      const byte = bytes[at];
      if (byte === undefined) return cut;
      if (byte === DLE) {
        const second = bytes[at + 1];
        if (second === undefined) return cut;
        if (second === ETX) break;
        if (second !== DLE) return fault({ kind: "end_mark", offset: at + 1, found: second }, at + 1);
        at += 1;
      }
      if (data.length === this.limit) return fault({ kind: "too_long", offset: 0, limit: this.limit }, this.limit);
      data.push(byte);
      at += 1;
    }
    return this.readChecksum(bytes, Uint8Array.from(data), at + 2, cut);
  }

  private readChecksum(bytes: Uint8Array, data: Uint8Array, place: number, cut: Reading): Reading {
    const found = bytes[place];
    if (found === undefined) return cut;
    const expected = checksumOf(data, this.framing);
    if (found !== expected) return fault({ kind: "checksum", offset: place, expected, found }, place);
    let at = place + 1;
    if (this.framing.stuffed_checksum && found === DLE) {
      const second = bytes[at];
      if (second === undefined) return cut;
      if (second !== DLE) return fault({ kind: "end_mark", offset: at, found: second }, at);
      at += 1;
    }
    const decoded = decodeData(data, this.side, this.framing);
    if ("error" in decoded) return fault(decoded.error, at);
    if (this.readBefore > 0 && !hasNamedCodes(decoded.message)) return fault({ kind: "length", offset: 0, found: data.length }, at);
    return { kind: "message", message: decoded.message, length: at, checksum: found };
  }
}

function fault(error: AlterError, extent: number): Reading {
  return { kind: "error", error, extent };
}
