/** The central controller of the MM&A cell, on its connection to one device (section 7). */

import { Refused } from "../check.js";
import {
  ReplyDecoder,
  STRICT,
  axesOf,
  countsOf,
  encodeCommand,
  type CellError,
  type Command,
  type Device,
  type Dialect,
  type Reply,
  type StatusReply,
} from "../mmacell-proto.js";
import type { Item } from "../stream.js";
import { Motion, type MotionReport } from "./mma-motion.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

export interface CentralConfig {
  accepts: Partial<Dialect>;
  writes: Partial<Dialect>;
  /** ns that a reply may take. */
  timeout: number;
  /** ns after the start of a motion in which a status may be older than it. */
  settle: number;
  /** How far from its target a device has arrived: 1 µm, 0.1 mrad. */
  tolerance: number;
}

export const CENTRAL_DEFAULTS: CentralConfig = { accepts: {}, writes: {}, timeout: 1e9, settle: 100e6, tolerance: 10 };

export type CloseReason = "disconnected" | "aborted" | "mismatch" | "timeout" | "agreed" | { malformed: CellError };

/** What is known of the command that was outstanding (MM-36). */
export type Unfinished = "nothing" | { not_sent: Command } | { unknown: Command };

export type CentralEvent =
  | { event: "connected" }
  | { event: "done" | "aborted"; command: Command }
  | { event: "refused"; command: Command; error: number }
  | { event: "status"; status: Omit<StatusReply, "reply">; motion: MotionReport }
  | { event: "closed"; reason: CloseReason; unfinished: Unfinished }
  | Unexpected;

type State =
  | { phase: "down" | "idle" | "ended" }
  | { phase: "sending"; command: Command }
  | { phase: "awaiting"; command: Command; deadline: number };

/** A connection is not begun while more outcomes wait (MM-40). */
const MOST_OUTCOMES = 2;

export class MmaCentral implements Session<CentralEvent> {
  private state: State = { phase: "down" };
  private readonly motion: Motion;
  private readonly decoder: ReplyDecoder;
  private readonly writes: Dialect;
  private readonly events = new Events<CentralEvent>();
  private readonly config: CentralConfig;

  constructor(device: Device, config: Partial<CentralConfig> = {}) {
    this.config = { ...CENTRAL_DEFAULTS, ...config };
    const { timeout, settle, tolerance, accepts, writes } = this.config;
    require(timeout > 0, "a timeout of 0 (MM-48)");
    this.motion = new Motion(settle, tolerance);
    this.decoder = new ReplyDecoder({ ...STRICT, ...accepts }, device);
    this.writes = { ...STRICT, ...writes };
  }

  connected(): void {
    if (this.events.count(isOutcome) > MOST_OUTCOMES) throw new Refused("busy", "outcomes were not taken (MM-40)");
    if (this.state.phase !== "down" && this.state.phase !== "ended") this.close("disconnected");
    this.decoder.discard();
    this.motion.reset();
    this.state = { phase: "idle" };
    this.events.push({ event: "connected" });
  }

  disconnected(): void {
    if (this.state.phase !== "down" && this.state.phase !== "ended") this.close("disconnected");
    this.decoder.discard();
    this.state = { phase: "down" };
  }

  /** Requests a command (MM-30). */
  request(command: Command): void {
    const { phase } = this.state;
    if (phase === "down" || phase === "ended") throw new Refused("not_connected");
    if (phase !== "idle" || this.events.count(isOutcome) > 0) throw new Refused("busy");
    encodeCommand(command, this.writes);
    // With its coordinates as they are written (MM-11).
    const written = command.command === "MOV" ? { ...command, axes: axesOf(countsOf(command.axes)) } : command;
    this.state = { phase: "sending", command: written };
  }

  /** Gives up the command that is outstanding (MM-37). */
  abort(): void {
    const { state } = this;
    if (state.phase === "sending") {
      this.state = { phase: "idle" };
      this.events.push({ event: "aborted", command: state.command });
    } else if (state.phase === "awaiting") {
      this.close("aborted");
    }
  }

  input(bytes: Uint8Array, now: number): void {
    this.decoder.push(bytes);
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) this.take(item, now);
  }

  timeout(now: number): void {
    if (this.state.phase === "awaiting" && isDue(this.state.deadline, now)) this.close("timeout");
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    if (this.state.phase !== "sending") return null;
    const { command } = this.state;
    if (command.command === "STA") this.motion.asked(now);
    this.state = { phase: "awaiting", command, deadline: now + this.config.timeout };
    return encodeCommand(command, this.writes);
  }

  event(): CentralEvent | null {
    return this.events.take();
  }

  deadline(): number {
    return this.state.phase === "awaiting" ? this.state.deadline : NEVER;
  }

  private take(item: Item<Reply, CellError>, now: number): void {
    const { state } = this;
    if (state.phase === "ended") return;
    if (state.phase === "down") this.events.push({ event: "unexpected" });
    else if ("error" in item) this.close({ malformed: item.error });
    else if (state.phase === "awaiting") this.reply(state.command, item.message, now);
    else this.close("mismatch");
  }

  /** A reply to the command that was sent (MM-33, MM-34). */
  private reply(command: Command, reply: Reply, now: number): void {
    const asked = command.command === "STA";
    if (reply.reply === "error") {
      this.state = { phase: "idle" };
      this.events.push({ event: "refused", command, error: reply.error });
    } else if ((reply.reply === "status") !== asked) {
      this.close("mismatch");
    } else if (reply.reply === "status") {
      this.state = { phase: "idle" };
      const { moving, axes, servo, override, error } = reply;
      this.events.push({ event: "status", status: { moving, axes, servo, override, error }, motion: this.motion.status(reply) });
    } else if (command.command === "CLO") {
      this.state = { phase: "ended" };
      this.events.push({ event: "closed", reason: "agreed", unfinished: "nothing" });
    } else {
      this.state = { phase: "idle" };
      this.motion.done(command, now);
      this.events.push({ event: "done", command });
    }
  }

  /** The connection ends (MM-36). */
  private close(reason: CloseReason): void {
    const { state } = this;
    const unfinished: Unfinished =
      state.phase === "sending" ? { not_sent: state.command } : state.phase === "awaiting" ? { unknown: state.command } : "nothing";
    this.state = { phase: "ended" };
    this.events.push({ event: "closed", reason, unfinished });
  }
}

function isOutcome({ event }: CentralEvent): boolean {
  return event !== "connected" && event !== "unexpected";
}
