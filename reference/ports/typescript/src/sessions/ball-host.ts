/** The host of the ISRA ball (section 7): it polls, and tells new values from old ones. */

import { BallDecoder, POLL, type BallError, type BallPacket, type Values } from "../isra-ball.js";
import type { Item } from "../stream.js";
import { Echo, type EchoEvent } from "./echo.js";
import { Events, NEVER, isDue, lineTime, require, type Session, type Unexpected } from "./session.js";

export interface BallHostConfig {
  baud: number;
  /** ns from poll to poll. */
  period: number;
  /** ns that a reply may be late. */
  max_delay: number;
  /** ns; how old values may become. */
  max_age: number;
  /** The line returns what is sent. */
  echo: boolean;
}

export const BALL_HOST_DEFAULTS: BallHostConfig = { baud: 9600, period: 28e6, max_delay: 14e6, max_age: 150e6, echo: false };

export type BallHostEvent =
  | { event: "new"; message: Values; live_until?: number }
  | { event: "old" | "unasked"; message: BallPacket }
  | { event: "missed" | "stale" }
  | { event: "corrupt"; error: BallError | { kind: "layout"; expected: number; found: number } }
  | EchoEvent
  | Unexpected;

type Poll =
  | { phase: "disconnected" }
  | { phase: "idle"; due: number }
  /** from, until: when the reply can come; proof: until when it proves values. */
  | { phase: "waiting"; from: number; until: number; due: number; proof: number };

/** Poll and packet. */
const EXCHANGE_BYTES = 13;
const MILLISECOND = 1e6;

export class BallHost implements Session<BallHostEvent> {
  private poll: Poll = { phase: "disconnected" };
  /** Until when the values may be used; null is stale. */
  private live: number | null = null;
  /** Until when the next new values are proved not to be too old. */
  private proven = 0;
  private echo = new Echo(false);
  private readonly decoder = new BallDecoder();
  private readonly events = new Events<BallHostEvent>();
  private readonly config: BallHostConfig;
  private readonly exchange: number;
  private readonly window: number;
  private readonly spread: number;
  private readonly quiet: number;

  constructor(config: Partial<BallHostConfig> = {}) {
    this.config = { ...BALL_HOST_DEFAULTS, ...config };
    const { baud, period, max_delay, max_age } = this.config;
    require(baud > 0, "a rate of 0");
    this.exchange = lineTime(EXCHANGE_BYTES, baud);
    this.window = this.exchange + max_delay;
    this.spread = max_delay + Math.floor(this.exchange / 5);
    this.quiet = Math.max(period, this.window) + this.spread;
    require(period >= Math.ceil(this.exchange / MILLISECOND) * MILLISECOND, "period is shorter than an exchange (IB-21)");
    require(max_age === NEVER || max_age > 2 * Math.max(period, this.window) + this.window, "max_age is too short (IB-22)");
  }

  connected(now: number): void {
    this.pass(now);
    this.close();
    this.decoder.discard();
    this.echo = new Echo(this.config.echo);
    this.poll = { phase: "idle", due: now + this.quiet };
    this.proven = 0;
  }

  disconnected(now: number): void {
    this.pass(now);
    this.close();
    this.poll = { phase: "disconnected" };
  }

  input(bytes: Uint8Array, now: number): void {
    this.pass(now);
    this.decoder.push(this.echo.remove(bytes, this.events));
    this.read(now);
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
    if (this.poll.phase !== "idle" || !isDue(this.poll.due, now) || !this.hasRoom()) return null;
    this.giveUp(now);
    const { exchange } = this;
    this.poll = {
      phase: "waiting",
      from: now + exchange - Math.floor(exchange / 10),
      until: now + this.window,
      due: now + this.config.period,
      proof: now + this.config.max_age,
    };
    const poll = Uint8Array.of(POLL);
    this.echo.sent(poll, false); // a packet may begin with it
    return poll;
  }

  event(): BallHostEvent | null {
    return this.events.take();
  }

  deadline(): number {
    const { poll } = this;
    if (poll.phase === "disconnected") return NEVER;
    return Math.min(poll.phase === "idle" ? poll.due : poll.until, this.live ?? NEVER);
  }

  /** Time passes (IB-37, IB-39). */
  private pass(now: number): void {
    const { poll } = this;
    if (poll.phase === "waiting" && isDue(poll.until, now)) {
      this.giveUp(now);
      this.poll = { phase: "idle", due: Math.max(poll.due, now) + this.spread };
      this.events.push({ event: "missed" });
    }
    if (this.live !== null && isDue(this.live, now)) this.stale();
  }

  private stale(): void {
    if (this.live !== null) this.events.push({ event: "stale" });
    this.live = null;
  }

  /** The end of a connection. */
  private close(): void {
    if (this.poll.phase === "waiting") this.events.push({ event: "missed" });
    this.stale();
  }

  /** The bytes that the decoder holds belong to no reply (IB-28). */
  private giveUp(now: number): void {
    this.decoder.end();
    this.read(now);
  }

  private read(now: number): void {
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) this.take(item, now);
  }

  private take(item: Item<BallPacket, BallError>, now: number): void {
    if ("error" in item) {
      this.events.push({ event: "corrupt", error: item.error });
    } else if ("data" in item.message) {
      this.events.push({ event: "corrupt", error: { kind: "layout", expected: 8, found: item.message.data.length } });
    } else {
      this.packet(item.message, now);
    }
  }

  private packet(message: Values, now: number): void {
    const { poll } = this;
    if (poll.phase === "disconnected") {
      this.events.push({ event: "unexpected" });
    } else if (poll.phase === "idle" || now < poll.from || isDue(poll.until, now)) {
      this.events.push({ event: "unasked", message });
    } else {
      const until = this.proven;
      this.proven = poll.proof;
      this.poll = { phase: "idle", due: poll.due };
      if (message.status === "fresh" && now < until) {
        this.live = until;
        this.events.push({ event: "new", message, ...(until < NEVER ? { live_until: until } : {}) });
      } else {
        this.events.push({ event: "old", message });
      }
    }
  }
}

/** A poll is not sent while three outcomes have no room (IB-30). */
const NEEDED = 3;
const EVENT_PLACES = 8;
const OUTCOMES: ReadonlySet<string> = new Set(["new", "old", "missed", "stale"]);
