/** What addresses, registers and words mean, apart from any frame. */

import * as modbus from "./src/modbus-values.js";
import * as alter from "./src/val2-alter.js";
import { Refused } from "./src/check.js";

/** Each question by its key in `given`. */
const QUESTIONS: Record<string, (given: never) => unknown> = {
  signal: (given: Record<string, number>) => {
    const [signal] = Object.entries(given);
    return signal === undefined ? null : modbus.placeOf(signal[0], signal[1]);
  },
  place: (given: Parameters<typeof modbus.signalAt>[0]) => {
    const signal = modbus.signalAt(given);
    return signal && { [signal.name]: signal.number };
  },
  read: (given: { number: Parameters<typeof modbus.readNumber>[0]; registers: number[] }) => modbus.readNumber(given.number, given.registers),
  write: (given: { number: Parameters<typeof modbus.writeNumber>[0]; value: number }) => modbus.writeNumber(given.number, given.value),
  read_text: (given: { registers: number[] }) => modbus.readText(given.registers),
  write_text: (given: { text: string; registers: number }) => modbus.writeText(given.text, given.registers),
  read_block: (given: { order: Parameters<typeof modbus.readBlock>[0]; registers: number[] }) => modbus.readBlock(given.order, given.registers),
  write_block: (given: { order: Parameters<typeof modbus.writeBlock>[0]; block: Parameters<typeof modbus.writeBlock>[1] }) =>
    modbus.writeBlock(given.order, given.block),
  assign: (given: Parameters<typeof modbus.assign>[0]) => modbus.assign(given),
  track: (given: Parameters<modbus.Tracker["take"]>[0][]) => {
    const tracker = new modbus.Tracker();
    return given.map((block) => tracker.take(block));
  },
  word: (given: { mm?: number | null; degrees?: number | null }) =>
    "mm" in given ? alter.wordOfMm(given.mm ?? NaN) : alter.wordOfDegrees(given.degrees ?? NaN),
  nearest_word: (given: { mm?: number | null; degrees?: number | null }) =>
    "mm" in given ? alter.nearestWordOfMm(given.mm ?? NaN) : alter.nearestWordOfDegrees(given.degrees ?? NaN),
};

/** The answer to a task `value`. */
export function valueOf(given: Record<string, unknown>): object {
  const [question] = Object.entries(given);
  const ask = question && QUESTIONS[question[0]];
  if (question === undefined || ask === undefined) return { skipped: "not implemented" };
  try {
    return { gives: ask(question[1] as never) ?? null };
  } catch (refusal) {
    if (refusal instanceof Refused) return { error: refusal.message };
    throw refusal;
  }
}
