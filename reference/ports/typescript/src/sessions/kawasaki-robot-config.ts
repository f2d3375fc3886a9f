/** What a robot of kawasaki-msg is given, and what it reports. */

import type { GivenDialect, MeaningError, PhaseName, ShownRole } from "../kawasaki-dialect.js";
import type { MessageError } from "../kawasaki-msg.js";
import type { Unexpected } from "./session.js";

/** Times are in ns. */
export interface KawasakiRobotConfig extends GivenDialect {
  limits: { element: number; packet: number };
  datagrams: boolean;
  max_number: number;
  /** Every Nth job is acknowledged, or each individually. */
  acks: number | "individual";
  low_water: number | null;
  recovery: { resends: number; pauses: number; clears: number };
  patience: number;
  pause: number;
  reply_timeout: number;
  exchange: number;
  silent_cycles: number;
  reconnect_delay: number;
  status_period: number;
  refuse_repeated_start: boolean;
  end_foreign_order: boolean;
  /** Slots of the queue. */
  queue: number;
}

export const MS = 1e6;

export const KAWASAKI_ROBOT_DEFAULTS: Omit<KawasakiRobotConfig, "queue"> = {
  limits: { element: 255, packet: 4096 },
  datagrams: false,
  max_number: 9999,
  acks: 1,
  low_water: null,
  recovery: { resends: 3, pauses: 3, clears: 1 },
  patience: 1000 * MS,
  pause: 500 * MS,
  reply_timeout: 1000 * MS,
  exchange: 32 * MS,
  silent_cycles: 5,
  reconnect_delay: 1000 * MS,
  status_period: 1000 * MS,
  refuse_repeated_start: true,
  end_foreign_order: false,
};

export type RobotRejection =
  | MeaningError
  | { kind: "not_expected"; role: ShownRole }
  | { kind: "wrong_order"; active: number; found: number }
  | { kind: "out_of_order" | "repeated"; expected: number; found: number }
  | { kind: "jobs_missing"; order: number; expected: number }
  | { kind: "queue_full"; number: number };

export type KawasakiRobotEvent =
  | { event: "connect" | "disconnect" | "no_reply" }
  | { event: "order_started" | "order_ending" | "order_interrupted"; order: number }
  | { event: "order_over"; order: number; executed: number }
  | { event: "alarm"; order: number; next: number }
  | { event: "command"; id: number; value: number | null }
  | { event: "order_refused"; order: number; active: number }
  | { event: "peer_status"; order: number; phase: PhaseName; sent: number | null; executed: number | null }
  | { event: "queue_full"; last: number | null }
  | { event: "queue_drained" | "queue_cleared"; next: number }
  | { event: "recovery"; step: "resend" | "pause" | "clear"; next: number }
  | { event: "corrupt"; error: MessageError }
  | { event: "rejected"; error: RobotRejection }
  | Unexpected;
