/** Command words and error codes of the laser link (LE-18 to LE-25). */

import { isInteger } from "../check.js";
import type { LaserFrame, LaserItem } from "../laser-eb90.js";
import { require } from "./session.js";

export type CommandClass = "interpreted" | "immediate" | "query";
export type ErrorCode = "bad_checksum" | "bad_frame" | "unknown_command" | "bad_batch" | "bad_parameters" | "queue_full";

export interface Words {
  /** Up to 32 ranges of command words, both ends included. */
  commands: { first: number; last: number; class: CommandClass }[];
  errors: Record<ErrorCode, number>;
}

export const DEFAULT_WORDS: Words = {
  commands: [
    { first: 0x0100, last: 0x01ff, class: "interpreted" },
    { first: 0x0200, last: 0x02ff, class: "immediate" },
    { first: 0x0300, last: 0x03ff, class: "query" },
  ],
  errors: {
    bad_checksum: 0xe001,
    bad_frame: 0xe002,
    unknown_command: 0xe003,
    bad_batch: 0xe004,
    bad_parameters: 0xe005,
    queue_full: 0xe006,
  },
};

const MOST_RANGES = 32;
/** The most interpreted instructions in a frame. */
export const MOST_BATCH = 255;

/** Words with what is not given at its default. */
export interface GivenWords {
  commands?: Words["commands"];
  errors?: Partial<Words["errors"]>;
}

/** The words of a configuration (LE-20). */
export class WordTable {
  private readonly words: Words;

  constructor(given: GivenWords = {}) {
    this.words = { commands: given.commands ?? DEFAULT_WORDS.commands, errors: { ...DEFAULT_WORDS.errors, ...given.errors } };
    const { commands, errors } = this.words;
    require(commands.length <= MOST_RANGES, "more than 32 ranges of command words");
    require(commands.every(({ first, last }) => isInteger(first, 0, 0xffff) && isInteger(last, 0, 0xffff)), "a command word is no number of 16 bits");
    const overlap = commands.some((one, index) => commands.slice(index + 1).some((other) => one.first <= other.last && other.first <= one.last));
    require(!overlap, "a command word of two classes");
    const codes = Object.values(errors);
    require(new Set(codes).size === codes.length, "two error codes are equal");
    require(codes.every((code) => isInteger(code, 0, 0xffff) && this.classOf(code) === null), "an error code is a command word");
  }

  /** The class of a command word; null, if it is none. */
  classOf(word: number): CommandClass | null {
    return this.words.commands.find(({ first, last }) => word >= first && word <= last)?.class ?? null;
  }

  /** The error code of a word; null, if it is none. */
  errorOf(word: number): ErrorCode | null {
    const found = Object.entries(this.words.errors).find(([, code]) => code === word);
    return found === undefined ? null : (found[0] as ErrorCode);
  }

  codeOf(error: ErrorCode): number {
    return this.words.errors[error];
  }
}

/** The word that an item is: one short, read as unsigned (LE-18); null, if it is none. */
export function wordOf(item: LaserItem | undefined): number | null {
  if (item === undefined || !("i16" in item) || item.i16.length !== 1) return null;
  return (item.i16[0] ?? 0) & 0xffff;
}

/** The item of a word, whose value is signed. */
export function wordItem(word: number): LaserItem {
  return { i16: [(word << 16) >> 16] };
}

/** A word and the items after it, its parameters (LE-21). */
export interface Instruction {
  word: number;
  parameters: LaserItem[];
}

/** The first word of a frame, and what follows it; null, if the first item is no word (LE-19). */
export function instructionOf(frame: LaserFrame): Instruction | null {
  const [first, ...parameters] = frame.items;
  const word = wordOf(first);
  return word === null ? null : { word, parameters };
}

/** Whether a float of the parameters is NaN or infinite. */
export function hasInfinite(parameters: LaserItem[]): boolean {
  return parameters.some((item) => "f32" in item && !item.f32.every((value) => Number.isFinite(value)));
}
