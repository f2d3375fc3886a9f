/** The host of VAL II ALTER (section 7): it answers each message of the controller within its window. */

import { Refused, integer, integers } from "../check.js";
import { DEFAULT_FRAMING, encodeMessage, type HostMessage, type Motion, type RobotMessage, type Start } from "../val2-alter.js";
import { AlterAxes, type Aim } from "./alter-axes.js";
import { ALTER_HOST_DEFAULTS, type AlterHostConfig, type AlterHostEvent, type Outcome, type Policy } from "./alter-host-config.js";
import type { AxisState } from "./alter-limiter.js";
import { CYCLE, replyWindow, shortestMessage, shortestReply, windowOf } from "./alter-timing.js";
import { AlterLine } from "./alter-line.js";
import { NEVER, isDue, lineTime, require, type Session } from "./session.js";

/** An answer that is due: when it has to begin and to end. */
interface Window {
  beginBy: number;
  endBy: number;
}

/** A reply that is due. */
interface Request extends Window {
  /** When the message was read, and whether it says that ALTER is interrupted. */
  arrived: number;
  interrupted: boolean;
}

type Altering = { lostAt: number; request: Request | null; zerosSent: boolean };

type State =
  | { phase: "disconnected" | "idle" }
  | { phase: "repeating"; asked: number; answer: Window | null; forgetAt: number }
  | { phase: "starting"; right: boolean; answer: Window }
  | ({ phase: "accepted" | "running" | "interrupted" | "stopping" | "silent" } & Altering);

interface Exception {
  code: number;
  state: "unsent" | "sent" | "unread";
}

const AXES = 6;
/** The outcomes of an ALTER: its end, and that of a stop. */
const OUTCOMES = 2;

export class AlterHost extends AlterLine<RobotMessage, AlterHostEvent> implements Session<AlterHostEvent> {
  private state: State = { phase: "disconnected" };
  private policy: Policy;
  private subroutine: boolean;
  private target: { words: number[]; until: number } | null = null;
  private exception: Exception | null = null;
  /** Until when a message follows the last reply directly, and the same for an exception that was not read (AL-68). */
  private followsUntil = 0;
  private unreadUntil = 0;
  private lastMotion = -NEVER;
  private now = 0;
  private readonly axes: AlterAxes;
  private readonly config: AlterHostConfig;
  /** Two replies may come in one window (AL-95). */
  private readonly late: boolean;

  constructor(given: Partial<AlterHostConfig> = {}) {
    const config = { ...ALTER_HOST_DEFAULTS, ...given };
    super("robot", { ...DEFAULT_FRAMING, ...config.framing }, config.gap);
    this.config = config;
    const { mode, limits, silence_cycles, max_delay, baud, reserve } = this.config;
    this.policy = this.config.policy;
    this.subroutine = this.config.subroutine;
    integer(mode, 0, 31, "config");
    require(silence_cycles >= 2, "silence_cycles below 2 (AL-42)");
    const window = replyWindow(mode, baud, shortestMessage(this.framing, mode));
    require(window - lineTime(shortestReply(this.framing, 1), baud) >= reserve, "a window without room for a reply (AL-42)");
    this.late = max_delay >= CYCLE - windowOf(mode);
    this.axes = new AlterAxes(mode, limits, this.late, Math.min(max_delay, CYCLE * silence_cycles));
    this.decoder.onCorrupt = () => this.corruptFrame();
  }

  connected(): void {
    this.close("disconnected");
    this.discardBytes();
    this.state = { phase: "idle" };
  }

  disconnected(): void {
    this.close("disconnected");
    this.discardBytes();
    this.state = { phase: "disconnected" };
  }

  protected override isOpen(): boolean {
    return this.state.phase !== "disconnected";
  }

  transmit(now: number): Uint8Array | null {
    const { state } = this;
    switch (state.phase) {
      case "repeating":
        return state.answer === null ? null : this.answerRepeating(state.answer, state.asked, now);
      case "starting":
        return this.answerStart(state.answer, state.right, now);
      case "running":
      case "interrupted":
      case "stopping":
        return state.request === null ? null : this.reply(state, state.request, now);
      default:
        return null;
    }
  }

  deadline(): number {
    const { state } = this;
    switch (state.phase) {
      case "disconnected":
        return NEVER;
      case "idle":
        return this.gapAt;
      case "repeating":
        return Math.min(this.gapAt, state.answer?.beginBy ?? NEVER, state.forgetAt);
      case "starting":
        return Math.min(this.gapAt, state.answer.beginBy);
      default:
        return Math.min(this.gapAt, state.request?.beginBy ?? NEVER, this.target?.until ?? NEVER, state.lostAt);
    }
  }

  // The caller

  /** Where the arm is to go: words in the units of a reply. */
  setTarget(words: number[], now: number): void {
    integers(words, -0x8000, 0x7fff, AXES);
    if (this.isAltering() && this.state.phase !== "silent") this.target = { words, until: now + this.config.target_timeout };
  }

  clearTarget(): void {
    this.target = null;
  }

  stop(): void {
    this.policy = "ignore";
    const { state } = this;
    switch (state.phase) {
      case "repeating":
      case "starting":
        this.state = { phase: "idle" };
        break;
      case "accepted":
        this.silent(state);
        break;
      case "running":
      case "interrupted":
        if (this.exception?.state === "unsent") this.decide("not_done");
        this.state = { ...state, phase: "stopping", zerosSent: false };
        break;
      default:
    }
  }

  setPolicy(policy: Policy): void {
    this.policy = policy;
  }

  setSubroutine(subroutine: boolean): void {
    this.subroutine = subroutine;
  }

  /** Starts the exception subroutine with a code (AL-66). */
  startException(code: number): void {
    integer(code, 1, 255);
    if (!this.subroutine) throw new Refused("no_subroutine");
    if (this.state.phase !== "running") throw new Refused("not_running");
    if (this.exception !== null) throw new Refused("exception_pending");
    if (!this.hasRoom(OUTCOMES + 1)) throw new Refused("events_full");
    this.exception = { code, state: "unsent" };
  }

  // Time

  /** Everything that is due at `now` (AL-91), in the order of AL-43. */
  protected override pass(now: number): void {
    this.passGap(now);
    const { state } = this;
    if (state.phase === "repeating") {
      if (state.answer !== null && isDue(state.answer.beginBy, now)) {
        state.answer = null;
        this.notice({ event: "missed" });
      }
      if (isDue(state.forgetAt, now)) this.state = { phase: "idle" };
    } else if (state.phase === "starting" && isDue(state.answer.beginBy, now)) {
      this.state = { phase: "idle" };
      this.notice({ event: "missed" });
    } else if ("lostAt" in state) {
      if (state.request !== null && isDue(state.request.beginBy, now)) this.missed(state);
      if (this.target !== null && isDue(this.target.until, now)) {
        this.target = null;
        this.notice({ event: "target_stale" });
      }
      if (isDue(state.lostAt, now)) {
        this.close("silence");
        this.state = { phase: "idle" };
      }
    }
  }

  private missed(state: Altering): void {
    if (state.request === null) return;
    state.request = null;
    this.axes.missed();
    this.notice({ event: "missed" });
  }

  private isAltering(): boolean {
    return "lostAt" in this.state;
  }

  /** ALTER ends without an end message. */
  private close(reason: "disconnected" | "restart" | "silence"): void {
    if (!this.isAltering()) return;
    this.forget();
    this.outcome({ event: "lost", reason });
  }

  /** What belongs to an ALTER that is over. */
  private forget(): void {
    if (this.exception !== null) this.decide(this.exception.state === "unsent" ? "not_done" : { unknown: "ended" });
    this.target = null;
  }

  private decide(outcome: Outcome): void {
    if (this.exception === null) return;
    this.outcome({ event: "exception", exception: this.exception.code, outcome });
    this.exception = null;
  }

  private silent(state: Altering): void {
    this.state = { ...state, phase: "silent", request: null };
    this.target = null;
    this.outcome({ event: "stopped" });
  }

  private lostAt(now: number): number {
    return now + CYCLE * this.config.silence_cycles;
  }

  // Messages

  protected override read(now: number): void {
    this.now = now;
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("error" in item) {
        if (item.error.kind === "start_mark") this.maybeMessage();
        this.notice({ event: "corrupt", error: item.error });
      } else {
        this.message(item.message, item.length, now);
      }
    }
  }

  private message(message: RobotMessage, length: number, now: number): void {
    switch (message.kind) {
      case "start":
        this.start(message, now);
        this.notice({ event: "start", message });
        break;
      case "motion":
        this.motion(message, length, now);
        this.notice({ event: "motion", message });
        break;
      case "end":
        if (this.isAltering()) {
          this.forget();
          this.outcome({ event: "end", message });
        } else {
          this.notice({ event: "end", message });
        }
        this.state = { phase: "idle" };
    }
  }

  private start(message: Start, now: number): void {
    const { state } = this;
    if (state.phase === "starting" || (state.phase === "repeating" && state.answer !== null)) this.notice({ event: "missed" });
    if ("lostAt" in state) {
      this.missed(state);
      if (state.phase === "accepted") this.forget();
      else this.close("restart");
    }
    this.state = { phase: "starting", right: message.mode === this.config.mode, answer: this.answerWindow(now) };
  }

  /** When the answer to a start message has to begin and to end (AL-60); no rate of AL-42 makes it longer than its window. */
  private answerWindow(now: number): Window {
    const { mode, baud } = this.config;
    const endBy = now + windowOf(mode);
    return { endBy, beginBy: endBy - lineTime(this.framing.leading_dle + 5, baud) };
  }

  /** A corrupt frame, when it is found (AL-47, AL-68). */
  private corruptFrame(): void {
    const { state, now } = this;
    this.maybeMessage();
    if (this.policy !== "accept" || (state.phase !== "idle" && (state.phase !== "repeating" || state.answer !== null))) return;
    const asked = (state.phase === "repeating" ? state.asked : 0) + 1;
    this.state = { phase: "repeating", asked, answer: this.answerWindow(now), forgetAt: this.lostAt(now) };
  }

  /** A message may have been among corrupt bytes. */
  private maybeMessage(): void {
    this.followsUntil = this.unreadUntil = 0;
    this.axes.corrupt();
  }

  private motion({ phase, error }: Motion, length: number, now: number): void {
    const { state, config } = this;
    if (!("lostAt" in state)) return;
    state.lostAt = this.lostAt(now);
    if (state.phase === "silent") return;
    const interrupted = phase === "interrupted";
    this.missed(state);
    if (state.phase !== "accepted" && now - this.lastMotion < CYCLE - config.max_delay) this.notice({ event: "delayed" });
    this.lastMotion = now;
    if (error > 0) {
      this.notice({ event: "rejected", error });
      if (now < this.followsUntil && !this.late) this.axes.rejected();
      else this.axes.missed();
    }
    this.axes.message(error, interrupted, now);
    this.judgeException(error, interrupted, now);
    if (state.phase === "stopping") {
      if (error === 0 && state.zerosSent && this.axes.kept.size === 0) {
        this.silent(state);
        return;
      }
      state.zerosSent = false;
    } else {
      state.phase = phase;
    }
    const endBy = now + replyWindow(config.mode, config.baud, length);
    const beginBy = endBy - lineTime(shortestReply(this.framing, this.axes.kept.size), config.baud);
    state.request = { arrived: now, interrupted, endBy, beginBy: Math.max(beginBy, now + 1) };
  }

  /** What a standard message says about an exception (section 7.6). */
  private judgeException(error: number, interrupted: boolean, now: number): void {
    const { exception } = this;
    if (exception === null || exception.state === "unsent") return;
    const follows = now < (exception.state === "sent" ? this.followsUntil : this.unreadUntil);
    if (this.late) {
      this.decide({ unknown: "out_of_sequence" });
    } else if (exception.state === "sent" && error === 0) {
      this.decide("done");
    } else if (interrupted) {
      this.decide({ unknown: "unclear" });
    } else if (exception.state === "sent") {
      exception.state = "unread";
      this.unreadUntil = follows ? now + 2 * CYCLE - this.config.max_delay : 0;
    } else if (!follows) {
      this.decide({ unknown: "out_of_sequence" });
    } else if (this.state.phase === "stopping") {
      this.decide("not_done");
    } else {
      exception.state = "unsent";
    }
  }

  // Answers

  private encode(message: HostMessage): Uint8Array {
    return encodeMessage(message, "host", this.framing);
  }

  private endsBy(bytes: Uint8Array, now: number, end: number): boolean {
    return now + lineTime(bytes.length, this.config.baud) <= end;
  }

  /** An answer that cannot end in its window is not sent: its time to begin has come (AL-46). */
  private inWindow(window: Window, bytes: Uint8Array, now: number): boolean {
    if (this.endsBy(bytes, now, window.endBy)) return true;
    window.beginBy = now;
    return false;
  }

  private answerRepeating(window: Window, asked: number, now: number): Uint8Array | null {
    if (this.policy === "ignore") {
      this.state = { phase: "idle" };
      return null;
    }
    const again = asked <= this.config.repeats && this.policy === "accept";
    const bytes = this.encode({ kind: "start_reply", reply: again ? "repeat" : "refuse" });
    if (!this.inWindow(window, bytes, now)) return null;
    if (!again) this.state = { phase: "idle" };
    else if (this.state.phase === "repeating") this.state.answer = null;
    return bytes;
  }

  /** By the policy that holds when the answer is sent (AL-44, AL-45). */
  private answerStart(window: Window, right: boolean, now: number): Uint8Array | null {
    if (this.policy === "ignore") {
      this.state = { phase: "idle" };
      return null;
    }
    const accept = this.policy === "accept" && right;
    if (accept && !this.hasRoom(OUTCOMES)) {
      this.state = { phase: "idle" };
      return null;
    }
    const bytes = this.encode({ kind: "start_reply", reply: accept ? "accept" : "refuse" });
    if (!this.inWindow(window, bytes, now)) return null;
    if (!accept) {
      this.state = { phase: "idle" };
      return bytes;
    }
    this.state = { phase: "accepted", lostAt: this.lostAt(now), request: null, zerosSent: false };
    this.axes.reset(now);
    return bytes;
  }

  /** A target that is not fresh any more is not followed (AL-88). */
  private aim(phase: State["phase"], now: number): Aim {
    if (phase === "stopping") return "zero";
    if (phase === "interrupted") return "hold";
    return this.target === null || isDue(this.target.until, now) ? "none" : { target: this.target.words };
  }

  private reply(state: Altering & { phase: State["phase"] }, request: Request, now: number): Uint8Array | null {
    const axes = this.axes.next(this.aim(state.phase, now));
    const carries = this.exception?.state === "unsent" && state.phase === "running";
    const chosen = this.choose(axes, carries ? (this.exception?.code ?? 0) : 0, request, now);
    if (chosen === null) {
      request.beginBy = now;
      return null;
    }
    this.axes.reply(axes, chosen.axes, request.interrupted || this.exception?.state === "unread");
    if (carries && this.exception !== null) this.exception.state = "sent";
    this.followsUntil = request.arrived + 2 * CYCLE - this.config.max_delay;
    state.request = null;
    const zeros = axes.every((axis, index) => !chosen.axes.has(index) || this.axes.valueOf(axis) === 0);
    state.zerosSent = state.phase === "stopping" && zeros && !this.axes.isMoving;
    return chosen.bytes;
  }

  /** The words of a reply (AL-63); null, if none ends within the window. */
  private choose(axes: AxisState[], exception: number, request: Request, now: number): { axes: Set<number>; bytes: Uint8Array } | null {
    const values = axes.map((axis) => this.axes.valueOf(axis));
    const replyWith = (chosen: Set<number>): Uint8Array =>
      this.encode({ kind: "reply", exception, values: values.map((value, index) => (chosen.has(index) ? value : null)) });
    const early = request.endBy - this.config.reserve;
    const all = new Set(values.keys());
    if (this.endsBy(replyWith(all), now, early)) return { axes: all, bytes: replyWith(all) };
    let chosen = new Set(this.axes.kept);
    if (!this.endsBy(replyWith(chosen), now, request.endBy)) return null;
    values.forEach((value, index) => {
      const more = new Set([...chosen, index]);
      if (value !== 0 && this.endsBy(replyWith(more), now, early)) chosen = more;
    });
    return { axes: chosen, bytes: replyWith(chosen) };
  }
}
