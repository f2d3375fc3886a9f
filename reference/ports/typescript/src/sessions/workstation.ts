/** The workstation of the VAL II viewer (section 8): it asks for a pose, draws it, and asks again. */

import { REQUEST, ViewerDecoder, XOFF, XON, isWholeLine, type Pose, type ViewerError } from "../val2-viewer.js";
import { Echo, type EchoEvent } from "./echo.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

export interface WorkstationConfig {
  /** ns of a paused display after which it asks again. */
  pause: number;
  /** ns without a new pose after which the picture is stale, and a request missed. */
  stale_after: number;
  /** ns that an XOFF holds the line. */
  max_hold: number;
  /** The line returns what is sent. */
  echo: boolean;
}

export const WORKSTATION_DEFAULTS: WorkstationConfig = { pause: 2e9, stale_after: 1.5e9, max_hold: 5e9, echo: false };

/** The time of a display cycle, in ns. */
const DISPLAY_CYCLE = 200e6;
/** A request is not sent while three outcomes have no room (VV-28). */
const NEEDED = 3;
const EVENT_PLACES = 8;
const OUTCOMES: ReadonlySet<string> = new Set(["pose", "missed", "stale"]);

export type WorkstationEvent =
  | { event: "pose"; message: Pose; live_until?: number }
  | { event: "unasked"; message: Pose }
  | { event: "missed" | "stale" | "hold_ended" }
  | { event: "corrupt"; error: ViewerError }
  | EchoEvent
  | Unexpected;

type Request =
  | { phase: "disconnected" | "allowed" | "due" }
  | { phase: "waiting"; againFrom: number; missedFrom: number }
  | { phase: "overdue"; againFrom: number };

export class Workstation implements Session<WorkstationEvent> {
  private request: Request = { phase: "disconnected" };
  /** Until when the picture is live, without a new pose; null is stale. */
  private live: number | null = null;
  /** Until when the line is held, without XON; null is free. */
  private hold: number | null = null;
  private echo = new Echo(false);
  private readonly decoder = new ViewerDecoder();
  private readonly events = new Events<WorkstationEvent>();
  private readonly config: WorkstationConfig;

  constructor(config: Partial<WorkstationConfig> = {}) {
    this.config = { ...WORKSTATION_DEFAULTS, ...config };
    const { pause, stale_after, max_hold } = this.config;
    require(pause > DISPLAY_CYCLE && stale_after > DISPLAY_CYCLE, "a time that is not above a display cycle (VV-24)");
    require(max_hold > 0, "a hold of 0 (VV-39)");
  }

  connected(now: number): void {
    this.pass(now);
    this.close();
    this.request = { phase: "allowed" };
    this.echo = new Echo(this.config.echo);
  }

  disconnected(now: number): void {
    this.pass(now);
    this.close();
    this.request = { phase: "disconnected" };
  }

  /** A display cycle (VV-25, VV-27). */
  draw(now: number): void {
    this.pass(now);
    const { request } = this;
    if (request.phase === "allowed") this.request = { phase: "due" };
    if (request.phase !== "waiting" && request.phase !== "overdue") return;
    if (isDue(request.againFrom, now)) {
      if (request.phase === "waiting") this.events.push({ event: "missed" });
      this.request = { phase: "due" };
    } else {
      this.request = { ...request, againFrom: now + this.config.pause };
    }
  }

  input(bytes: Uint8Array, now: number): void {
    this.pass(now);
    const rest = this.echo.remove(bytes, this.events, () => this.decoder.discard());
    let begin = 0;
    rest.forEach((byte, place) => {
      if (byte !== XON && byte !== XOFF) return;
      this.read(rest.subarray(begin, place), now);
      this.handshake(byte, now);
      begin = place + 1;
    });
    this.read(rest.subarray(begin), now);
  }

  timeout(now: number): void {
    this.pass(now);
  }

  transmitted(): void {}

  /** Only outcomes fill the places of events. */
  private hasRoom(): boolean {
    return this.events.count(({ event }) => OUTCOMES.has(event)) + NEEDED <= EVENT_PLACES;
  }

  transmit(now: number): Uint8Array | null {
    this.pass(now);
    if (this.request.phase !== "due" || this.hold !== null || !this.hasRoom()) return null;
    this.request = { phase: "waiting", againFrom: now + this.config.pause, missedFrom: now + this.config.stale_after };
    const asked = Uint8Array.of(REQUEST);
    this.echo.sent(asked, false);
    return asked;
  }

  event(): WorkstationEvent | null {
    return this.events.take();
  }

  deadline(): number {
    const missed = this.request.phase === "waiting" ? this.request.missedFrom : NEVER;
    return Math.min(this.live ?? NEVER, missed, this.hold ?? NEVER);
  }

  /** Time passes (VV-35). */
  private pass(now: number): void {
    const { request } = this;
    if (this.live !== null && isDue(this.live, now)) this.stale();
    if (request.phase === "waiting" && isDue(request.missedFrom, now)) {
      this.request = { phase: "overdue", againFrom: request.againFrom };
      this.events.push({ event: "missed" });
    }
    if (this.hold !== null && isDue(this.hold, now)) {
      this.hold = null;
      this.events.push({ event: "hold_ended" });
    }
  }

  private stale(): void {
    if (this.live !== null) this.events.push({ event: "stale" });
    this.live = null;
  }

  /** The end of a connection (VV-30). */
  private close(): void {
    if (this.request.phase === "waiting") this.events.push({ event: "missed" });
    this.stale();
    this.hold = null;
    this.decoder.discard();
  }

  private handshake(byte: number, now: number): void {
    if (this.request.phase === "disconnected") this.events.push({ event: "unexpected" });
    else this.hold = byte === XOFF ? now + this.config.max_hold : null;
  }

  private read(bytes: Uint8Array, now: number): void {
    this.decoder.push(bytes);
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("message" in item) this.packet(item.message, now);
      else this.corrupt(item.error);
    }
  }

  private packet(message: Pose, now: number): void {
    switch (this.request.phase) {
      case "disconnected":
        this.events.push({ event: "unexpected" });
        break;
      case "waiting": {
        const until = now + this.config.stale_after;
        this.live = until;
        this.request = { phase: "allowed" };
        this.events.push({ event: "pose", message, ...(until < NEVER ? { live_until: until } : {}) });
        break;
      }
      default:
        if (this.request.phase === "overdue") this.request = { phase: "allowed" };
        this.events.push({ event: "unasked", message });
    }
  }

  /** A whole line that cannot be read was the answer (VV-26). */
  private corrupt(error: ViewerError): void {
    this.events.push({ event: "corrupt", error });
    const { phase } = this.request;
    if (phase === "disconnected") this.events.push({ event: "unexpected" });
    if (!isWholeLine(error) || (phase !== "waiting" && phase !== "overdue")) return;
    if (phase === "waiting") this.events.push({ event: "missed" });
    this.request = { phase: "allowed" };
  }
}
