/** The host of the VAL II viewer (section 7): it answers requests with the newest pose. */

import { REQUEST, XOFF, XON, encodePose, type Pose } from "../val2-viewer.js";
import { Echo, type EchoEvent } from "./echo.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

export interface ViewerHostConfig {
  /** ns from packet to packet at least. */
  interval: number;
  /** ns; how old a pose may become. */
  max_age: number;
  /** ns that an XOFF holds the line. */
  max_hold: number;
  /** The line returns what is sent. */
  echo: boolean;
  /** What writes a packet. */
  format: (message: Pose) => Uint8Array;
}

export const VIEWER_HOST_DEFAULTS: ViewerHostConfig = { interval: 150e6, max_age: 200e6, max_hold: 5e9, echo: false, format: encodePose };

export type ViewerHostEvent =
  | { event: "asked" | "ignored" | "stale" | "unsendable" | "hold_ended" }
  | { event: "sent"; message: Pose }
  | { event: "unknown"; byte: number }
  | EchoEvent
  | Unexpected;

export class ViewerHost implements Session<ViewerHostEvent> {
  private link: "disconnected" | "ready" | "asked" = "disconnected";
  /** From when on a packet may be sent. */
  private from = 0;
  private pose: { words: number[]; until: number } | null = null;
  /** Until when the line is held, without XON; null is free. */
  private hold: number | null = null;
  private count = 0;
  private echo = new Echo(false);
  private readonly events = new Events<ViewerHostEvent>();
  private readonly config: ViewerHostConfig;

  constructor(config: Partial<ViewerHostConfig> = {}) {
    this.config = { ...VIEWER_HOST_DEFAULTS, ...config };
    const { interval, max_age, max_hold } = this.config;
    require(interval > 0 && max_age > 0 && max_hold > 0, "a time of 0 (VV-18, VV-39)");
  }

  connected(now: number): void {
    this.pass(now);
    this.link = "ready";
    this.hold = null;
    this.from = now + this.config.interval;
    this.echo = new Echo(this.config.echo);
  }

  disconnected(now: number): void {
    this.pass(now);
    this.link = "disconnected";
    this.hold = null;
  }

  /** The caller has a pose: the words of a transformation (VV-9). */
  setPose(words: number[], now: number): void {
    this.pass(now);
    encodePose({ count: 0, pose: words });
    this.pose = { words, until: now + this.config.max_age };
  }

  input(bytes: Uint8Array, now: number): void {
    this.pass(now);
    for (const byte of this.echo.remove(bytes, this.events)) this.byte(byte, now);
  }

  timeout(now: number): void {
    this.pass(now);
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    this.pass(now);
    if (this.link !== "asked" || now < this.from || this.pose === null || this.hold !== null) return null;
    const message: Pose = { count: this.count, pose: this.pose.words };
    const bytes = this.config.format(message);
    this.link = "ready";
    this.from = now + this.config.interval;
    if (bytes.includes(XON) || bytes.includes(XOFF)) {
      this.events.push({ event: "unsendable" });
      return null;
    }
    this.count = (this.count + 1) & 0xffff;
    this.echo.sent(bytes, true);
    this.events.push({ event: "sent", message });
    return bytes;
  }

  event(): ViewerHostEvent | null {
    return this.events.take();
  }

  deadline(): number {
    const sending = this.link === "asked" && this.pose !== null && this.hold === null;
    return Math.min(this.pose?.until ?? NEVER, sending ? this.from : NEVER, this.hold ?? NEVER);
  }

  /** Time passes (VV-34). */
  private pass(now: number): void {
    if (this.pose !== null && isDue(this.pose.until, now)) {
      this.pose = null;
      this.events.push({ event: "stale" });
    }
    if (this.hold !== null && isDue(this.hold, now)) {
      this.hold = null;
      this.events.push({ event: "hold_ended" });
    }
  }

  private byte(byte: number, now: number): void {
    if (byte !== REQUEST && byte !== XON && byte !== XOFF) {
      this.events.push({ event: "unknown", byte });
    } else if (this.link === "disconnected") {
      this.events.push({ event: "unexpected" });
    } else if (byte === XOFF) {
      this.hold = now + this.config.max_hold;
    } else if (byte === XON) {
      this.hold = null;
    } else if (this.link === "asked") {
      this.events.push({ event: "ignored" });
    } else {
      this.link = "asked";
      this.events.push({ event: "asked" });
    }
  }
}
