/** fanuc-hmi-modbus: Modbus over TCP, and in RTU frames. What is in a frame is in modbus-pdu.ts. */

import { Refused, integer } from "./check.js";
import { Decoder, numberAt, type Found, type Item, type ItemReader } from "./stream.js";
import { decodePdu, encodeReply, encodeRequest, type Pdu, type PduError, type Reply, type Request, type Sender } from "./modbus-pdu.js";

export type Framing = "tcp" | "rtu";

/** What stands around a PDU; a frame of TCP has a transaction, one of RTU has none (FM-69). */
export interface Address {
  transaction?: number;
  unit: number;
}

export type ModbusMessage = Address & Pdu;
export type RequestMessage = Address & Request;
export type ReplyMessage = Address & Reply;

export type FrameError =
  | { kind: "protocol" | "mbap_length" | "too_long"; found: number }
  | { kind: "crc"; expected: number; found: number; length: number }
  | { kind: "cut"; expected: number; found: number }
  | { kind: "noise"; length: number };

/** An exception whose header counts other than 3 bytes (FM-89). */
export interface ExceptionLength {
  kind: "exception_length";
  transaction: number;
  unit: number;
  function: number;
  exception: number;
  expected: number;
  found: number;
}

export type ModbusError = FrameError | PduError | ExceptionLength;

/** The longest RTU frame (FM-6). */
export const MAX_RTU = 256;
/** The shortest. */
export const MIN_RTU = 4;
/** Transaction, protocol and length stand before what a header counts. */
const HEADER = 6;
const MIN_LENGTH = 2;
const MAX_LENGTH = 254;
/** What the header of an exception counts (FM-89). */
const EXCEPTION_LENGTH = 3;
const FUNCTIONS = [1, 2, 3, 4, 5, 6, 15, 16, 22, 23];
/** How many bytes of a corruption are looked at, at once (5.1, 5.2). */
const WINDOW = 520;
/** How many of them are given up where no frame begins. */
const GIVEN_UP = { tcp: 504, rtu: 265 };

/** The frame of a message (FM-36). */
export function encodeFrame(message: ModbusMessage, sender: Sender, framing: Framing = "tcp"): Uint8Array {
  const { transaction, unit, ...pdu } = message;
  if ((transaction !== undefined) !== (framing === "tcp")) throw new Refused("message", "a transaction is of TCP alone");
  const body = [integer(unit, 0, 255), ...(sender === "client" ? encodeRequest(pdu as Request) : encodeReply(pdu as Reply))];
  if (framing === "rtu") {
    const crc = crcOf(body);
    return Uint8Array.of(...body, crc & 0xff, crc >> 8);
  }
  const tid = integer(transaction, 0, 0xffff);
  return Uint8Array.of(tid >> 8, tid & 0xff, 0, 0, 0, body.length, ...body);
}

/** The CRC over unit and PDU (FM-9). */
export function crcOf(bytes: Iterable<number>): number {
  let crc = 0xffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let shift = 0; shift < 8; shift += 1) crc = (crc >> 1) ^ ((crc & 1) === 1 ? 0xa001 : 0);
  }
  return crc;
}

/** The length of an RTU frame by its beginning (FM-10): of bytes that are there, or what is needed to know it, or no length at all. */
export type RtuLength = { known: number } | { needed: number } | "silence";

export function rtuLength(bytes: Uint8Array, sender: Sender): RtuLength {
  const code = bytes[1];
  if (code === undefined) return { needed: MIN_RTU };
  const counted = (base: number, place: number): RtuLength => {
    const count = bytes[place];
    return count === undefined ? { needed: base } : { known: base + count };
  };
  if (code === 22) return { known: 10 };
  if (sender === "client") {
    if (code >= 1 && code <= 6) return { known: 8 };
    if (code === 15 || code === 16) return counted(9, 6);
    return code === 23 ? counted(13, 10) : "silence";
  }
  if ((code >= 1 && code <= 4) || code === 23) return counted(5, 2);
  if (code === 5 || code === 6 || code === 15 || code === 16) return { known: 8 };
  return code > 128 ? { known: 5 } : "silence";
}

function wordAt(bytes: Uint8Array, place: number): number {
  return (numberAt(bytes, place) << 8) | numberAt(bytes, place + 1);
}

/** Whether the last two bytes are the CRC of those before. */
export function hasRightCrc(frame: Uint8Array): boolean {
  return crcOf(frame.subarray(0, -2)) === crcAtEnd(frame);
}

function crcAtEnd(frame: Uint8Array): number {
  return numberAt(frame, frame.length - 2) | (numberAt(frame, frame.length - 1) << 8);
}

/** A frame whose PDU was not looked at. */
export interface Frame extends Address {
  pdu: Uint8Array;
  /** The length is wrong all the same. */
  wrong?: ExceptionLength;
}

type Result = Found<Frame, FrameError> | null;

/** Where a corruption ends: at a frame, behind so many bytes without one, or not yet known. */
type Search = { place: number } | { length: number } | null;

/** What the decoders of both framings have in common: corruption of more than one error. */
abstract class FrameDecoder extends Decoder<Frame, FrameError> {
  /** The error before was of a corruption that goes on with the bytes held. */
  private corrupt = false;
  /** The corruption that the bytes held begin with or belong to: its error, which may have been given already. */
  private corruptionFound: FrameError | null = null;

  constructor(protected readonly sender: Sender) {
    super();
  }

  override discard(): void {
    super.discard();
    this.leaveCorruption();
  }

  /** The error of the corruption within which the bytes end that were read; null, if they do not (FM-81). */
  get corruption(): FrameError | null {
    return this.corruptionFound;
  }

  /** Drops what is held beyond so many bytes. */
  keep(most: number): void {
    this.held = this.held.subarray(0, most);
  }

  protected read(): Result {
    if (this.corrupt) {
      const length = this.extent(0);
      if (length === null) return null;
      if (length > 0) return { length, error: { kind: "noise", length } };
    }
    return this.held.length === 0 ? null : this.readFrame();
  }

  protected leaveCorruption(): void {
    this.corrupt = false;
    this.corruptionFound = null;
  }

  protected abstract readFrame(): Result;

  /** Looks for the place where the next frame begins, in at most 520 bytes. */
  protected abstract search(window: Uint8Array, from: number, full: boolean): Search;

  /** The error of a corruption, which covers the bytes before the next frame. */
  protected corrupted(error: FrameError, from = 0): Result {
    this.corruptionFound ??= error;
    const length = this.extent(from);
    return length === null ? null : { length, error };
  }

  /** How many bytes of a corruption come before the next frame; null: more bytes have to come to know it. */
  private extent(from: number): number | null {
    const window = this.held.subarray(0, WINDOW);
    const found = this.search(window, from, window.length === WINDOW);
    if (found === null && !this.ended) return null;
    if (found !== null && "length" in found) {
      this.corrupt = true;
      return found.length;
    }
    this.leaveCorruption();
    return found === null ? this.held.length : found.place;
  }

  protected cut(expected: number): Result {
    const found = this.held.length;
    return this.ended ? { length: found, error: { kind: "cut", expected, found } } : null;
  }
}

/** Frames over TCP (FM-72). */
export class TcpFrameDecoder extends FrameDecoder {
  /** How many bytes may belong to the exception before them (FM-89). */
  private excess = 0;

  protected override leaveCorruption(): void {
    super.leaveCorruption();
    this.excess = 0;
  }

  protected override read(): Result {
    if (this.excess > 0) {
      const length = this.rest();
      if (length === null) return null;
      this.excess = 0;
      if (length > 0) return { length, error: { kind: "noise", length } };
    }
    return super.read();
  }

  /** How many bytes of an exception come before the next frame; null: more bytes have to come to know it. */
  private rest(): number | null {
    for (let place = 0; place < this.excess; place += 1) {
      const here = this.held.subarray(place);
      const code = here[HEADER + 1];
      if (code === undefined) return this.ended ? place : null;
      if (isHeader(here) && (code & 0x7f) !== 0) return place;
    }
    return this.excess;
  }

  private isException(): boolean {
    const code = numberAt(this.held, HEADER + 1);
    return this.sender === "server" && code > 128 && FUNCTIONS.includes(code & 0x7f);
  }

  protected readFrame(): Result {
    const { held } = this;
    if (held.length < HEADER) return this.cut(HEADER + 1);
    const [protocol, length] = [wordAt(held, 2), wordAt(held, 4)];
    const skip = length <= MAX_LENGTH ? HEADER + length : 0;
    if (protocol !== 0) return this.corrupted({ kind: "protocol", found: protocol }, skip);
    if (!isHeader(held)) return this.corrupted({ kind: "mbap_length", found: length }, skip);
    const isException = this.isException();
    const size = HEADER + (isException ? Math.min(length, EXCEPTION_LENGTH) : length);
    if (held.length < size) return this.cut(size);
    const pdu = held.subarray(HEADER + 1, size);
    const message: Frame = { transaction: wordAt(held, 0), unit: numberAt(held, HEADER), pdu };
    if (isException) this.excess = Math.abs(length - EXCEPTION_LENGTH);
    if (isException && length > EXCEPTION_LENGTH) message.wrong = wrongLength(message, length);
    return { length: size, message };
  }

  protected override search(window: Uint8Array, from: number, full: boolean): Search {
    for (let place = from; ; place += 1) {
      const here = window.subarray(place);
      if (here.length < HEADER) return full ? { length: GIVEN_UP.tcp } : null;
      if (!isHeader(here)) continue;
      if (place === from && from > 0) return { place };
      const length = rtuLength(here.subarray(HEADER), this.sender);
      if (length === "silence") continue;
      if ("needed" in length) {
        if (full) return { length: GIVEN_UP.tcp };
        if (this.ended) continue;
        return null;
      }
      if (length.known === wordAt(here, 4) + 2) return { place };
    }
  }
}

function wrongLength({ transaction = 0, unit, pdu }: Frame, found: number): ExceptionLength {
  const [code, exception] = [numberAt(pdu, 0) & 0x7f, numberAt(pdu, 1)];
  return { kind: "exception_length", transaction, unit, function: code, exception, expected: EXCEPTION_LENGTH, found };
}

/** What is in a frame. */
export function decodeFrame({ pdu, wrong }: Frame, sender: Sender): { message: Pdu } | { error: PduError | ExceptionLength } {
  return wrong === undefined ? decodePdu(pdu, sender) : { error: wrong };
}

function isHeader(bytes: Uint8Array): boolean {
  const length = wordAt(bytes, 4);
  return wordAt(bytes, 2) === 0 && length >= MIN_LENGTH && length <= MAX_LENGTH;
}

/** RTU frames (FM-73). The input ends with each silence of a serial line. */
export class RtuFrameDecoder extends FrameDecoder {
  protected readFrame(): Result {
    const { held, ended } = this;
    const length = rtuLength(held, this.sender);
    if (length === "silence") {
      if (held.length > MAX_RTU) return this.corrupted({ kind: "too_long", found: MAX_RTU + 1 });
      if (!ended) return null;
      if (held.length < MIN_RTU) return this.corrupted({ kind: "cut", expected: MIN_RTU, found: held.length });
      return this.checked(held.length);
    }
    if ("needed" in length) return this.cut(length.needed);
    const size = length.known;
    if (size > MAX_RTU) return this.corrupted({ kind: "too_long", found: size });
    if (held.length >= size) return this.checked(size);
    return ended ? this.corrupted({ kind: "cut", expected: size, found: held.length }) : null;
  }

  private checked(length: number): Result {
    const frame = this.held.subarray(0, length);
    const [expected, found] = [crcOf(frame.subarray(0, -2)), crcAtEnd(frame)];
    if (found !== expected) return this.corrupted({ kind: "crc", expected, found, length });
    return { length, message: { unit: numberAt(frame, 0), pdu: frame.subarray(1, -2) } };
  }

  /** The frame that ends first; of two that end together the longer (FM-30). */
  protected override search(window: Uint8Array, from: number, full: boolean): Search {
    let first: { place: number; end: number } | null = null;
    for (let place = from; place < window.length; place += 1) {
      const here = window.subarray(place);
      const length = rtuLength(here, this.sender);
      if (length === "silence" || "needed" in length) continue;
      const size = length.known;
      if (size > MAX_RTU || size > here.length || (first !== null && place + size >= first.end)) continue;
      if (hasRightCrc(here.subarray(0, size))) first = { place, end: place + size };
    }
    if (first !== null) return { place: first.place };
    return full ? { length: GIVEN_UP.rtu } : null;
  }
}

export function frameDecoder(sender: Sender, framing: Framing): TcpFrameDecoder | RtuFrameDecoder {
  return framing === "tcp" ? new TcpFrameDecoder(sender) : new RtuFrameDecoder(sender);
}

/** Frames and what is in them; a PDU that is wrong is an error that covers exactly the frame (FM-32). */
export class ModbusDecoder implements ItemReader<ModbusMessage, ModbusError> {
  private readonly frames: TcpFrameDecoder | RtuFrameDecoder;

  constructor(
    private readonly sender: Sender,
    framing: Framing = "tcp",
  ) {
    this.frames = frameDecoder(sender, framing);
  }

  push(bytes: Uint8Array): void {
    this.frames.push(bytes);
  }

  end(): void {
    this.frames.end();
  }

  next(): Item<ModbusMessage, ModbusError> | null {
    const item = this.frames.next();
    if (item === null || "error" in item) return item;
    const { offset, length } = item;
    const { pdu: _pdu, wrong: _wrong, ...address } = item.message;
    const decoded = decodeFrame(item.message, this.sender);
    return "error" in decoded ? { offset, length, ...decoded } : { offset, length, message: { ...address, ...decoded.message } };
  }
}
