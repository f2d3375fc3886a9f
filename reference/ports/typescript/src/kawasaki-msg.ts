/** kawasaki-msg: the text messages between a Kawasaki robot and a PC. What they mean is in kawasaki-dialect.ts. */

import { Refused } from "./check.js";
import { Decoder, numberAt, bytesOf, latin1, type Found } from "./stream.js";

/** The most bytes of a message, its marks included (KM-14). */
export const MAX_MESSAGE = 4096;

const START = 0x3c; // <
const END = 0x3e; // >
const HASH = 0x23;
const INT32 = 0x8000_0000;

/** `ascii`: a byte above 7Fh is no character; `latin1`: every byte is one (KM-16). */
export type Charset = "ascii" | "latin1";

export const LAST_CHARACTER: Readonly<Record<Charset, string>> = { ascii: "\x7f", latin1: "\xff" };

/** Every value exactly as it is transmitted. */
export interface Message {
  name: string;
  /** The values between the name and the length (KM-12). */
  header: string[];
  fields: string[];
}

export type MessageError =
  | { kind: "garbage"; offset: number; length: number }
  | { kind: "mark" | "not_ascii" | "no_end_mark"; offset: number; found: number }
  | { kind: "no_length" | "no_name"; offset: number }
  | { kind: "too_long"; offset: number; limit: number }
  | { kind: "length"; offset: number; expected: number; found: number }
  | { kind: "incomplete"; offset: number; found: number };

/** A number on the wire: 32 bits with a sign, zeros before it and blanks around it allowed (KM-17); null if it is none. */
export function readNumber(text: string): number | null {
  if (!/^[ \t\n\f\r]*-?[0-9]+[ \t\n\f\r]*$/.test(text)) return null;
  const value = Number(text);
  return value >= -INT32 && value < INT32 ? value + 0 : null;
}

/** The bytes of a message (KM-39, KM-41). */
export function encodeMessage(message: Message, charset: Charset = "ascii"): Uint8Array {
  const { name, header } = message;
  if (![[name], header, message.fields].every((list) => Array.isArray(list) && list.every((value) => typeof value === "string"))) {
    throw new Refused("message", "a value is no text");
  }
  if (name === "") throw new Refused("no_name");
  const data = message.fields.join("$");
  const dataLength = [...data].length;
  const text = `<${[name, ...header, dataLength].join("$")}#${data}#>`;
  const length = [...text].length;
  if (length > MAX_MESSAGE) throw new Refused("too_long", `${length} bytes`);
  for (const character of [name, ...header, ...message.fields].join("")) {
    if (character > LAST_CHARACTER[charset]) throw new Refused("character", `the character ${character}`);
    if ("<>$#".includes(character)) throw new Refused("forbidden", `the mark ${character}`);
  }
  return bytesOf(text);
}

/** The decoder of either side (KM-30 to KM-34). What was looked at is not looked at again, however slowly the bytes of a message come. */
export class MessageDecoder extends Decoder<Message, MessageError> {
  /** The error that is returned when the next start mark has come (KM-31). */
  private failed: MessageError | null = null;
  /** How many bytes of the message were looked at: its header, or its data part, ends behind them. */
  private looked = 1;
  private data: { begin: number; length: number } | null = null;
  private readonly last: number;

  constructor(charset: Charset = "ascii") {
    super();
    this.last = LAST_CHARACTER[charset].charCodeAt(0);
  }

  /** Whether the beginning of a message is held in which nothing is wrong so far: what is corrupt is not held. */
  get half(): boolean {
    return this.held.length > 0;
  }

  override discard(): void {
    super.discard();
    this.failed = null;
    this.restart();
  }

  /** Nothing is known of the message that the held bytes begin with. */
  private restart(): void {
    this.looked = 1;
    this.data = null;
  }

  protected read(): Found<Message, MessageError> | null {
    if (this.failed !== null) return this.skip(this.failed);
    if (this.pending === 0) return null;
    if (this.dropped > 0 || this.held[0] !== START) return this.garbage();
    const message = this.held.subarray(0, MAX_MESSAGE);
    const read = this.readMessage(message) ?? this.unfinished(message.length);
    if (read === null) return null;
    this.restart();
    if (!("kind" in read)) return read;
    this.failed = { ...read, offset: read.offset + this.position };
    return this.skip(this.failed);
  }

  private garbage(): Found<Message, MessageError> | null {
    const start = this.held.indexOf(START);
    const length = this.dropped + (start < 0 ? this.held.length : start);
    if (start >= 0 || this.ended) return { length, error: { kind: "garbage", offset: this.position, length } };
    this.drop(this.held.length);
    return null;
  }

  /** A message or an error; null, if more bytes are needed. */
  private readMessage(m: Uint8Array): Found<Message, MessageError> | MessageError | null {
    if (this.data === null) {
      const hash = this.hash(m);
      if (typeof hash !== "number") return hash;
      const length = readLength(latin1(m.subarray(1, hash)), hash);
      if (typeof length !== "number") return length;
      this.looked = hash + 1;
      this.data = { begin: hash + 1, length };
    }
    const { begin, length } = this.data;
    const hash = this.hash(m);
    if (typeof hash !== "number") return hash;
    if (hash - begin !== length) return { kind: "length", offset: begin, expected: length, found: hash - begin };
    const end = m[hash + 1];
    if (end === undefined) return null;
    if (end !== END) return { kind: end === START ? "mark" : "no_end_mark", offset: hash + 1, found: end };
    const [name = "", ...header] = latin1(m.subarray(1, begin)).split("$").slice(0, -1); // the last one is the length
    const data = latin1(m.subarray(begin, hash));
    return { length: hash + 2, message: { name, header, fields: data === "" ? [] : data.split("$") } };
  }

  /** Where the next `#` is; another mark, or what is no character, is an error; null, if it has not come. */
  private hash(m: Uint8Array): number | MessageError | null {
    for (; this.looked < m.length; this.looked += 1) {
      const found = numberAt(m, this.looked);
      if (found === HASH) return this.looked;
      if (found === START || found === END) return { kind: "mark", offset: this.looked, found };
      if (found > this.last) return { kind: "not_ascii", offset: this.looked, found };
    }
    return null;
  }

  /** What is wrong with a message that is not whole, if anything is. */
  private unfinished(length: number): MessageError | null {
    if (length === MAX_MESSAGE) return { kind: "too_long", offset: 0, limit: MAX_MESSAGE };
    return this.ended ? { kind: "incomplete", offset: 0, found: length } : null;
  }

  /** Goes on at the next start mark behind the first byte of the message. */
  private skip(error: MessageError): Found<Message, MessageError> | null {
    const start = this.held.indexOf(START, this.dropped > 0 ? 0 : 1);
    if (start >= 0 || this.ended) {
      this.failed = null;
      return { length: this.dropped + (start < 0 ? this.held.length : start), error };
    }
    this.drop(this.held.length);
    return null;
  }
}

/** The length of the data part, which a header ends with; `hash` is the place behind the header. */
function readLength(header: string, hash: number): number | MessageError {
  const dollar = header.lastIndexOf("$");
  if (dollar < 0) return { kind: "no_length", offset: hash };
  const length = readNumber(header.slice(dollar + 1));
  if (length === null || length < 0) return { kind: "no_length", offset: dollar + 2 };
  if (header.startsWith("$")) return { kind: "no_name", offset: 1 };
  if (hash + 1 + length + 2 > MAX_MESSAGE) return { kind: "too_long", offset: 1, limit: MAX_MESSAGE };
  return length;
}
