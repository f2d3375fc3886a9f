/** The ISRA ball itself (section 8). */

import { POLL, encodePacket, type Values } from "../isra-ball.js";
import { integer } from "../check.js";
import { Events, NEVER, type Session, type Unexpected } from "./session.js";

export interface BallConfig {
  /** 0..=7 */
  sensor_type: number;
  /** 0..=7 */
  sensor: number;
}

export type BallEvent = { event: "reply"; message: Values } | { event: "ignored" } | { event: "unknown"; byte: number } | Unexpected;

/** What the sensor measures, in its units. */
export type Measurement = Pick<Values, "force" | "moment" | "keys">;

export class Ball implements Session<BallEvent> {
  private link: "disconnected" | "ready" | "replying" = "disconnected";
  private values: Measurement = { force: [0, 0, 0], moment: [0, 0, 0], keys: 0 };
  /** The sensor has values that were not sent. */
  private isNew = false;
  private readonly events = new Events<BallEvent>();
  private readonly config: BallConfig;

  constructor(config: Partial<BallConfig> = {}) {
    this.config = { sensor_type: 0, sensor: 0, ...config };
    integer(this.config.sensor_type, 0, 7, "config");
    integer(this.config.sensor, 0, 7, "config");
  }

  connected(): void {
    this.link = "ready";
  }

  disconnected(): void {
    this.link = "disconnected";
  }

  /** The sensor has measured; refuses values that a packet cannot hold. */
  measure(values: Measurement): void {
    encodePacket(this.packet(values));
    this.values = values;
    this.isNew = true;
  }

  input(bytes: Uint8Array): void {
    for (const byte of bytes) {
      if (byte !== POLL) this.events.push({ event: "unknown", byte });
      else if (this.link === "disconnected") this.events.push({ event: "unexpected" });
      else if (this.link === "replying") this.events.push({ event: "ignored" });
      else this.link = "replying";
    }
  }

  timeout(): void {}

  transmitted(): void {}

  transmit(): Uint8Array | null {
    if (this.link !== "replying") return null;
    const message = this.packet(this.values);
    this.link = "ready";
    this.isNew = false;
    this.events.push({ event: "reply", message });
    return encodePacket(message);
  }

  event(): BallEvent | null {
    return this.events.take();
  }

  deadline(): number {
    return NEVER;
  }

  private packet(values: Measurement): Values {
    const { force, moment, keys } = values;
    return { ...this.config, status: this.isNew ? "fresh" : "old", force, moment, keys };
  }
}
