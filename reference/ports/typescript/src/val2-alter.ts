/** VAL II ALTER: the messages of a Unimation controller and the answers of its host. The decoder is in alter-decoder.ts. */

import { Refused, boolean, fields, integer, integers, isInteger, oneOf } from "./check.js";
import { numberAt, sum } from "./stream.js";

export const DLE = 0x10;
export const STX = 0x02;
export const ETX = 0x03;

/** The most data bytes of a frame of each side (AL-9). */
export const MAX_DATA: Record<Side, number> = { robot: 30, host: 14 };
const MAX_LIST = 14;
const TRANSFORM_WORDS = 12;
const AXES = 6;

export type Side = "robot" | "host";

/** Settings that both ends have to agree upon. */
export interface Framing {
  /** The DLEs that are written before STX, and the fewest that are read as a start mark. */
  leading_dle: 1 | 2;
  /** The checksum is the two's complement of the sum. */
  negated_sum: boolean;
  /** A checksum of 10h is written twice. */
  stuffed_checksum: boolean;
  /** Bits 6 and 7 of a select byte are read as 0. */
  ignore_spare_select: boolean;
}

export const DEFAULT_FRAMING: Framing = { leading_dle: 2, negated_sum: false, stuffed_checksum: false, ignore_spare_select: false };

export interface Start {
  kind: "start";
  /** The mode of ALTER (section 4.7). */
  mode: number;
  /** The data list of the ALTER instruction, up to 14 words. */
  data: number[];
  /** What was wrong with the answer to the attempt before (AL-15); absent if nothing was. */
  error?: number;
  /** False where bit 7 of the control byte is clear (AL-13). */
  marked?: boolean;
}

export interface Motion {
  kind: "motion";
  phase: "running" | "interrupted";
  error: number;
  segment_status: number;
  segment: number;
  /** 16384 is 100 %. */
  percent: number;
  /** The columns n, o, a (16384 is 1.0) and the position in 1/32 mm (AL-18). */
  transform: number[] | null;
}

export interface End {
  kind: "end";
  error: number;
}

export type RobotMessage = Start | Motion | End;

export interface StartReply {
  kind: "start_reply";
  reply: "accept" | "repeat" | "refuse";
}

export interface Reply {
  kind: "reply";
  exception: number;
  /** X, Y, Z in 1/32 mm, RX, RY, RZ in 360/65536 degrees; null is not transmitted. */
  values: (number | null)[];
}

export type HostMessage = StartReply | Reply;
export type AlterMessage = RobotMessage | HostMessage;

export type AlterError =
  | { kind: "start_mark" | "incomplete"; offset: number; length: number }
  | { kind: "end_mark" | "control" | "length" | "start_reply" | "select"; offset: number; found: number }
  | { kind: "checksum" | "reply_length"; offset: number; expected: number; found: number }
  | { kind: "too_long"; offset: number; limit: number };

const START_REPLIES: Record<StartReply["reply"], number> = { accept: 0x00, repeat: 0x01, refuse: 0xff };

// Frames

/** The checksum of unstuffed data bytes (AL-7). */
export function checksumOf(data: Iterable<number>, framing: Framing): number {
  const total = sum(data);
  return (framing.negated_sum ? -total : total) & 0xff;
}

/** The frame of data bytes (AL-5 to AL-8). */
export function encodeFrame(data: number[], framing: Framing): Uint8Array {
  const mark = framing.leading_dle === 2 ? [DLE, DLE, STX] : [DLE, STX];
  const stuffed = data.flatMap((byte) => (byte === DLE ? [DLE, DLE] : [byte]));
  const checksum = checksumOf(data, framing);
  const check = framing.stuffed_checksum && checksum === DLE ? [DLE, DLE] : [checksum];
  return Uint8Array.of(...mark, ...stuffed, DLE, ETX, ...check);
}

// Messages

/** The frame of a message (AL-39, AL-40). */
export function encodeMessage(message: AlterMessage, side: Side, framing: Framing = DEFAULT_FRAMING): Uint8Array {
  const data = side === "robot" ? robotData(message as RobotMessage) : hostData(message as HostMessage);
  return encodeFrame(data, framing);
}

function robotData(message: RobotMessage): number[] {
  oneOf((message as Partial<RobotMessage> | null)?.kind, ["start", "motion", "end"]);
  switch (message.kind) {
    case "start": {
      const { error, marked, ...rest } = message;
      fields(rest, "kind", "mode", "data");
      if (marked !== undefined) boolean(marked);
      const data = integers(message.data, -0x8000, 0x7fff);
      if (data.length > MAX_LIST) throw new Refused("message", `a list of ${data.length} words`);
      return [0xa0 | integer(error ?? 0, 0, 7), integer(message.mode, 0, 255), ...data.flatMap(wordBytes)];
    }
    case "motion": {
      fields(message, "kind", "phase", "error", "segment_status", "segment", "percent", "transform");
      const control = oneOf(message.phase, ["running", "interrupted"]) === "running" ? 0x80 : 0xc0;
      const words = message.transform === null ? [] : integers(message.transform, -0x8000, 0x7fff, TRANSFORM_WORDS);
      return [
        control | integer(message.error, 0, 7),
        integer(message.segment_status, 0, 255),
        ...[integer(message.segment, 0, 0xffff), integer(message.percent, 0, 0xffff), ...words].flatMap(wordBytes),
      ];
    }
    case "end":
      fields(message, "kind", "error");
      return [0xe0 | integer(message.error, 0, 7)];
  }
}

function hostData(message: HostMessage): number[] {
  oneOf((message as Partial<HostMessage> | null)?.kind, ["start_reply", "reply"]);
  switch (message.kind) {
    case "start_reply":
      fields(message, "kind", "reply");
      return [START_REPLIES[oneOf(message.reply, ["accept", "repeat", "refuse"])]];
    case "reply": {
      fields(message, "kind", "exception", "values");
      const { values } = message;
      if (!Array.isArray(values) || values.length !== AXES) throw new Refused("message", "not six values");
      const sent = values.filter((value) => value !== null).map((value) => integer(value, -0x8000, 0x7fff));
      const select = values.reduce<number>((bits, value, axis) => (value === null ? bits : bits | (1 << axis)), 0);
      return [integer(message.exception, 0, 255), select, ...sent.flatMap(wordBytes)];
    }
  }
}

/** A word, low byte first (AL-10). */
function wordBytes(word: number): number[] {
  return [word & 0xff, (word >> 8) & 0xff];
}

function unsignedAt(data: Uint8Array, place: number): number {
  return numberAt(data, place) | (numberAt(data, place + 1) << 8);
}

function signedWords(data: Uint8Array): number[] {
  return Array.from({ length: data.length / 2 }, (_, index) => (unsignedAt(data, 2 * index) << 16) >> 16);
}

/** What the data bytes of a frame mean, or the error of a field (AL-29); its offset is that of the frame's first byte, 0. */
export function decodeData(data: Uint8Array, side: Side, framing: Framing): { message: AlterMessage } | { error: AlterError } {
  return side === "robot" ? decodeRobotData(data) : decodeHostData(data, framing);
}

function decodeRobotData(data: Uint8Array): { message: RobotMessage } | { error: AlterError } {
  const wrongLength = { error: { kind: "length", offset: 0, found: data.length } } as const;
  const control = data[0];
  if (control === undefined) return wrongLength;
  const [marked, type, error] = [(control & 0x80) !== 0, (control >> 5) & 3, control & 7];
  if ((control & 0x18) !== 0 || (!marked && type !== 1)) return { error: { kind: "control", offset: 0, found: control } };
  const body = data.length - 1;
  if (type === 1) {
    if (data.length % 2 !== 0) return wrongLength;
    const start: Start = { kind: "start", mode: numberAt(data, 1), data: signedWords(data.subarray(2)) };
    return { message: { ...start, ...(error === 0 ? {} : { error }), ...(marked ? {} : { marked: false }) } };
  }
  if (type === 3) return body === 0 || body === 5 || body === 29 ? { message: { kind: "end", error } } : wrongLength;
  if (body !== 5 && body !== 29) return wrongLength;
  return {
    message: {
      kind: "motion",
      phase: type === 0 ? "running" : "interrupted",
      error,
      segment_status: numberAt(data, 1),
      segment: unsignedAt(data, 2),
      percent: unsignedAt(data, 4),
      transform: body === 29 ? signedWords(data.subarray(6)) : null,
    },
  };
}

function decodeHostData(data: Uint8Array, framing: Framing): { message: HostMessage } | { error: AlterError } {
  const [first, second] = [data[0], data[1]];
  if (first === undefined) return { error: { kind: "length", offset: 0, found: 0 } };
  if (second === undefined) {
    const reply = (["accept", "repeat", "refuse"] as const).find((name) => START_REPLIES[name] === first);
    return reply === undefined
      ? { error: { kind: "start_reply", offset: 0, found: first } }
      : { message: { kind: "start_reply", reply } };
  }
  if ((second & 0xc0) !== 0 && !framing.ignore_spare_select) return { error: { kind: "select", offset: 0, found: second } };
  const selected = Array.from({ length: AXES }, (_, axis) => (second & (1 << axis)) !== 0);
  const expected = 2 + 2 * selected.filter(Boolean).length;
  if (data.length !== expected) return { error: { kind: "reply_length", offset: 0, expected, found: data.length } };
  const words = signedWords(data.subarray(2));
  return { message: { kind: "reply", exception: first, values: selected.map((bit) => (bit ? (words.shift() ?? 0) : null)) } };
}

/** Whether a message has named codes only (AL-25). */
export function hasNamedCodes(message: AlterMessage): boolean {
  switch (message.kind) {
    case "start":
      return (message.error ?? 0) <= 6 && message.mode < 32 && message.marked === undefined;
    case "motion":
      return message.error <= 6 && isInteger(message.segment_status, 1, 13);
    case "end":
      return message.error <= 6;
    case "start_reply":
      return true;
    case "reply":
      return [0, 253, 254].includes(message.exception);
  }
}

// Words

/** Words of a millimetre (section 4.5). */
const WORDS_PER_MM = 32;

/** The word of a length in mm; refuses what does not fit (AL-41). */
export function wordOfMm(mm: number): number {
  return word(mm * WORDS_PER_MM);
}

/** The word of an angle in degrees; refuses what does not fit. */
export function wordOfDegrees(degrees: number): number {
  return word((degrees * 65536) / 360);
}

/** The word of a length in mm, or the nearest limit; 0 for no number. */
export function nearestWordOfMm(mm: number): number {
  return nearestWord(mm * WORDS_PER_MM);
}

/** The word of an angle in degrees, or the nearest limit; 0 for no number. */
export function nearestWordOfDegrees(degrees: number): number {
  return nearestWord((degrees * 65536) / 360);
}

/** Halves are rounded away from zero. */
function rounded(value: number): number {
  return Math.sign(value) * Math.round(Math.abs(value)) + 0;
}

function word(value: number): number {
  return integer(rounded(value), -0x8000, 0x7fff, "word");
}

function nearestWord(value: number): number {
  return Number.isNaN(value) ? 0 : Math.min(Math.max(rounded(value), -0x8000), 0x7fff);
}
