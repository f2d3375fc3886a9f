/** The host of the laser link (section 7): it sends frames of instructions, and knows what has become of each. */

import { Refused, integer, isInteger } from "../check.js";
import {
  LaserDecoder,
  MAX_FRAME,
  MAX_PAYLOAD,
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
  instructionOf,
  wordItem,
  wordOf,
  type CommandClass,
  type ErrorCode,
  type GivenWords,
  type Instruction,
} from "./laser-words.js";
import { Events, NEVER, isDue, lineTime, require, type Session, type Unexpected } from "./session.js";

/** Times are in ns. Those that the text gives with `e` are longer below 9600 baud, if they are not given (LE-70). */
export interface LaserHostConfig {
  profile: Partial<Profile>;
  words: GivenWords;
  baud: number;
  /** The most interpreted instructions in a frame. */
  batch: number;
  resends: number;
  resend_on_silence: boolean;
  answer_timeout: number;
  execution_timeout: number;
  settle: number;
  max_pause: number;
  reply_time: number;
  /** bytes */
  longest_frame: number;
  earlier_execution: number;
  controller_drops_partial: boolean;
  backoff: number;
  full_timeout: number;
  /** The line returns what is sent. */
  echo: boolean;
}

const MS = 1e6;

export const LASER_HOST_DEFAULTS: LaserHostConfig = {
  profile: {},
  words: {},
  baud: 9600,
  batch: 7,
  resends: 3,
  resend_on_silence: false,
  answer_timeout: 250 * MS,
  execution_timeout: 30_000 * MS,
  settle: 100 * MS,
  max_pause: 300 * MS,
  reply_time: 40 * MS,
  longest_frame: MAX_FRAME,
  earlier_execution: 0,
  controller_drops_partial: false,
  backoff: 100 * MS,
  full_timeout: 60_000 * MS,
  echo: false,
};

export type UnknownReason =
  | "disconnected"
  | "silence"
  | "corrupt"
  | "execution_failed"
  | "partial_frame"
  | { other_word: { expected: number; found: number } };

export type LaserHostEvent =
  | { event: "done"; first: number; count: number; resends: number; unanswered: number }
  | { event: "answer"; ticket: number; items: LaserItem[] }
  | { event: "refused"; first: number; count: number; refusal: ErrorCode }
  | { event: "unknown"; first: number; count: number; reason: UnknownReason }
  | { event: "unasked"; word: number }
  | { event: "corrupt"; error: LaserError | { kind: "no_word" } }
  | EchoEvent
  | Unexpected;

/** A frame: its first instruction, how many, and how often it was sent. */
interface Batch {
  first: number;
  count: number;
  word: number;
  class: CommandClass;
  bytes: Uint8Array;
  /** More than one item, which no answer has (LE-114). */
  isProof: boolean;
  resends: number;
  unanswered: number;
  fullUntil: number | null;
}

type State =
  | { phase: "disconnected" | "disconnected_held" | "idle" | "held" }
  | {
      phase: "awaiting";
      batch: Batch;
      receivedBy: number;
      finalFrom: number;
      executedBy: number;
      deadline: number;
      corrupt: boolean;
    }
  | { phase: "resending"; batch: Batch; notBefore: number }
  | { phase: "awaiting_rest"; batch: Batch; until: number };

export class LaserHost implements Session<LaserHostEvent> {
  private state: State = { phase: "disconnected" };
  private quietUntil = 0;
  /** The frame that is being filled. */
  private filling: Instruction[] = [];
  /** The number of the next instruction. */
  private number = 0;
  private echo = new Echo(false);
  private readonly profile: Profile;
  private readonly words: WordTable;
  private readonly decoder: LaserDecoder;
  private readonly events = new Events<LaserHostEvent>();
  private readonly config: LaserHostConfig;

  constructor(given: Partial<LaserHostConfig> = {}) {
    const { baud = LASER_HOST_DEFAULTS.baud } = given;
    require(baud > 0, "a rate of 0 (LE-71)");
    const longer = Math.max(0, lineTime(13, baud) - lineTime(13, 9600));
    const { answer_timeout, execution_timeout, settle, reply_time } = LASER_HOST_DEFAULTS;
    this.config = {
      ...LASER_HOST_DEFAULTS,
      answer_timeout: answer_timeout + longer,
      execution_timeout: execution_timeout + longer,
      settle: settle + longer,
      reply_time: reply_time + longer,
      ...given,
    };
    require(isInteger(this.config.batch, 1, MOST_BATCH), "batch is outside its range (LE-107)");
    this.profile = profileOf(this.config.profile);
    this.words = new WordTable(this.config.words);
    this.decoder = new LaserDecoder(this.profile);
  }

  connected(now: number): void {
    const held = this.closeConnection(now);
    const { longest_frame, baud, max_pause, earlier_execution, settle } = this.config;
    const drain = lineTime(longest_frame, baud) + max_pause + earlier_execution + settle;
    this.decoder.discard();
    this.echo = new Echo(this.config.echo);
    this.quietUntil = Math.max(this.quietUntil, now + drain);
    this.state = { phase: held ? "held" : "idle" };
  }

  disconnected(now: number): void {
    const held = this.closeConnection(now);
    this.state = { phase: held ? "disconnected_held" : "disconnected" };
  }

  /** Submits an instruction, and gives its number (LE-39 to LE-41). */
  submit(instruction: Instruction): number {
    const { word, parameters } = instruction;
    const commandClass = this.words.classOf(integer(word, 0, 0xffff));
    if (commandClass === null) throw new Refused("unknown_word");
    const lone = parameters.map(wordOf).filter((found) => found !== null);
    if (lone.some((found) => commandClass === "interpreted" || this.words.classOf(found) !== null)) throw new Refused("lone_short");
    encodePayload(frameOf([instruction]), this.profile);
    if (!this.hasRoom(instruction, commandClass)) throw new Refused("full");
    this.filling.push(instruction);
    this.number += 1;
    return this.number - 1;
  }

  /** Takes back what was not sent yet (LE-42). */
  takeBack(): void {
    this.filling = [];
  }

  /** The caller goes on after a frame that was refused, or whose outcome is unknown (LE-62). */
  resume(): void {
    if (this.state.phase === "held") this.state = { phase: "idle" };
    else if (this.state.phase === "disconnected_held") this.state = { phase: "disconnected" };
    else this.events.push({ event: "unexpected" });
  }

  input(bytes: Uint8Array, now: number): void {
    const rest = this.echo.remove(bytes, this.events, () => this.decoder.discard());
    if (rest.length === 0) return;
    if (this.state.phase === "disconnected" || this.state.phase === "disconnected_held") {
      this.events.push({ event: "unexpected" });
      return;
    }
    this.decoder.push(rest);
    this.read(now);
  }

  timeout(now: number): void {
    const { state } = this;
    if (state.phase === "awaiting_rest" && isDue(state.until, now)) {
      this.unknown(state.batch, "partial_frame", state.until);
    } else if (state.phase === "awaiting" && isDue(state.deadline, now)) {
      this.decoder.end();
      this.read(now);
      this.unanswered(now);
    }
  }

  transmitted(now: number): void {
    if (this.state.phase !== "awaiting") return;
    const { reply_time } = this.config;
    const { execution, timeout } = this.timesOf(this.state.batch);
    this.state = { ...this.state, receivedBy: now, finalFrom: now + reply_time, executedBy: now + execution, deadline: now + timeout };
  }

  transmit(now: number): Uint8Array | null {
    this.timeout(now);
    if (this.events.count(isOutcome) > 0) return null;
    const { state } = this;
    if (state.phase === "resending" && now >= state.notBefore) return this.send(state.batch, now);
    const [first] = this.filling;
    if (state.phase !== "idle" || first === undefined || now < this.quietUntil) return null;
    const frame = frameOf(this.filling);
    const batch: Batch = {
      first: this.number - this.filling.length,
      count: this.filling.length,
      word: first.word,
      class: this.words.classOf(first.word) ?? "interpreted",
      bytes: encodeFrame(frame, this.profile),
      isProof: frame.items.length > 1,
      resends: 0,
      unanswered: 0,
      fullUntil: null,
    };
    this.filling = [];
    return this.send(batch, now);
  }

  event(): LaserHostEvent | null {
    return this.events.take();
  }

  deadline(): number {
    const { state } = this;
    switch (state.phase) {
      case "idle":
        return this.filling.length > 0 ? this.quietUntil : NEVER;
      case "awaiting":
        return state.deadline;
      case "resending":
        return state.notBefore;
      case "awaiting_rest":
        return state.until;
      default:
        return NEVER;
    }
  }

  private hasRoom(instruction: Instruction, commandClass: CommandClass): boolean {
    const [first] = this.filling;
    if (first === undefined) return true;
    if (commandClass !== "interpreted" || this.words.classOf(first.word) !== "interpreted") return false;
    if (this.filling.length >= this.config.batch) return false;
    const size = [...this.filling, instruction].reduce((total, one) => total + encodePayload(frameOf([one]), this.profile).length, 0);
    return size <= MAX_PAYLOAD;
  }

  /** How long the execution and the answer of a frame may take. */
  private timesOf(batch: Batch): { execution: number; timeout: number } {
    const { answer_timeout, execution_timeout } = this.config;
    return batch.class === "interpreted"
      ? { execution: 0, timeout: answer_timeout }
      : { execution: execution_timeout, timeout: execution_timeout };
  }

  /** Sends a frame (LE-47, LE-48). */
  private send(batch: Batch, now: number): Uint8Array {
    const { baud, max_pause, reply_time } = this.config;
    const { execution, timeout } = this.timesOf(batch);
    const left = now + lineTime(batch.bytes.length, baud);
    const receivedBy = left + max_pause;
    this.decoder.discard();
    this.state = {
      phase: "awaiting",
      batch,
      receivedBy,
      finalFrom: receivedBy + reply_time,
      executedBy: receivedBy + execution,
      deadline: left + timeout,
      corrupt: false,
    };
    this.echo.sent(batch.bytes, batch.isProof);
    return batch.bytes;
  }

  private read(now: number): void {
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("error" in item) {
        this.corrupt(item.error);
        continue;
      }
      if (this.isOwn(encodeFrame(item.message, this.profile))) continue;
      const answer = instructionOf(item.message);
      if (answer === null) this.corrupt({ kind: "no_word" });
      else this.answer(answer, now);
    }
  }

  /** The frame in flight, which the line has returned (LE-115). */
  private isOwn(frame: Uint8Array): boolean {
    if (!("batch" in this.state) || !this.state.batch.isProof) return false;
    const { bytes } = this.state.batch;
    if (frame.length !== bytes.length || !frame.every((byte, at) => byte === bytes[at])) return false;
    this.echo.found(bytes.length, this.events);
    return true;
  }

  private corrupt(error: LaserError | { kind: "no_word" }): void {
    const { state } = this;
    if (state.phase === "awaiting") state.corrupt = true;
    this.events.push({ event: "corrupt", error });
  }

  /** An answer, which is taken by its first word alone (LE-26). */
  private answer({ word, parameters }: Instruction, now: number): void {
    const { state } = this;
    if (!("batch" in state)) {
      this.events.push({ event: "unasked", word });
      return;
    }
    const { batch } = state;
    const error = this.words.errorOf(word);
    if (word === batch.word) {
      this.done(batch, parameters, now);
    } else if (error === null) {
      const { settle } = this.config;
      const quiet =
        state.phase === "awaiting" ? this.settledIfTaken(now) : Math.max(state.phase === "resending" ? state.notBefore : state.until, now + settle);
      this.unknown(batch, { other_word: { expected: batch.word, found: word } }, quiet);
    } else {
      this.errorCode(batch, error, now);
    }
  }

  private done(batch: Batch, parameters: LaserItem[], now: number): void {
    const { first, count, resends, unanswered } = batch;
    this.state = { phase: "idle" };
    this.quietUntil = now;
    if (batch.class === "query") this.events.push({ event: "answer", ticket: first, items: parameters });
    else this.events.push({ event: "done", first, count, resends, unanswered });
  }

  /** An error code in Awaiting (LE-52 to LE-54, LE-69). */
  private errorCode(batch: Batch, error: ErrorCode, now: number): void {
    const { state, config } = this;
    if (state.phase !== "awaiting") return;
    if (error === "queue_full") {
      batch.fullUntil ??= now + config.full_timeout;
      if (now < batch.fullUntil) {
        this.state = { phase: "resending", batch, notBefore: now + config.backoff };
        return;
      }
    } else if (error === "bad_frame" && now < state.finalFrom && !config.controller_drops_partial) {
      this.state = { phase: "awaiting_rest", batch, until: this.settledIfTaken(now) };
      return;
    } else if ((error === "bad_checksum" || error === "bad_frame") && batch.resends < config.resends) {
      batch.resends += 1;
      this.state = { phase: "resending", batch, notBefore: this.settled(now) };
      return;
    }
    this.notSentAgain(batch, error, now);
  }

  /** The end of a frame that is not sent again (LE-56). */
  private notSentAgain(batch: Batch, error: ErrorCode, now: number): void {
    const quiet = this.settled(now);
    if (batch.unanswered > 0) {
      this.unknown(batch, "silence", quiet);
    } else if (error === "bad_parameters" && batch.class === "immediate") {
      this.unknown(batch, "execution_failed", quiet);
    } else {
      this.hold(quiet);
      this.events.push({ event: "refused", first: batch.first, count: batch.count, refusal: error });
    }
  }

  /** The deadline in Awaiting (LE-58). */
  private unanswered(now: number): void {
    const { state, config } = this;
    if (state.phase !== "awaiting") return;
    const { batch } = state;
    const settled = this.settledIfTaken(now);
    if (config.resend_on_silence && batch.resends < config.resends) {
      batch.resends += 1;
      batch.unanswered += 1;
      this.state = { phase: "resending", batch, notBefore: settled };
    } else {
      this.unknown(batch, state.corrupt ? "corrupt" : "silence", settled);
    }
  }

  private settled(now: number): number {
    return Math.max(now, this.state.phase === "awaiting" ? this.state.receivedBy : now) + this.config.settle;
  }

  private settledIfTaken(now: number): number {
    return Math.max(now, this.state.phase === "awaiting" ? this.state.executedBy : now) + this.config.settle;
  }

  private unknown({ first, count }: Batch, reason: UnknownReason, quiet: number): void {
    this.hold(quiet);
    this.events.push({ event: "unknown", first, count, reason });
  }

  private hold(quiet: number): void {
    this.state = { phase: "held" };
    this.quietUntil = quiet;
  }

  /** A connection is lost or replaced (LE-63); whether the caller has to resume. */
  private closeConnection(now: number): boolean {
    const { state } = this;
    switch (state.phase) {
      case "awaiting":
        this.unknown(state.batch, "disconnected", this.settledIfTaken(now));
        break;
      case "resending":
        this.unknown(state.batch, "disconnected", state.notBefore);
        break;
      case "awaiting_rest":
        this.unknown(state.batch, "disconnected", state.until);
        break;
      default:
    }
    return this.state.phase === "held" || this.state.phase === "disconnected_held";
  }
}

function frameOf(instructions: Instruction[]): LaserFrame {
  return { items: instructions.flatMap(({ word, parameters }) => [wordItem(word), ...parameters]) };
}

function isOutcome({ event }: LaserHostEvent): boolean {
  return event === "done" || event === "answer" || event === "refused" || event === "unknown";
}
