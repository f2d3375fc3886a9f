/** What a host of VAL II ALTER is given, and what it reports. */

import type { AlterError, End, Framing, Motion, Start } from "../val2-alter.js";
import type { Limits } from "./alter-limiter.js";
import type { Unexpected } from "./session.js";

export type Policy = "accept" | "refuse" | "ignore";

/** Times are in ns. */
export interface AlterHostConfig {
  framing: Partial<Framing>;
  baud: number;
  mode: number;
  limits: Limits;
  /** ALTER names an exception subroutine. */
  subroutine: boolean;
  policy: Policy;
  repeats: number;
  /** cycles of 28 ms */
  silence_cycles: number;
  gap: number;
  target_timeout: number;
  reserve: number;
  max_delay: number;
}

export const ALTER_HOST_DEFAULTS: AlterHostConfig = {
  framing: {},
  baud: 38400,
  mode: 23,
  limits: { velocity: [90, 90, 90, 150, 150, 150], acceleration: [9, 9, 9, 15, 15, 15] },
  subroutine: false,
  policy: "accept",
  repeats: 2,
  silence_cycles: 4,
  gap: 4e6,
  target_timeout: 200e6,
  reserve: 1e6,
  max_delay: 10e6,
};

export type Outcome = "done" | "not_done" | { unknown: "ended" | "out_of_sequence" | "unclear" };

export type AlterHostEvent =
  | { event: "start"; message: Start }
  | { event: "motion"; message: Motion }
  | { event: "end"; message: End }
  | { event: "lost"; reason: "disconnected" | "restart" | "silence" }
  | { event: "exception"; exception: number; outcome: Outcome }
  | { event: "stopped" | "missed" | "delayed" | "target_stale" }
  | { event: "rejected"; error: number }
  | { event: "corrupt"; error: AlterError }
  | Unexpected;
