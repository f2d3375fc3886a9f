/** What a PC of kawasaki-msg is given, and what it reports. */

import type { FieldFault, GivenDialect, Job, MeaningError, PhaseName, ShownRole } from "../kawasaki-dialect.js";
import type { MessageError } from "../kawasaki-msg.js";
import type { Unexpected } from "./session.js";

/** Times are in ns. */
export interface KawasakiPcConfig extends GivenDialect {
  limits: { element: number; packet: number };
  datagrams: boolean;
  max_number: number;
  cumulative_acks: boolean;
  reply_delay: number;
  silence: number;
  takeover: "never" | "end" | "interrupt";
  start_retries: number;
  end_when_done: boolean;
}

const SECOND = 1e9;

export const KAWASAKI_PC_DEFAULTS: KawasakiPcConfig = {
  limits: { element: 255, packet: 4096 },
  datagrams: false,
  max_number: 9999,
  cumulative_acks: true,
  reply_delay: 2e6,
  silence: 10 * SECOND,
  takeover: "interrupt",
  start_retries: 10,
  end_when_done: true,
};

export type PcRejection =
  | MeaningError
  | { kind: "not_expected"; role: ShownRole }
  | { kind: "wrong_order"; active: number; found: number }
  | { kind: "out_of_order"; expected: number; found: number };

export type KawasakiPcEvent =
  | { event: "disconnect" }
  | { event: "order_over"; order: number; executed: number; complete: boolean }
  | { event: "outcome_unknown"; order: number; executed: number; sent: number }
  | { event: "order_refused"; order: number; active: number; given_up: boolean }
  | { event: "job_unfit"; order: number; index: number; error: { field: string; fault: FieldFault } }
  | { event: "command"; id: number; value: number; outcome: "transmitted" | "unknown" }
  | { event: "progress"; executed: number; queued: number }
  | { event: "order_started"; order: number }
  | { event: "executed_ahead"; index: number }
  | { event: "paused"; queued: number }
  | { event: "peer_status"; order: number; phase: PhaseName; queued: number | null; executed: number | null }
  | { event: "corrupt"; error: MessageError }
  | { event: "rejected"; error: PcRejection }
  | Unexpected;

export interface OrderRequest {
  order: number;
  jobs: Job[];
  /** More jobs may come. */
  open?: boolean;
}

/** What a PC that was killed goes on from (KM-128). */
export interface ResumeRequest extends OrderRequest {
  executed: number;
  sent: number;
  /** Places of jobs, from 0, that are executed ahead of others. */
  ahead?: number[];
}
