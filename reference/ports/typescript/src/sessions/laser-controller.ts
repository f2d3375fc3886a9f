/** The controller of the laser link (section 8): it queues or executes instructions, and answers at the end of its cycle. */

import { Refused, isInteger } from "../check.js";
import {
  LaserDecoder,
  MAX_FRAME,
  MIN_FRAME,
  encodeFrame,
  encodePayload,
  profileOf,
  type LaserError,
  type LaserFrame,
  type LaserItem,
  type Profile,
} from "../laser-eb90.js";
import { Echo, type EchoEvent } from "./echo.js";
import {
  MOST_BATCH,
  WordTable,
  hasInfinite,
  instructionOf,
  wordItem,
  wordOf,
  type CommandClass,
  type ErrorCode,
  type GivenWords,
  type Instruction,
} from "./laser-words.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

export interface LaserControllerConfig {
  profile: Partial<Profile>;
  words: GivenWords;
  /** The most interpreted instructions in a frame. */
  batch: number;
  /** ns; the controller's cycle, at whose end answers are sent. */
  tick: number;
  /** ns without a byte after which corrupt bytes are answered. */
  silence: number;
  /** The line returns what is sent. */
  echo: boolean;
}

export const LASER_CONTROLLER_DEFAULTS: LaserControllerConfig = { profile: {}, words: {}, batch: 7, tick: 16e6, silence: 50e6, echo: false };

/** What queues interpreted instructions, and knows which parameters they take. */
export interface InstructionQueue {
  /** Whether the instruction takes its parameters. */
  takes(instruction: Instruction): boolean;
  hasRoom(count: number): boolean;
  add(instruction: Instruction): void;
}

export type LaserControllerEvent =
  | { event: "execute"; class: CommandClass; word: number; parameters: LaserItem[] }
  | { event: "queued"; count: number }
  | { event: "refused"; refusal: ErrorCode }
  | { event: "corrupt"; error: LaserError }
  | EchoEvent
  | Unexpected;

/** The last answer was an error code for corrupt bytes, where `rest` is set: bytes without a head are the rest of them. */
type Work =
  | { phase: "listening"; rest: boolean }
  | { phase: "executing"; word: number; class: CommandClass; connected: boolean }
  | { phase: "answering"; items: LaserItem[]; error: ErrorCode | null; due: number };

/** The first refusal of corrupt bytes, how many bytes (counted to 8), and whether they are answered. */
interface Fault {
  refusal: ErrorCode;
  count: number;
  answered: boolean;
}

type Line = { phase: "disconnected" | "silent" } | { phase: "bytes"; silentAt: number; partial: boolean; fault: Fault | null };

/** The most bytes of the values of an answer (LE-83). */
const MAX_VALUES = 508;

export class LaserController implements Session<LaserControllerEvent> {
  private work: Work = { phase: "listening", rest: false };
  private line: Line = { phase: "disconnected" };
  private echo = new Echo(false);
  private readonly profile: Profile;
  private readonly words: WordTable;
  private readonly decoder: LaserDecoder;
  private readonly events = new Events<LaserControllerEvent>();
  private readonly config: LaserControllerConfig;

  constructor(
    private readonly queue: InstructionQueue,
    config: Partial<LaserControllerConfig> = {},
  ) {
    this.config = { ...LASER_CONTROLLER_DEFAULTS, ...config };
    require(isInteger(this.config.batch, 1, MOST_BATCH), "batch is outside its range (LE-109)");
    this.profile = profileOf(this.config.profile);
    this.words = new WordTable(this.config.words);
    this.decoder = new LaserDecoder(this.profile);
  }

  connected(): void {
    this.changeConnection({ phase: "silent" });
    this.echo = new Echo(this.config.echo);
  }

  disconnected(): void {
    this.changeConnection({ phase: "disconnected" });
  }

  input(bytes: Uint8Array, now: number): void {
    const rest = this.echo.remove(bytes, this.events);
    if (rest.length === 0) return;
    const { line } = this;
    if (line.phase === "disconnected") {
      this.events.push({ event: "unexpected" });
      return;
    }
    const silentAt = now + this.config.silence;
    this.line = line.phase === "bytes" ? { ...line, silentAt } : { phase: "bytes", silentAt, partial: false, fault: null };
    this.decoder.push(rest);
    this.read(now);
  }

  timeout(now: number): void {
    const { line, work } = this;
    if (line.phase !== "bytes" || !isDue(line.silentAt, now)) return;
    if (work.phase === "executing" || (work.phase === "answering" && !line.partial)) return;
    const begun = this.decoder.begun;
    this.decoder.end();
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("error" in item) this.corrupt(item.error, item.length, begun);
    }
    const fault = this.fault;
    this.line = { phase: "silent" };
    if (fault === null || !fault.answered || fault.count < MIN_FRAME) return;
    this.refuseFrame(fault.refusal, now);
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    this.timeout(now);
    const { work, line } = this;
    if (work.phase !== "answering" || now < work.due || (line.phase === "bytes" && line.partial)) return null;
    const rest = work.error === "bad_checksum" || work.error === "bad_frame" || this.fault !== null;
    this.work = { phase: "listening", rest };
    this.endStretch(now);
    const frame = encodeFrame({ items: work.items }, this.profile);
    this.echo.sent(frame, false); // a host may send the same
    return frame;
  }

  event(): LaserControllerEvent | null {
    return this.events.take();
  }

  deadline(): number {
    const { work, line } = this;
    if (work.phase === "executing") return NEVER;
    if (work.phase === "answering") return line.phase === "bytes" && line.partial ? line.silentAt : work.due;
    return line.phase === "bytes" ? line.silentAt : NEVER;
  }

  // The owner's calls

  /** The instruction was executed; of a query these are its values (LE-81, LE-83). */
  answer(values: LaserItem[], now: number): void {
    const { work } = this;
    if (work.phase !== "executing") throw new Refused("not_executing");
    if (values.length > 0 && encodePayload({ items: values }, this.profile).length > MAX_VALUES) throw new Refused("buffer_too_small");
    this.executed([wordItem(work.word), ...(work.class === "query" ? values : [])], null, now);
  }

  /** The instruction was not executed. */
  refuse(error: ErrorCode, now: number): void {
    if (this.work.phase !== "executing") throw new Refused("not_executing");
    this.executed([wordItem(this.words.codeOf(error))], error, now);
  }

  private executed(items: LaserItem[], error: ErrorCode | null, now: number): void {
    if (this.work.phase !== "executing") return;
    if (this.work.connected) {
      this.work = { phase: "answering", items, error, due: this.endOfCycle(now) };
      if (error !== null) this.events.push({ event: "refused", refusal: error });
    } else {
      this.work = { phase: "listening", rest: false };
    }
    this.read(now);
  }

  // Bytes

  private get fault(): Fault | null {
    return this.line.phase === "bytes" ? this.line.fault : null;
  }

  /** Reads whole frames and errors; none while an instruction is executed (LE-74, LE-80). */
  private read(now: number): void {
    while (this.work.phase !== "executing") {
      const item = this.decoder.next();
      if (item === null) break;
      if ("error" in item) this.corrupt(item.error, item.length, true);
      else this.frame(item.message, now);
    }
    this.decoder.keep(MAX_FRAME);
    if (this.line.phase !== "bytes") return;
    this.line.partial = this.decoder.pending > 0;
    if (this.work.phase === "answering" && !this.line.partial) this.endStretch(now);
  }

  /** The line is silent, if it has been for long enough (LE-84). */
  private endStretch(now: number): void {
    if (this.line.phase === "bytes" && isDue(this.line.silentAt, now)) this.line = { phase: "silent" };
  }

  /** An error of the decoder (LE-75, LE-76); `begun`: the bytes of an incomplete one begin with a head. */
  private corrupt(error: LaserError, length: number, begun: boolean): void {
    this.events.push({ event: "corrupt", error });
    const { line, work } = this;
    if (line.phase !== "bytes") return;
    const fault = (line.fault ??= { refusal: error.kind === "checksum" ? "bad_checksum" : "bad_frame", count: 0, answered: false });
    fault.count = Math.min(fault.count + length, MIN_FRAME);
    if (work.phase !== "listening") return;
    if (!work.rest) {
      fault.answered = true;
    } else if (beginsAsFrame(error, begun)) {
      work.rest = false;
      if (length >= MIN_FRAME) fault.answered = true;
    }
  }

  /** A good frame; it is not trusted behind a fault of 8 bytes or more (LE-77, LE-112). */
  private frame(frame: LaserFrame, now: number): void {
    const fault = this.fault;
    if (fault !== null && fault.count >= MIN_FRAME) {
      fault.answered = true;
      this.work = { phase: "listening", rest: false };
      return;
    }
    if (this.line.phase === "bytes") this.line.fault = null;
    const instruction = instructionOf(frame);
    const commandClass = instruction === null ? null : this.words.classOf(instruction.word);
    if (instruction === null) this.refuseFrame("bad_frame", now);
    else if (commandClass === null) this.refuseFrame("unknown_command", now);
    else if (commandClass === "interpreted") this.judgeInterpreted(frame, instruction.word, now);
    else this.judgeImmediate(instruction, commandClass, now);
  }

  /** A frame of interpreted instructions is queued whole, or not at all (LE-92 to LE-95). */
  private judgeInterpreted(frame: LaserFrame, first: number, now: number): void {
    const instructions: Instruction[] = [];
    for (const item of frame.items) {
      const word = wordOf(item);
      if (word !== null) instructions.push({ word, parameters: [] });
      else instructions[instructions.length - 1]?.parameters.push(item);
    }
    const refusal = instructions.map((instruction, index) => this.refusalOf(instruction, index)).find((found) => found !== null);
    if (refusal !== undefined) {
      this.refuseFrame(refusal, now);
    } else if (!this.queue.hasRoom(instructions.length)) {
      this.refuseFrame("queue_full", now);
    } else {
      for (const instruction of instructions) this.queue.add(instruction);
      this.work = { phase: "answering", items: [wordItem(first)], error: null, due: this.endOfCycle(now) };
      this.events.push({ event: "queued", count: instructions.length });
    }
  }

  private refusalOf(instruction: Instruction, before: number): ErrorCode | null {
    const commandClass = this.words.classOf(instruction.word);
    if (commandClass === null) return "unknown_command";
    if (commandClass !== "interpreted" || before >= this.config.batch) return "bad_batch";
    return hasInfinite(instruction.parameters) || !this.queue.takes(instruction) ? "bad_parameters" : null;
  }

  /** An immediate instruction or a query is executed by the owner (LE-96, LE-97). */
  private judgeImmediate({ word, parameters }: Instruction, commandClass: CommandClass, now: number): void {
    const words = parameters.map(wordOf);
    if (words.some((found) => found !== null && this.words.classOf(found) !== null)) {
      this.refuseFrame("bad_batch", now);
    } else if (hasInfinite(parameters)) {
      this.refuseFrame("bad_parameters", now);
    } else {
      this.work = { phase: "executing", word, class: commandClass, connected: true };
      this.events.push({ event: "execute", class: commandClass, word, parameters });
    }
  }

  private refuseFrame(error: ErrorCode, now: number): void {
    this.work = { phase: "answering", items: [wordItem(this.words.codeOf(error))], error, due: this.endOfCycle(now) };
    this.events.push({ event: "refused", refusal: error });
  }

  /** The end of the cycle that `now` falls into (LE-78). */
  private endOfCycle(now: number): number {
    const { tick } = this.config;
    return tick === 0 ? now : tick === NEVER ? NEVER : Math.ceil(now / tick) * tick;
  }

  /** A connection is made or lost (LE-87). */
  private changeConnection(line: Line): void {
    this.line = line;
    this.decoder.discard();
    if (this.work.phase === "executing") this.work.connected = false;
    else this.work = { phase: "listening", rest: false };
  }
}

/** Whether an error begins as a frame does (LE-75). */
function beginsAsFrame(error: LaserError, begun: boolean): boolean {
  if (error.kind === "no_head" || error.kind === "flag") return false;
  if (error.kind === "tag" && error.offset === 0) return false;
  return begun;
}
