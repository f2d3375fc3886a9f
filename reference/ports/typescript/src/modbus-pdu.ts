/** Modbus PDUs: what a request and a reply say (FM-11 to FM-16, FM-32 to FM-36). Words are sent high byte first (FM-7). */

import { Refused, boolean, fields, integer, integers } from "./check.js";
import { numberAt } from "./stream.js";

/** The most bytes of a PDU (FM-6). */
export const MAX_PDU = 253;

export type Sender = "client" | "server";

/** What a reply repeats of its request, and raw bytes. */
export type Single =
  | { function: 5; address: number; value: boolean }
  | { function: 6; address: number; value: number }
  | { function: 22; address: number; and: number; or: number }
  | RawPdu;

export type Request =
  | { function: 1 | 2 | 3 | 4; address: number; quantity: number }
  | { function: 15; address: number; values: boolean[] }
  | { function: 16; address: number; values: number[] }
  | { function: 23; address: number; quantity: number; write_address: number; values: number[] }
  | Single;

export type Reply =
  | { function: 1 | 2; bits: boolean[] }
  | { function: 3 | 4 | 23; registers: number[] }
  | { function: 15 | 16; address: number; quantity: number }
  | ExceptionReply
  | Single;

/** A function that the table lacks, with raw bytes. */
export interface RawPdu {
  function: number;
  data: number[];
}

/** The function is that of the request. */
export interface ExceptionReply {
  function: number;
  exception: number;
}

export type Pdu = Request | Reply;

export type PduError =
  | { kind: "function" | "coil_value"; found: number }
  | { kind: "pdu_length" | "byte_count"; function: number; expected: number; found: number }
  | { kind: "quantity"; function: number; found: number; max: number }
  | { kind: "reply_byte_count"; function: number; found: number };

const COIL_ON = 0xff00;
const MAX_REPLY_BYTES = 250;

/** The most that a function can read or write at once (section 4.1). */
export const MAX_QUANTITY = { 1: 2000, 2: 2000, 3: 125, 4: 125, 15: 1968, 16: 123, 23: 125 } as const;
export const MAX_WRITE_OF_23 = 121;

// Encoding

/** Collects the bytes of a PDU, whose words are checked. */
class PduWriter {
  readonly bytes: number[];

  constructor(code: number) {
    this.bytes = [code];
  }

  byte(value: number): this {
    this.bytes.push(value);
    return this;
  }

  words(...values: number[]): this {
    for (const value of integers(values, 0, 0xffff)) this.bytes.push(value >> 8, value & 0xff);
    return this;
  }

  /** A byte count, and the bits after it (FM-8). */
  bits(values: readonly boolean[]): this {
    const packed = packBits(values);
    this.bytes.push(packed.length, ...packed);
    return this;
  }

  /** A byte count, and the registers after it. */
  registers(values: number[]): this {
    this.bytes.push(2 * values.length);
    return this.words(...values);
  }
}

/** Bits, eight to a byte, the first in bit 0 (FM-8). */
export function packBits(bits: readonly boolean[]): Uint8Array {
  const packed = new Uint8Array(Math.ceil(bits.length / 8));
  bits.forEach((bit, index) => {
    if (bit) packed[index >> 3] = numberAt(packed, index >> 3) | (1 << (index & 7));
  });
  return packed;
}

/** A bit is true, false, 1 or 0. */
function bit(value: unknown): boolean {
  return value === 1 || (value !== 0 && boolean(value));
}

function list<T>(values: T[]): T[] {
  if (!Array.isArray(values)) throw new Refused("message", "no list");
  return values;
}

function coil(value: unknown): number {
  return bit(value) ? COIL_ON : 0;
}

/** Refuses a number of values that the function does not take, and a run beyond the last address (FM-36). */
function run(address: number, quantity: number, max: number): void {
  integer(quantity, 1, max, "quantity");
  integer(address, 0, 0x10000 - quantity, "address");
}

/** The PDU of a request. */
export function encodeRequest(request: Request): number[] {
  const code: number = request.function;
  const pdu = new PduWriter(code);
  switch (code) {
    case 1:
    case 2:
    case 3:
    case 4: {
      const { address, quantity } = request as { address: number; quantity: number };
      fields(request, "function", "address", "quantity");
      run(address, quantity, MAX_QUANTITY[code]);
      return pdu.words(address, quantity).bytes;
    }
    case 15: {
      const { address, values } = request as { address: number; values: unknown[] };
      fields(request, "function", "address", "values");
      const bits = list(values).map(bit);
      run(address, bits.length, MAX_QUANTITY[code]);
      return pdu.words(address, bits.length).bits(bits).bytes;
    }
    case 16: {
      const { address, values } = request as { address: number; values: number[] };
      fields(request, "function", "address", "values");
      const registers = list(values);
      run(address, registers.length, MAX_QUANTITY[code]);
      return pdu.words(address, registers.length).registers(registers).bytes;
    }
    case 23: {
      const { address, quantity, write_address, values } = request as Extract<Request, { write_address: number }>;
      fields(request, "function", "address", "quantity", "write_address", "values");
      const registers = list(values);
      run(address, quantity, MAX_QUANTITY[code]);
      run(write_address, registers.length, MAX_WRITE_OF_23);
      return pdu.words(address, quantity, write_address, registers.length).registers(registers).bytes;
    }
    default:
      return encodeSingle(request as Single, pdu);
  }
}

/** The PDU of a reply. */
export function encodeReply(reply: Reply): number[] {
  const code: number = reply.function;
  if ("exception" in reply) {
    fields(reply, "function", "exception");
    return [0x80 | integer(code, 1, 127, "function"), integer(reply.exception, 0, 255)];
  }
  const pdu = new PduWriter(code);
  switch (code) {
    case 1:
    case 2: {
      fields(reply, "function", "bits");
      const bits = list((reply as { bits: unknown[] }).bits).map(bit);
      integer(bits.length, 1, MAX_QUANTITY[code], "quantity");
      return pdu.bits(bits).bytes;
    }
    case 3:
    case 4:
    case 23: {
      fields(reply, "function", "registers");
      const registers = list((reply as { registers: number[] }).registers);
      integer(registers.length, 1, MAX_QUANTITY[code], "quantity");
      return pdu.registers(registers).bytes;
    }
    case 15:
    case 16: {
      const { address, quantity } = reply as { address: number; quantity: number };
      fields(reply, "function", "address", "quantity");
      run(address, quantity, MAX_QUANTITY[code]);
      return pdu.words(address, quantity).bytes;
    }
    default:
      return encodeSingle(reply as Single, pdu);
  }
}

/** What requests and replies write in the same way: single values, masks and raw bytes. */
function encodeSingle(message: Single, pdu: PduWriter): number[] {
  switch (message.function) {
    case 5:
    case 6: {
      const { address, value } = message as { address: number; value: unknown };
      fields(message, "function", "address", "value");
      return pdu.words(address, message.function === 5 ? coil(value) : (value as number)).bytes;
    }
    case 22: {
      const { address, and, or } = message as { address: number; and: number; or: number };
      fields(message, "function", "address", "and", "or");
      return pdu.words(address, and, or).bytes;
    }
    default: {
      fields(message, "function", "data");
      integer(message.function, 1, 127, "function");
      const data = integers((message as RawPdu).data, 0, 255);
      if (data.length + 1 > MAX_PDU) throw new Refused("pdu_length", `a PDU of ${data.length + 1} bytes`);
      for (const byte of data) pdu.byte(byte);
      return pdu.bytes;
    }
  }
}

// Decoding

/** The error of a PDU, as it is thrown within its decoder. */
class PduFault extends Error {
  constructor(readonly error: PduError) {
    super(error.kind);
  }
}

/** Reads a PDU from left to right. */
class PduReader {
  /** The function code with bit 7. */
  readonly code: number;
  private at = 1;

  constructor(readonly bytes: Uint8Array) {
    this.code = numberAt(bytes, 0);
  }

  /** The PDU has exactly so many bytes. */
  exactly(expected: number): void {
    if (this.bytes.length !== expected) this.wrongLength(expected);
  }

  /** The PDU has at least so many bytes. */
  atLeast(expected: number): void {
    if (this.bytes.length < expected) this.wrongLength(expected);
  }

  byte(): number {
    this.at += 1;
    return numberAt(this.bytes, this.at - 1);
  }

  word(): number {
    return (this.byte() << 8) | this.byte();
  }

  quantity(max: number): number {
    return this.inRange(this.word(), max);
  }

  inRange(found: number, max: number): number {
    if (found < 1 || found > max) throw new PduFault({ kind: "quantity", function: this.code, found, max });
    return found;
  }

  coil(): boolean {
    const found = this.word();
    if (found !== COIL_ON && found !== 0) throw new PduFault({ kind: "coil_value", found });
    return found === COIL_ON;
  }

  /** The byte count of a request, and exactly so many bytes after it (FM-12). */
  requestData(expected: number): void {
    this.atLeast(this.at + 1);
    const found = this.byte();
    if (found !== expected) throw new PduFault({ kind: "byte_count", function: this.code, expected, found });
    this.exactly(this.at + found);
  }

  /** The byte count of a reply, and exactly so many bytes after it (FM-13). */
  replyData(even: boolean): void {
    this.atLeast(2);
    const found = this.byte();
    if (found < 1 || found > MAX_REPLY_BYTES || (even && found % 2 !== 0)) {
      throw new PduFault({ kind: "reply_byte_count", function: this.code, found });
    }
    this.exactly(this.at + found);
  }

  /** All registers that are left. */
  registers(): number[] {
    return Array.from({ length: (this.bytes.length - this.at) / 2 }, () => this.word());
  }

  /** So many bits, or all that are left. */
  bits(count = 8 * (this.bytes.length - this.at)): boolean[] {
    return Array.from({ length: count }, (_, index) => ((numberAt(this.bytes, this.at + (index >> 3)) >> (index & 7)) & 1) === 1);
  }

  /** All bytes behind the function. */
  raw(): number[] {
    return [...this.bytes.subarray(1)];
  }

  private wrongLength(expected: number): never {
    throw new PduFault({ kind: "pdu_length", function: this.code, expected, found: this.bytes.length });
  }
}

export function decodePdu(bytes: Uint8Array, sender: Sender): { message: Pdu } | { error: PduError } {
  try {
    const reader = new PduReader(bytes);
    return { message: sender === "client" ? readRequest(reader) : readReply(reader) };
  } catch (fault) {
    if (fault instanceof PduFault) return { error: fault.error };
    throw fault;
  }
}

function readRequest(reader: PduReader): Request {
  const { code } = reader;
  if (code === 0 || code > 127) throw new PduFault({ kind: "function", found: code });
  switch (code) {
    case 1:
    case 2:
    case 3:
    case 4:
      reader.exactly(5);
      return { function: code, address: reader.word(), quantity: reader.quantity(MAX_QUANTITY[code]) };
    case 15:
    case 16: {
      reader.atLeast(3);
      const address = reader.word();
      reader.atLeast(5);
      const quantity = reader.quantity(MAX_QUANTITY[code]);
      reader.requestData(code === 15 ? Math.ceil(quantity / 8) : 2 * quantity);
      return code === 15 ? { function: code, address, values: reader.bits(quantity) } : { function: code, address, values: reader.registers() };
    }
    case 23: {
      reader.atLeast(3);
      const address = reader.word();
      reader.atLeast(5);
      const quantityFound = reader.word();
      reader.atLeast(7);
      const write_address = reader.word();
      const quantity = reader.inRange(quantityFound, MAX_QUANTITY[code]);
      reader.atLeast(9);
      reader.requestData(2 * reader.quantity(MAX_WRITE_OF_23));
      return { function: code, address, quantity, write_address, values: reader.registers() };
    }
  }
  return readSingle(reader);
}

function readReply(reader: PduReader): Reply {
  const { code } = reader;
  if (code === 0 || code === 128) throw new PduFault({ kind: "function", found: code });
  if ((code & 0x80) !== 0) {
    reader.exactly(2);
    return { function: code & 0x7f, exception: reader.byte() };
  }
  switch (code) {
    case 1:
    case 2:
      reader.replyData(false);
      return { function: code, bits: reader.bits() };
    case 3:
    case 4:
    case 23:
      reader.replyData(true);
      return { function: code, registers: reader.registers() };
    case 15:
    case 16:
      reader.exactly(5);
      return { function: code, address: reader.word(), quantity: reader.quantity(MAX_QUANTITY[code]) };
  }
  return readSingle(reader);
}

function readSingle(reader: PduReader): Single {
  const { code } = reader;
  switch (code) {
    case 5:
      reader.exactly(5);
      return { function: code, address: reader.word(), value: reader.coil() };
    case 6:
      reader.exactly(5);
      return { function: code, address: reader.word(), value: reader.word() };
    case 22:
      reader.exactly(7);
      return { function: code, address: reader.word(), and: reader.word(), or: reader.word() };
  }
  return { function: code, data: reader.raw() };
}
