/** laser-eb90: the frames between a host and the controller of a laser machining robot. */

import { Refused, fields, integer, integers } from "./check.js";
import { Decoder, numberAt, concat, latin1, sum, type Found } from "./stream.js";

/** The most bytes of an unstuffed payload (LE-12). */
export const MAX_PAYLOAD = 512;
/** The longest frame, which a receiver has to hold (LE-14). */
export const MAX_FRAME = 1032;
/** The shortest frame that there can be (LE-14). */
export const MIN_FRAME = 8;

const HEAD = [0xeb, 0x90, 0x82] as const;
const FLAG = 0xf0;
const ESCAPE = 0x90;
const TAIL_PRINTED = 0x82;
const TAIL_ETX = 0x83;
const MAX_VALUES = 255;

export type Type = "f32" | "i16" | "u8" | "char";
const TYPES: readonly Type[] = ["f32", "i16", "u8", "char"];
const SIZES: Record<Type, number> = { f32: 4, i16: 2, u8: 1, char: 1 };

/** What both ends of a line have to agree upon (LE-101). */
export interface Profile {
  tail: "printed" | "etx" | "either";
  flag: "separate" | "first_tag";
  tags: Record<Type, number>;
  checksum: "u8" | "u16_le" | "u16_be";
  checksum_negated: boolean;
  checksum_with_flag: boolean;
  byte_order: "little" | "big";
}

export const DEFAULT_PROFILE: Profile = {
  tail: "printed",
  flag: "separate",
  tags: { f32: 0xf0, i16: 0xf1, u8: 0xf2, char: 0xf3 },
  checksum: "u8",
  checksum_negated: false,
  checksum_with_flag: false,
  byte_order: "little",
};

/** Values of one type, up to 255 of them; the characters of `char` are U+0000 to U+00FF. */
export type LaserItem = { f32: number[] } | { i16: number[] } | { u8: number[] } | { char: string };

export interface LaserFrame {
  items: LaserItem[];
}

export type LaserError =
  | { kind: "no_head"; skipped: number }
  | { kind: "flag"; offset: number; expected: number; found: number }
  | { kind: "stuffing"; offset: number; found: number }
  | { kind: "too_long"; offset: number; limit: number }
  | { kind: "checksum"; offset: number; expected: number; found: number }
  | { kind: "tag"; offset: number; found: number }
  | { kind: "item"; offset: number; needed: number; found: number }
  | { kind: "incomplete"; held: number };

/** A profile with the fields that are not given at their defaults; refuses tags that are not four different bytes (LE-16). */
export function profileOf(given: Partial<Profile>): Profile {
  const profile = { ...DEFAULT_PROFILE, ...given };
  const tags = TYPES.map((type) => integer(profile.tags[type], 0, 255, "tags"));
  if (new Set(tags).size !== TYPES.length) throw new Refused("tags");
  return profile;
}

/** The bytes of a frame (LE-36, LE-37). */
export function encodeFrame(frame: LaserFrame, profile: Profile = DEFAULT_PROFILE): Uint8Array {
  const payload = encodePayload(frame, profile);
  const stuffed = [...payload].flatMap((byte) => (byte === ESCAPE ? [ESCAPE, ESCAPE] : [byte]));
  const tail = profile.tail === "etx" ? TAIL_ETX : TAIL_PRINTED;
  const flag = profile.flag === "separate" ? [FLAG] : [];
  return Uint8Array.of(...HEAD, ...flag, ...stuffed, ESCAPE, tail, ...writeCheck(checkOf(payload, profile), profile));
}

/** The unstuffed payload of a frame. */
export function encodePayload(frame: LaserFrame, profile: Profile): Uint8Array {
  fields(frame, "items");
  if (!Array.isArray(frame.items)) throw new Refused("message", "items is no list");
  if (frame.items.length === 0) throw new Refused("empty");
  const payload = concat(...frame.items.map((item) => encodeItem(item, profile)));
  if (payload.length > MAX_PAYLOAD) throw new Refused("too_long", `a payload of ${payload.length} bytes`);
  return payload;
}

function encodeItem(item: LaserItem, profile: Profile): Uint8Array {
  const type = typeOf(item);
  fields(item, type);
  const values = valuesOf(item);
  if (values.length > MAX_VALUES) throw new Refused("message", `an item of ${values.length} values`);
  const size = SIZES[type];
  const bytes = new Uint8Array(2 + values.length * size);
  bytes.set([profile.tags[type], values.length]);
  const view = new DataView(bytes.buffer);
  const little = profile.byte_order === "little";
  values.forEach((value, index) => {
    const place = 2 + index * size;
    if (type === "f32") view.setFloat32(place, value, little);
    else if (type === "i16") view.setInt16(place, value, little);
    else view.setUint8(place, value);
  });
  return bytes;
}

export function typeOf(item: LaserItem): Type {
  if (typeof item !== "object" || item === null) throw new Refused("message", "no item");
  const type = TYPES.find((name) => name in item);
  if (type === undefined) throw new Refused("message", "an item without a type");
  return type;
}

/** The values of an item as numbers, checked. */
function valuesOf(item: LaserItem): number[] {
  if ("i16" in item) return integers(item.i16, -0x8000, 0x7fff);
  if ("u8" in item) return integers(item.u8, 0, 255);
  if ("char" in item) {
    if (typeof item.char !== "string") throw new Refused("message", "char is no text");
    return [...item.char].map((character) => integer(character.codePointAt(0), 0, 255));
  }
  if (!Array.isArray(item.f32)) throw new Refused("message", "f32 is no list");
  return item.f32.map((value: unknown) => {
    if (typeof value !== "number" || !Number.isFinite(Math.fround(value))) throw new Refused("message", "a float that is not finite");
    return value;
  });
}

/** The check of an unstuffed payload (LE-13). */
function checkOf(payload: Uint8Array, profile: Profile): number {
  let total = sum(payload);
  if (profile.checksum_with_flag && profile.flag === "separate") total += FLAG;
  if (profile.checksum_negated) total = -total;
  return total & (profile.checksum === "u8" ? 0xff : 0xffff);
}

function checkSize(profile: Profile): number {
  return profile.checksum === "u8" ? 1 : 2;
}

function writeCheck(check: number, profile: Profile): number[] {
  const [low, high] = [check & 0xff, check >> 8];
  return profile.checksum === "u8" ? [low] : profile.checksum === "u16_le" ? [low, high] : [high, low];
}

function readCheck(bytes: Uint8Array, profile: Profile): number {
  const [first, second] = [numberAt(bytes, 0), numberAt(bytes, 1)];
  return profile.checksum === "u8" ? first : profile.checksum === "u16_le" ? first | (second << 8) : (first << 8) | second;
}

/** The place of the first head in bytes, whole or cut off by their end; that end, where there is none. */
function findHead(bytes: Uint8Array, from = 0): number {
  let place = from;
  while (!HEAD.every((byte, index) => place + index >= bytes.length || bytes[place + index] === byte)) place += 1;
  return place;
}

/** The decoder of either direction (LE-27 to LE-35). */
export class LaserDecoder extends Decoder<LaserFrame, LaserError> {
  private readonly types: Map<number, Type>;

  constructor(private readonly profile: Profile = DEFAULT_PROFILE) {
    super();
    this.types = new Map(TYPES.map((type) => [profile.tags[type], type]));
  }

  /** Whether what is held begins with a whole head. */
  get begun(): boolean {
    return HEAD.every((byte, index) => this.held[index] === byte);
  }

  /** Drops what is held beyond so many bytes. */
  keep(most: number): void {
    this.held = this.held.subarray(0, most);
  }

  protected read(): Found<LaserFrame, LaserError> | null {
    const { held } = this;
    const head = findHead(held);
    if (head > 0) return this.noHead(head);
    let place = HEAD.length;
    if (this.profile.flag === "separate") {
      const found = held[place];
      if (found === undefined) return this.more();
      if (found !== FLAG) return this.fail({ kind: "flag", offset: place, expected: FLAG, found }, place + 1);
      place += 1;
    }
    const first = held[place];
    if (first === undefined) return this.more();
    if (!this.types.has(first)) return this.fail({ kind: "tag", offset: 0, found: first }, place + 1);
    return this.readPayload(place);
  }

  /** Bytes before a head (LE-32). */
  private noHead(head: number): Found<LaserFrame, LaserError> | null {
    const whole = head + HEAD.length <= this.held.length;
    if (head >= MAX_PAYLOAD) return { length: MAX_PAYLOAD, error: { kind: "no_head", skipped: MAX_PAYLOAD } };
    if (whole) return { length: head, error: { kind: "no_head", skipped: head } };
    return this.more();
  }

  /** Takes the stuffing out of the payload, up to the tail (LE-9 to LE-12). */
  private readPayload(start: number): Found<LaserFrame, LaserError> | null {
    const { held } = this;
    const payload: number[] = [];
    let place = start;
    for (;;) {
      const byte = held[place];
      if (byte === undefined) return this.more();
      if (byte === ESCAPE) {
        const second = held[place + 1];
        if (second === undefined) return this.more();
        if (this.endsPayload(second)) break;
        if (second !== ESCAPE) return this.fail({ kind: "stuffing", offset: place + 1, found: second }, place + 2);
        place += 1;
      }
      if (payload.length === MAX_PAYLOAD) return this.fail({ kind: "too_long", offset: place, limit: MAX_PAYLOAD }, place + 1);
      payload.push(byte);
      place += 1;
    }
    return this.readCheckAndItems(Uint8Array.from(payload), place + 2);
  }

  private endsPayload(second: number): boolean {
    const { tail } = this.profile;
    return (second === TAIL_PRINTED && tail !== "etx") || (second === TAIL_ETX && tail !== "printed");
  }

  private readCheckAndItems(payload: Uint8Array, place: number): Found<LaserFrame, LaserError> | null {
    const end = place + checkSize(this.profile);
    if (this.held.length < end) return this.more();
    const found = readCheck(this.held.subarray(place, end), this.profile);
    const expected = checkOf(payload, this.profile);
    if (found !== expected) return this.fail({ kind: "checksum", offset: place, expected, found }, end);
    const items: LaserItem[] = [];
    for (let at = 0; at < payload.length; ) {
      const tag = numberAt(payload, at);
      const type = this.types.get(tag);
      if (type === undefined) return this.fail({ kind: "tag", offset: at, found: tag }, end);
      const left = payload.length - at;
      const needed = 2 + (payload[at + 1] ?? 0) * SIZES[type];
      if (left < needed) return this.fail({ kind: "item", offset: at, needed, found: left }, end);
      items.push(this.readItem(type, payload.subarray(at + 2, at + needed)));
      at += needed;
    }
    return { length: end, message: { items } };
  }

  private readItem(type: Type, bytes: Uint8Array): LaserItem {
    const little = this.profile.byte_order === "little";
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    const places = Array.from({ length: bytes.length / SIZES[type] }, (_, index) => index * SIZES[type]);
    switch (type) {
      case "f32":
        return { f32: places.map((place) => view.getFloat32(place, little)) };
      case "i16":
        return { i16: places.map((place) => view.getInt16(place, little)) };
      case "u8":
        return { u8: [...bytes] };
      case "char":
        return { char: latin1(bytes) };
    }
  }

  /** An error goes on at the first head behind its own, among the bytes that were examined (LE-30). */
  private fail(error: LaserError, examined: number): Found<LaserFrame, LaserError> {
    return { length: findHead(this.held.subarray(0, examined), HEAD.length), error };
  }

  private more(): Found<LaserFrame, LaserError> | null {
    const length = this.held.length;
    return this.ended && length > 0 ? { length, error: { kind: "incomplete", held: length } } : null;
  }
}
