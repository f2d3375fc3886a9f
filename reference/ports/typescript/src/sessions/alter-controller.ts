/** The controller of VAL II ALTER (section 8): it sends a message in each cycle, and lets the host's answers move the arm. */

import { Refused, integer, integers } from "../check.js";
import {
  DEFAULT_FRAMING,
  encodeMessage,
  type AlterError,
  type Framing,
  type HostMessage,
  type Motion,
  type Reply,
  type RobotMessage,
} from "../val2-alter.js";
import {
  CYCLE,
  TIMEOUT,
  TOO_LONG,
  WRONG_FIELDS,
  errorCode,
  hasTransform,
  isCumulative,
  replyWindow,
  shortestMessage,
  shortestReply,
  usesInputs,
} from "./alter-timing.js";
import { AlterLine } from "./alter-line.js";
import { NEVER, isDue, lineTime, require, type Session, type Unexpected } from "./session.js";

export interface AlterControllerConfig {
  framing: Partial<Framing>;
  baud: number;
  /** ns of silence that end a frame. */
  gap: number;
  mode: number;
  /** The data list of the ALTER instruction, up to 14 words. */
  data: number[];
  /** ALTER names an exception subroutine. */
  subroutine: boolean;
  /** How many start messages are sent. */
  attempts: number;
  /** What a word that a reply leaves out means (AL-70). */
  unselected: "by_mode" | "hold" | "zero";
}

export const ALTER_CONTROLLER_DEFAULTS: AlterControllerConfig = {
  framing: {},
  baud: 38400,
  gap: 4e6,
  mode: 23,
  data: [],
  subroutine: false,
  attempts: 3,
  unselected: "by_mode",
};

export type AlterControllerEvent =
  | { event: "started" | "refused" | "gave_up" }
  /** values: what moves the arm in this cycle (cumulative), or holds it (non-cumulative). */
  | { event: "reply"; message: Reply; values: number[] }
  | { event: "bad_reply" | "ended"; error: number }
  | { event: "exception" | "aborted"; exception: number }
  | { event: "stray"; message: HostMessage }
  | Unexpected;

type Phase =
  | { phase: "disconnected" | "off" | "running" }
  | { phase: "starting"; attempts: number }
  /** reported: a message said so; returned: the subroutine has returned. */
  | { phase: "interrupted"; reported: boolean; returned: boolean }
  | { phase: "ending"; error: number };

/** The host's turn: when its answer may come, and the first fault in it; null is the controller's turn. */
type Turn = { opens: number; closes: number; fault: number | null } | null;

const AXES = 6;
const TRANSFORM_WORDS = 12;
/** The outcomes of an ALTER (how its start goes, an exception, its end), and those from an exception on. */
const OUTCOMES = 3;
const LAST_OUTCOMES = 2;

export class AlterController extends AlterLine<HostMessage, AlterControllerEvent> implements Session<AlterControllerEvent> {
  private state: Phase = { phase: "disconnected" };
  private turn: Turn = null;
  /** The error code of the next message. */
  private error = 0;
  /** When the next message is sent, and the one after it. */
  private slot = 0;
  private following = 0;
  /** The words that the controller holds (AL-82). */
  private words = new Array<number>(AXES).fill(0);
  private segment = { segment_status: 2, segment: 1, percent: 0 };
  private transform = new Array<number>(TRANSFORM_WORDS).fill(0);
  private now = 0;
  private readonly config: AlterControllerConfig;

  constructor(given: Partial<AlterControllerConfig> = {}) {
    const config = { ...ALTER_CONTROLLER_DEFAULTS, ...given };
    super("host", { ...DEFAULT_FRAMING, ...config.framing }, config.gap);
    this.config = config;
    const { mode, baud, attempts, data } = this.config;
    require(attempts > 0, "no attempts (AL-69)");
    integer(mode, 0, 31, "config");
    encodeMessage({ kind: "start", mode, data }, "robot", this.framing);
    const window = replyWindow(mode, baud, shortestMessage(this.framing, mode));
    require(window >= lineTime(shortestReply(this.framing, 1), baud), "a window without room for a reply (AL-69)");
    this.decoder.onCorrupt = (error) => this.corrupt(error);
  }

  connected(): void {
    this.close();
    this.state = { phase: "off" };
  }

  disconnected(): void {
    this.close();
    this.state = { phase: "disconnected" };
  }

  protected override isOpen(): boolean {
    return this.state.phase !== "disconnected";
  }

  transmit(now: number): Uint8Array | null {
    this.pass(now);
    // A slot is never before its window has closed.
    if (this.state.phase === "disconnected" || this.state.phase === "off" || now < this.slot) return null;
    const message = this.nextMessage();
    const bytes = encodeMessage(message, "robot", this.framing);
    this.discardBytes();
    if (message.kind === "end") return bytes;
    const { mode, baud } = this.config;
    const opens = now + lineTime(bytes.length, baud);
    const closes = opens + replyWindow(mode, baud, bytes.length);
    this.turn = { opens, closes, fault: null };
    this.slot = Math.max(this.following, closes);
    this.following = this.slot + CYCLE;
    return bytes;
  }

  deadline(): number {
    const { phase } = this.state;
    if (phase === "disconnected") return NEVER;
    const own = phase === "off" ? NEVER : (this.turn?.closes ?? this.slot);
    return Math.min(own, this.gapAt);
  }

  // Calls of the program

  start(now: number): void {
    if (this.state.phase === "disconnected") throw new Refused("not_connected");
    if (this.state.phase !== "off") throw new Refused("already_started");
    if (!this.hasRoom(OUTCOMES)) throw new Refused("events_full");
    this.state = { phase: "starting", attempts: 0 };
    this.error = 0;
    this.slot = now;
    this.following = now + CYCLE;
  }

  /** Ends ALTER with error 0 (AL-81). */
  finish(): void {
    switch (this.state.phase) {
      case "starting":
        this.off();
        this.outcome({ event: "ended", error: 0 });
        break;
      case "running":
      case "interrupted":
        this.endWith(0);
        break;
      case "ending":
        break;
      default:
        throw new Refused("not_running");
    }
  }

  /** The program runs its subroutine by itself (AL-90). */
  interrupt(): void {
    if (this.state.phase !== "running" || this.turn !== null) throw new Refused("not_running");
    this.state = { phase: "interrupted", reported: false, returned: false };
  }

  /** The subroutine has returned. */
  resume(): void {
    if (this.state.phase !== "interrupted" || this.state.returned) throw new Refused("not_running");
    this.state.returned = true;
  }

  /** What standard messages say about the current segment. */
  setSegment(segment_status: number, segment: number, percent: number): void {
    integer(segment_status, 0, 0xff);
    integers([segment, percent], 0, 0xffff);
    this.segment = { segment_status, segment, percent };
  }

  setTransform(words: number[]): void {
    this.transform = integers(words, -0x8000, 0x7fff, TRANSFORM_WORDS);
  }

  // Messages

  private nextMessage(): RobotMessage {
    const { state, error } = this;
    switch (state.phase) {
      case "starting":
        state.attempts += 1;
        return { kind: "start", mode: this.config.mode, data: this.config.data, error };
      case "ending": {
        this.off();
        this.outcome({ event: "ended", error: state.error });
        return { kind: "end", error: state.error };
      }
      case "interrupted":
        if (!state.reported || !state.returned) {
          state.reported = true;
          return this.motion("interrupted");
        }
        this.state = { phase: "running" };
    }
    return this.motion("running");
  }

  private motion(phase: Motion["phase"]): Motion {
    const transform = hasTransform(this.config.mode) ? this.transform : null;
    return { kind: "motion", phase, error: this.error, ...this.segment, transform };
  }

  protected override read(now: number): void {
    this.now = now;
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("message" in item) this.answer(item.message, now);
      else if (item.error.kind === "start_mark") this.corrupt(item.error);
    }
  }

  /** Corrupt bytes: the first fault of the window is noted (section 8.2). */
  private corrupt(error: AlterError): void {
    if (this.isAwaited(this.now)) this.fault(errorCode(error));
  }

  private fault(code: number): void {
    if (this.turn !== null) this.turn.fault ??= code;
  }

  private isAwaited(now: number): boolean {
    return this.turn !== null && now >= this.turn.opens;
  }

  private answer(message: HostMessage, now: number): void {
    const { state } = this;
    if (!this.isAwaited(now)) {
      this.notice({ event: "stray", message });
    } else if (message.kind === "reply") {
      if (state.phase === "starting") this.fault(WRONG_FIELDS);
      else if (message.exception !== 0 && !this.hasRoom(LAST_OUTCOMES)) this.fault(TOO_LONG);
      else this.reply(message);
    } else if (state.phase !== "starting") {
      this.fault(WRONG_FIELDS);
    } else if (message.reply === "accept") {
      this.turn = null;
      this.error = 0;
      this.words.fill(0);
      this.state = { phase: "running" };
      this.outcome({ event: "started" });
    } else if (message.reply === "refuse") {
      this.off();
      this.outcome({ event: "refused" });
    } else {
      this.startAgain(0);
    }
  }

  /** A good reply (AL-77, AL-78, AL-80). */
  private reply(message: Reply): void {
    const { mode, subroutine } = this.config;
    this.turn = null;
    this.error = 0;
    const moves = this.state.phase === "running" && usesInputs(mode);
    if (moves) this.words = message.values.map((value, axis) => value ?? this.unselected(axis));
    const values = moves || !isCumulative(mode) ? [...this.words] : new Array<number>(AXES).fill(0);
    this.notice({ event: "reply", message, values });
    const { exception } = message;
    if (this.state.phase !== "running" || exception === 0) return;
    if (subroutine) {
      this.state = { phase: "interrupted", reported: false, returned: false };
      this.outcome({ event: "exception", exception });
    } else {
      this.endWith(0);
      this.outcome({ event: "aborted", exception });
    }
  }

  /** What a word that is left out means (AL-70). */
  private unselected(axis: number): number {
    const { unselected, mode } = this.config;
    const zero = unselected === "zero" || (unselected === "by_mode" && isCumulative(mode));
    return zero ? 0 : (this.words[axis] ?? 0);
  }

  // Time

  /** Everything that is due at `now` (AL-91): the gap first. */
  protected override pass(now: number): void {
    this.passGap(now);
    const { turn } = this;
    if (turn === null || !isDue(turn.closes, now)) return;
    // Only errors come of it.
    this.endBytes(now);
    this.windowClosed(turn.fault);
  }

  /** No good answer came in the window (AL-75, AL-76). */
  private windowClosed(fault: number | null): void {
    const error = fault ?? TIMEOUT;
    this.notice({ event: "bad_reply", error });
    if (this.state.phase === "starting") {
      this.startAgain(error);
    } else if (fault === null) {
      this.endWith(error);
    } else {
      this.turn = null;
      this.error = error;
    }
  }

  private startAgain(error: number): void {
    if (this.state.phase !== "starting") return;
    this.turn = null;
    this.error = error;
    if (this.state.attempts < this.config.attempts) return;
    this.off();
    this.outcome({ event: "gave_up" });
  }

  /** The end message is sent in the next slot. */
  private endWith(error: number): void {
    this.turn = null;
    this.state = { phase: "ending", error };
  }

  private off(): void {
    this.turn = null;
    this.state = { phase: "off" };
  }

  /** The connection ends. */
  private close(): void {
    if (this.state.phase !== "disconnected" && this.state.phase !== "off") this.outcome({ event: "ended", error: TIMEOUT });
    this.turn = null;
    this.discardBytes();
  }
}
