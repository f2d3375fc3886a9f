/** The order of a robot of kawasaki-msg (sections 8.4 to 8.7): its jobs, what its motion program reports, and what the PC's messages change. */

import { Refused } from "../check.js";
import { Dialect, ahead, checkEnd, numberAfter, numberOf, phaseName, shownRole, type Job, type Meaning } from "../kawasaki-dialect.js";
import { JobQueue, type QueuedJob } from "./kawasaki-queue.js";
import { KAWASAKI_ROBOT_DEFAULTS, MS, type KawasakiRobotConfig, type KawasakiRobotEvent, type RobotRejection } from "./kawasaki-robot-config.js";
import { KawasakiEvents } from "./kawasaki-events.js";
import { isDue } from "./session.js";

type Gap = "closed" | "rest" | "asked" | "end_once" | "asked_again";

interface Intake {
  stage: "intake";
  flow: "asking" | "full" | { heldUntil: number };
  gap: Gap;
  failures: number;
  /** Of the recovery; null is resting. */
  until: number | null;
}

type Stage =
  | Intake
  | { stage: "clearing"; failures: number; reportedAt: number | null }
  | { stage: "interrupted"; reportedAt: number | null }
  | { stage: "ending" | "alarm" };

type Order = (Stage & { number: number }) | null;

/** The motion program looks at its queue so often. */
export const CYCLE = 2 * MS;
const MOST_ENDED = 16;
/** Outcomes that there has to be room for (KM-81). */
const ROOM = { clear: 5, start: 10, command: 11 };
const OUTCOMES = ["order_started", "order_ending", "order_interrupted", "order_over", "alarm", "command"];

/** What the session of a robot is built on. */
export class RobotOrder {
  protected order: Order = null;
  protected queued = 0;
  protected executed = 0;
  protected acknowledged = 0;
  /** Counts that are executed ahead of others, and those that are not acknowledged yet (individual). */
  protected readonly ahead = new Set<number>();
  protected readonly unacked = new Set<number>();
  protected ended: { order: number; executed: number | null } | null = null;
  protected replies = { status: false, pause: false, start: null as number | null, end: false };
  protected ignoredUntil: number | null = null;
  /** Packets of the connection that were not answered in time, less the ends that came late for them (KM-66). */
  protected unanswered = 0;
  private drained = false;
  private readonly endedOrders: number[] = [];
  private hasProgram = true;
  private readonly queue: JobQueue;
  protected readonly dialect: Dialect;
  protected readonly events = new KawasakiEvents<KawasakiRobotEvent>((event) => OUTCOMES.includes(event.event));
  protected readonly config: KawasakiRobotConfig;

  constructor(given: Partial<KawasakiRobotConfig> = {}) {
    const { max_number = KAWASAKI_ROBOT_DEFAULTS.max_number } = given;
    this.config = { ...KAWASAKI_ROBOT_DEFAULTS, queue: Math.min(256, max_number - 1), ...given };
    const { acks, queue } = this.config;
    this.dialect = new Dialect(this.config);
    checkEnd(this.dialect, this.config, acks === "individual");
    if (acks === 0 || queue < 1 || queue >= max_number) throw new Refused("config", "acks of 0, no slot, or as many as there are numbers");
    this.queue = new JobQueue(queue);
  }

  // The motion program and the operator

  /** Takes the oldest job, or that of a number. */
  take(number: number | null): QueuedJob {
    if (this.queue.taken !== undefined) throw new Refused("busy");
    const job = this.queue.find(number);
    if (job === undefined) throw new Refused("no_job");
    job.taken = true;
    return job;
  }

  /** The job of a number is executed (KM-69). */
  report(number: number): void {
    const job = this.queue.unreported(number);
    const individual = this.config.acks === "individual";
    if (job === undefined || job.count > this.queued || (!individual && job.count !== this.executed + 1)) throw new Refused("not_queued");
    job.reported = true;
    if (individual) this.unacked.add(job.count);
    this.ahead.add(job.count);
    while (this.ahead.delete(this.executed + 1)) this.executed += 1;
    this.queued = Math.max(this.queued, this.executed);
    if (this.order?.stage === "intake") this.order.failures = 0;
  }

  /** The slot of the job that was taken is free. */
  complete(): void {
    const job = this.queue.taken;
    if (job === undefined) throw new Refused("no_job");
    this.queue.free(job);
  }

  /** Clear the list (KM-71). */
  clearQueue(): void {
    const { order } = this;
    if (order === null || (order.stage !== "intake" && order.stage !== "alarm")) throw new Refused("no_order");
    if (!this.events.hasRoom(ROOM.clear)) throw new Refused("too_many_events");
    if (order.stage === "alarm") this.replies.status = true;
    this.clearList(0);
  }

  /** Forget the order (KM-71). */
  resetOrder(): void {
    if (this.order === null || this.order.stage === "interrupted") throw new Refused("no_order");
    this.interruptOrder();
  }

  /** The motion program is gone. */
  abandon(): void {
    this.hasProgram = false;
  }

  // The list, and its recovery

  protected get next(): number {
    return numberAfter(this.queued, this.config.max_number);
  }

  /** A step of the recovery (KM-73). */
  protected recover(order: Intake & { number: number }, now: number): void {
    const { resends, pauses, clears } = this.config.recovery;
    const { next } = this;
    const n = order.failures + 1;
    order.failures = n;
    order.until = null;
    if (n <= resends) {
      this.events.push({ event: "recovery", step: "resend", next });
    } else if (n <= resends + pauses) {
      order.flow = { heldUntil: now + this.config.pause };
      this.replies.pause = true;
      this.events.push({ event: "recovery", step: "pause", next });
    } else if (n <= resends + pauses + clears) {
      this.events.push({ event: "recovery", step: "clear", next });
      this.clearList(n);
    } else {
      this.order = { number: order.number, stage: "alarm" };
      this.replies.status = true;
      this.events.push({ event: "alarm", order: order.number, next });
    }
  }

  private clearList(failures: number): void {
    if (this.order === null) return;
    this.order = { number: this.order.number, stage: "clearing", failures, reportedAt: null };
    this.queue.clear();
  }

  /** A look at the queue (KM-70, KM-72). */
  protected look(now: number): void {
    const { order, config } = this;
    if (order === null) return;
    if (order.stage === "clearing" || order.stage === "interrupted") {
      if (this.queue.taken !== undefined && this.hasProgram) return;
      order.reportedAt ??= now + CYCLE;
      if (!isDue(order.reportedAt, now)) return;
      if (order.stage === "interrupted") {
        this.over();
        return;
      }
      this.queued = this.executed;
      this.order = { number: order.number, stage: "intake", flow: "asking", gap: "rest", failures: order.failures, until: null };
      this.events.push({ event: "queue_cleared", next: this.next });
    } else if (order.stage === "ending") {
      if (this.executed === this.queued) this.over();
    } else if (order.stage === "intake" && order.flow === "full" && this.queue.size <= (config.low_water ?? Math.floor(config.queue / 2))) {
      order.flow = "asking";
      this.events.push({ event: "queue_drained", next: this.next });
    }
  }

  private over(): void {
    const { order } = this;
    if (order === null) return;
    // The end_ack covers what the order has executed.
    this.acknowledged = this.executed;
    this.order = null;
    this.queued = this.executed;
    this.ended = { order: order.number, executed: numberOf(this.executed, this.config.max_number) };
    this.endedOrders.push(order.number);
    if (this.endedOrders.length > MOST_ENDED) this.endedOrders.shift();
    this.replies = { ...this.replies, status: true, end: true, pause: false };
    this.events.push({ event: "order_over", order: order.number, executed: this.executed });
  }

  // What comes

  protected reject(error: RobotRejection): void {
    this.events.push({ event: "rejected", error });
  }

  /** A message fails: what follows it is destroyed up to the next request (KM-65). */
  protected failed(): void {
    if (this.order?.stage === "intake") this.order.gap = "rest";
  }

  protected meaning({ role, values, job = {} }: Meaning, now: number): void {
    const active = this.order?.number ?? 0;
    const order = values.order ?? active;
    const ours = this.order !== null && order === this.order.number;
    switch (role) {
      case "order_start":
        this.start(order, values.number ?? 1, now);
        break;
      case "job":
        this.job(order, values.number ?? 0, job);
        break;
      case "order_end":
        if (ours) this.endOrder();
        else this.foreignEnd(order);
        break;
      case "order_interrupt":
        if (!ours) this.foreignEnd(order);
        else if (this.order?.stage !== "interrupted") this.interruptOrder();
        break;
      case "status": {
        const { queued: sent = null, executed = null, phase } = values;
        this.events.push({ event: "peer_status", order, phase: phaseName(phase ?? 0), sent, executed });
        if (this.config.end_foreign_order && this.order !== null && !ours && this.order.stage !== "interrupted") this.interruptOrder();
        break;
      }
      case "filler":
        break;
      default: {
        const shown = shownRole(role);
        if (typeof shown === "object" && this.events.hasRoom(ROOM.command)) this.events.push({ event: "command", id: shown.command, value: values.value ?? null });
        else this.reject({ kind: "not_expected", role: shown });
      }
    }
  }

  /** The start of an order (KM-56, KM-57, KM-63). */
  private start(order: number, number: number, now: number): void {
    if (this.config.datagrams && !this.looksAtStarts(now)) return;
    this.replies.status = true;
    if (this.order !== null) {
      const active = this.order.number;
      const again = order === active;
      if (again && this.queued === 0 && number === 1) {
        this.replies.start = active;
        return;
      }
      this.replies.start = again && this.config.refuse_repeated_start ? 0 : active;
      this.events.push({ event: "order_refused", order, active });
      return;
    }
    const old = this.config.datagrams && this.endedOrders.includes(order);
    if (order === 0 || number !== 1 || !this.hasProgram || old || !this.events.hasRoom(ROOM.start)) {
      this.replies.start = 0;
      if (order !== 0 && number !== 1) this.reject({ kind: "out_of_range", field: this.dialect.placeOfNumber("order_start"), found: number, min: 1, max: 1 });
      else this.events.push({ event: "order_refused", order, active: 0 });
      return;
    }
    this.order = { number: order, stage: "intake", flow: "asking", gap: "closed", failures: 0, until: null };
    this.queued = this.executed = this.acknowledged = 0;
    this.ahead.clear();
    this.unacked.clear();
    this.replies.start = order;
    this.events.push({ event: "order_started", order });
  }

  /** Starts may have waited to be read (KM-63). */
  private looksAtStarts(now: number): boolean {
    if (this.ignoredUntil !== null && now < this.ignoredUntil) return false;
    if (this.drained) return true;
    this.drained = true;
    this.ignoredUntil = now + this.config.exchange;
    return false;
  }

  private endOrder(): void {
    const { order } = this;
    if (order === null) return;
    if (order.stage === "clearing" || (order.stage === "intake" && (order.gap === "asked" || order.gap === "end_once"))) {
      this.reject({ kind: "jobs_missing", order: order.number, expected: this.next });
      if (order.stage === "intake") {
        if (this.unanswered > 0) this.unanswered -= 1;
        else order.gap = "end_once";
      }
      return;
    }
    if (order.stage !== "alarm" && (order.stage !== "intake" || order.gap === "rest")) return;
    this.order = { number: order.number, stage: "ending" };
    this.replies.status = true;
    this.events.push({ event: "order_ending", order: order.number });
  }

  private foreignEnd(order: number): void {
    if (this.ended !== null && this.ended.order === order) this.replies.end = true;
    else this.replies.status = true;
  }

  private interruptOrder(): void {
    if (this.order === null) return;
    const { number } = this.order;
    this.order = { number, stage: "interrupted", reportedAt: null };
    this.replies.status = true;
    this.events.push({ event: "order_interrupted", order: number });
    this.queue.clear();
  }

  /** A job (KM-64). */
  private job(named: number, number: number, job: Job): void {
    const { order } = this;
    if (order?.stage === "intake" && order.gap === "rest") return;
    if (order === null && named === 0) {
      this.reject({ kind: "not_expected", role: "job" });
    } else if (order === null || named !== order.number) {
      this.reject({ kind: "wrong_order", active: order?.number ?? 0, found: named });
      this.failed();
    } else if (order.stage !== "intake") {
      this.reject({ kind: "not_expected", role: "job" });
    } else {
      this.ownJob(order, number, job);
    }
  }

  private ownJob(order: Intake & { number: number }, number: number, job: Job): void {
    const { max_number } = this.config;
    const { next: expected } = this;
    if (number === expected) {
      if (this.ahead.has(this.queued + 1)) {
        this.queued += 1;
      } else if (this.queue.isFull) {
        this.reject({ kind: "queue_full", number });
        order.flow = "full";
        this.replies.pause = true;
        this.events.push({ event: "queue_full", last: numberOf(this.queued, max_number) });
        order.gap = "rest";
        return;
      } else {
        this.queued += 1;
        this.queue.add({ order: order.number, count: this.queued, number, job, taken: false, reported: false, freed: false });
      }
      order.gap = "closed";
      order.until = null;
    } else if (number > max_number) {
      this.reject({ kind: "out_of_range", field: this.dialect.placeOfNumber("job"), found: number, min: 1, max: max_number });
      order.gap = "rest";
    } else {
      const far = ahead(this.queued, number, max_number);
      const missing = far >= 2 && far <= Math.floor(max_number / 2);
      this.reject({ kind: missing ? "out_of_order" : "repeated", expected, found: number });
      if (missing) order.gap = "rest";
    }
  }
}
