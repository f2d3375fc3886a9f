/** What the registers and addresses of a FANUC controller mean (sections 4.2 to 4.4 of fanuc-hmi-modbus). */

import { Refused, integer, isInteger } from "./check.js";
import { bytesOf, numberAt } from "./stream.js";

export type Table = "coils" | "discrete_inputs" | "input_registers" | "holding_registers";

export interface Place {
  table: Table;
  /** PDU address: one less than the number that the controller shows. */
  address: number;
}

interface Row {
  name: string;
  first: number;
  last: number;
  table: Table;
  address: number;
}

/** The signals: name, first and last number, table, first PDU address (section 4.2, FM-17). */
const ROWS: readonly Row[] = (
  [
    ["di", 1, 10000, "discrete_inputs", 0],
    ["ri", 1, 10000, "discrete_inputs", 10000],
    ["ui", 1, 1000, "discrete_inputs", 20000],
    ["uo", 1, 999, "discrete_inputs", 21000],
    ["si", 0, 999, "discrete_inputs", 21999],
    ["so", 0, 1000, "discrete_inputs", 22999],
    ["wi", 1, 1000, "discrete_inputs", 24000],
    ["wo", 1, 1000, "discrete_inputs", 25000],
    ["wsi", 1, 1000, "discrete_inputs", 26000],
    ["wso", 1, 1000, "discrete_inputs", 27000],
    ["do", 1, 10000, "coils", 0],
    ["ro", 1, 10000, "coils", 10000],
    ["flag", 1, 10000, "coils", 20000],
    ["gi", 1, 1000, "input_registers", 0],
    ["go", 1, 1000, "input_registers", 1000],
    ["ai", 1, 1000, "input_registers", 2000],
    ["ao", 1, 1000, "input_registers", 3000],
    ["r", 1, 16384, "holding_registers", 0],
    ["dynamic", 0, 63, "holding_registers", 16384],
  ] as const
).map(([name, first, last, table, address]) => ({ name, first, last, table, address }));

/** The place of a signal; null if there is none of this number. */
export function placeOf(name: string, number: number): Place | null {
  const row = ROWS.find((candidate) => candidate.name === name);
  if (row === undefined || !isInteger(number, row.first, row.last)) return null;
  return { table: row.table, address: row.address + number - row.first };
}

/** The signal at a place; null where an address is not used. */
export function signalAt({ table, address }: Place): { name: string; number: number } | null {
  const row = ROWS.find((candidate) => candidate.table === table && isInteger(address, candidate.address, candidate.address + candidate.last - candidate.first));
  return row === undefined ? null : { name: row.name, number: address - row.address + row.first };
}

// Values wider than a register

/** Which register of two comes first: the one of bits 0 to 15, or of bits 16 to 31 (FM-19). */
export type WordOrder = "low_first" | "high_first";

export interface NumberFormat {
  kind: "int16" | "int32" | "float32";
  /** An integer is the value times this (FM-20). */
  multiply: number;
  order: WordOrder;
}

/** The bits of two registers, the first of them at a place. */
function join(registers: readonly number[], place: number, order: WordOrder): number {
  const [first, second] = [numberAt(registers, place), numberAt(registers, place + 1)];
  return order === "low_first" ? ((second << 16) | first) >>> 0 : ((first << 16) | second) >>> 0;
}

function split(bits: number, order: WordOrder): number[] {
  const words = [bits & 0xffff, bits >>> 16];
  return order === "low_first" ? words : words.reverse();
}

const WORD = new DataView(new ArrayBuffer(4));

function floatOfBits(bits: number): number {
  WORD.setUint32(0, bits);
  return WORD.getFloat32(0);
}

function bitsOfFloat(value: number): number {
  WORD.setFloat32(0, value);
  return WORD.getUint32(0);
}

/** A register with its sign. */
function signed(register: number): number {
  return (register << 16) >> 16;
}

/** The value of one register or two. */
export function readNumber(format: NumberFormat, registers: readonly number[]): number {
  switch (format.kind) {
    case "int16":
      return signed(numberAt(registers, 0)) / format.multiply;
    case "int32":
      return (join(registers, 0, format.order) | 0) / format.multiply;
    case "float32":
      return floatOfBits(join(registers, 0, format.order));
  }
}

/** The registers of a value; an integer is rounded, halves away from zero. Refuses what does not fit. */
export function writeNumber(format: NumberFormat, value: number): number[] {
  if (format.kind === "float32") {
    if (!Number.isFinite(Math.fround(value))) throw new Refused("range", `${value} is no finite float`);
    return split(bitsOfFloat(value), format.order);
  }
  const scaled = value * format.multiply;
  const count = Math.sign(scaled) * Math.round(Math.abs(scaled));
  if (format.kind === "int16") return [integer(count, -0x8000, 0x7fff, "range") & 0xffff];
  return split(integer(count, -0x8000_0000, 0x7fff_ffff, "range"), format.order);
}

/** Text, the first character in the high byte, up to a 0 or the end of the registers (FM-20). */
export function readText(registers: readonly number[]): string {
  const text = registers.map((register) => String.fromCharCode(register >> 8, register & 0xff)).join("");
  return text.split("\0")[0] ?? "";
}

/** The registers of a text; refuses what is too long, and a character that is no byte, or 0. */
export function writeText(text: string, registers: number): number[] {
  if (text.length > 2 * registers) throw new Refused("text_length", `${text.length} characters in ${registers} registers`);
  for (const character of text) integer(character.codePointAt(0), 1, 255, "character");
  const bytes = bytesOf(text);
  return Array.from({ length: registers }, (_, index) => ((bytes[2 * index] ?? 0) << 8) | (bytes[2 * index + 1] ?? 0));
}

// Assignments

/** A slot of `$SNPX_ASG` (FM-20). */
export interface Slot {
  /** 1 to 16384, counted from 1. */
  address: number;
  /** Registers, 1 to 16384. */
  size: number;
  var_name: string;
  /** 0: a real; 0.0001 to 10000: an integer; −1: text. */
  multiply: number;
}

const MAX_SLOTS = 80;
const MAX_REGISTER = 16384;

/** The first and the last PDU address of each slot; refuses what a controller does not take, and slots of which one hides another. */
export function assign(slots: readonly Slot[]): [number, number][] {
  if (slots.length > MAX_SLOTS) throw new Refused("slots", `${slots.length} slots`);
  const runs = slots.map(({ address, size, var_name, multiply }): [number, number] => {
    integer(address, 1, MAX_REGISTER, "address");
    integer(size, 1, MAX_REGISTER + 1 - address, "size");
    if (!/^[ -&(-~]{1,37}$/.test(var_name)) throw new Refused("var_name", `the name ${var_name}`);
    if (multiply !== 0 && multiply !== -1 && !(multiply >= 0.0001 && multiply <= 10000)) throw new Refused("multiply", `times ${multiply}`);
    return [address - 1, address + size - 2];
  });
  const overlap = runs.some(([first, last], index) => runs.slice(index + 1).some((other) => other[0] <= last && first <= other[1]));
  if (overlap) throw new Refused("overlap", "a slot hides another one");
  return runs;
}

// Telemetry

/** The telemetry block (FM-71). */
export interface Block {
  /** Runs of the task, modulo 2³². */
  life_counter: number;
  /** % */
  override: number;
  /** mm, world frame. */
  position: number[];
  /** Degrees about the fixed axes X, Y, Z. */
  wpr: number[];
  /** w, x, y, z. */
  quaternion: number[];
  /** mm/s */
  velocity: number[];
  /** 1/s */
  quaternion_rate: number[];
}

export const BLOCK_REGISTERS = 37;
const FLOAT_LISTS = [
  ["position", 3],
  ["wpr", 3],
  ["quaternion", 4],
  ["velocity", 3],
  ["quaternion_rate", 4],
] as const;

export function readBlock(order: WordOrder, registers: readonly number[]): Block {
  if (registers.length !== BLOCK_REGISTERS) throw new Refused("registers", `${registers.length} registers`);
  const block: Block = {
    life_counter: join(registers, 0, order),
    override: signed(numberAt(registers, 2)),
    position: [],
    wpr: [],
    quaternion: [],
    velocity: [],
    quaternion_rate: [],
  };
  let place = 3;
  for (const [name, count] of FLOAT_LISTS) {
    for (let index = 0; index < count; index += 1, place += 2) block[name].push(floatOfBits(join(registers, place, order)));
  }
  return block;
}

export function writeBlock(order: WordOrder, block: Block): number[] {
  const floats = FLOAT_LISTS.flatMap(([name]) => block[name]);
  return [...split(block.life_counter, order), block.override & 0xffff, ...floats.flatMap((value) => split(bitsOfFloat(value), order))];
}

/** What a client makes of a block that it has read (FM-23, FM-24). */
export type Track =
  | "first"
  | "repeated"
  | "restarted"
  | {
      /** ns since the first sample. */
      time: number;
      /** Runs of the task that were not read. */
      missed: number;
      /** The quaternion, with the sign that is nearer to the one before. */
      orientation: number[];
      /** mm/s */
      velocity: number[];
      /** 1/s */
      quaternion_rate: number[];
    };

/** The task runs every 8 ms (FM-23). */
const PERIOD = 8_000_000;

/** Follows the telemetry from block to block. */
export class Tracker {
  private last: { block: Block; orientation: number[]; time: number } | null = null;

  take(block: Block): Track {
    const { last } = this;
    const first = { block, orientation: block.quaternion, time: 0 };
    if (last === null) {
      this.last = first;
      return "first";
    }
    const runs = (block.life_counter - last.block.life_counter) >>> 0;
    if (runs === 0) return "repeated";
    if (runs >= 0x8000_0000) {
      this.last = first;
      return "restarted";
    }
    const dot = block.quaternion.reduce((total, value, index) => total + value * numberAt(last.orientation, index), 0);
    const orientation = dot < 0 ? block.quaternion.map((value) => -value) : block.quaternion;
    const time = last.time + runs * PERIOD;
    const seconds = (runs * PERIOD) / 1e9;
    const rate = (now: number[], before: number[]): number[] => now.map((value, index) => (value - numberAt(before, index)) / seconds);
    const velocity = rate(block.position, last.block.position);
    const quaternion_rate = rate(orientation, last.orientation);
    this.last = { block, orientation, time };
    return { time, missed: runs - 1, orientation, velocity, quaternion_rate };
  }
}
