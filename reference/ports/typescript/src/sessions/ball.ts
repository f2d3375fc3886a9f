/** The ISRA ball itself (section 8). */

import { POLL, encodePacket, type Values } from "../isra-ball.js";
import { integer } from "../check.js";
import { Echo, type EchoEvent } from "./echo.js";
import { Events, NEVER, type Session, type Unexpected } from "./session.js";

export interface BallConfig {
  /** 0..=7 */
  sensor_type: number;
  /** 0..=7 */
  sensor: number;
  /** The line returns what is sent. */
  echo: boolean;
}

export type BallEvent = { event: "reply"; message: Values } | { event: "ignored" } | { event: "unknown"; byte: number } | EchoEvent | Unexpected;

/** What the sensor measures, in its units. */
export type Measurement = Pick<Values, "force" | "moment" | "keys">;

export class Ball implements Session<BallEvent> {
  private link: "disconnected" | "ready" | "replying" = "disconnected";
  private values: Measurement = { force: [0, 0, 0], moment: [0, 0, 0], keys: 0 };
  /** The sensor has values that were not sent. */
  private isNew = false;
  private echo = new Echo(false);
  private readonly events = new Events<BallEvent>();
  private readonly config: BallConfig;

  constructor(config: Partial<BallConfig> = {}) {
    this.config = { sensor_type: 0, sensor: 0, echo: false, ...config };
    integer(this.config.sensor_type, 0, 7, "config");
    integer(this.config.sensor, 0, 7, "config");
  }

  connected(): void {
    this.link = "ready";
    this.echo = new Echo(this.config.echo);
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
    for (const byte of this.echo.remove(bytes, this.events)) {
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
    const packet = encodePacket(message);
    this.echo.sent(packet, true);
    return packet;
  }

  event(): BallEvent | null {
    return this.events.take();
  }

  deadline(): number {
    return NEVER;
  }

  private packet(values: Measurement): Values {
    const { sensor_type, sensor } = this.config;
    const { force, moment, keys } = values;
    return { sensor_type, sensor, status: this.isNew ? "fresh" : "old", force, moment, keys };
  }
}
