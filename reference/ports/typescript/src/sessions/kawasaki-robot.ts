/** The robot of kawasaki-msg (section 8): it asks for jobs, queues them for its motion program, and acknowledges them. */

import { Refused } from "../check.js";
import { Dialect, ahead, checkEnd, numberOf, phaseName, type GivenDialect, type Job, type Meaning, type MeaningError, type PhaseName, type Role, type ShownRole, type Values } from "../kawasaki-dialect.js";
import { MessageDecoder, type Message, type MessageError } from "../kawasaki-msg.js";
import { Packet } from "./kawasaki-packet.js";
import { JobQueue, type QueuedJob } from "./kawasaki-queue.js";
import { Events, NEVER, isDue, type Session, type Unexpected } from "./session.js";

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

const MS = 1e6;

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

type Cycle = { phase: "ready"; at: number; overdueAt: number } | { phase: "waiting"; notBefore: number; overdueAt: number; answered: boolean };

type Link =
  | { phase: "disconnected"; connectAt: number }
  | { phase: "connecting" }
  | { phase: "connected"; cycle: Cycle; silent: number; synced: boolean; statusAt: number };

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

const CYCLE = 2 * MS;
const LATEST_DATAGRAM = 1000 * MS;
const MOST_ENDED = 16;
const OF_THE_ROBOT: readonly Role[] = ["order_ack", "job_ack", "job_request", "pause", "end_ack"];

export class KawasakiRobot implements Session<KawasakiRobotEvent> {
  private link: Link = { phase: "disconnected", connectAt: 0 };
  private order: Order = null;
  private queued = 0;
  private executed = 0;
  private acknowledged = 0;
  /** Counts that are executed ahead of others, and those that are not acknowledged yet (individual). */
  private readonly ahead = new Set<number>();
  private readonly unacked = new Set<number>();
  private ended: { order: number; executed: number | null } | null = null;
  private replies = { status: false, pause: false, start: null as number | null, end: false };
  private ignoredUntil: number | null = null;
  private drained = false;
  private readonly endedOrders: number[] = [];
  private hasProgram = true;
  private opening = false;
  private closing = false;
  private readonly queue: JobQueue;
  private readonly dialect: Dialect;
  private readonly decoder: MessageDecoder;
  private readonly events = new Events<KawasakiRobotEvent>();
  private readonly config: KawasakiRobotConfig;

  constructor(given: Partial<KawasakiRobotConfig> = {}) {
    const { max_number = KAWASAKI_ROBOT_DEFAULTS.max_number } = given;
    this.config = { ...KAWASAKI_ROBOT_DEFAULTS, queue: Math.min(256, max_number - 1), ...given };
    const { acks, queue } = this.config;
    this.dialect = new Dialect(this.config);
    checkEnd(this.dialect, this.config, acks === "individual");
    if (acks === 0 || queue < 1 || queue >= max_number) throw new Refused("config", "acks of 0, no slot, or as many as there are numbers");
    this.queue = new JobQueue(queue);
    this.decoder = new MessageDecoder(this.dialect.charset);
  }

  connected(now: number): void {
    if (this.link.phase === "connected") this.lose();
    this.decoder.discard();
    this.link = {
      phase: "connected",
      cycle: { phase: "ready", at: now, overdueAt: now },
      silent: 0,
      synced: false,
      statusAt: now + this.config.status_period,
    };
    this.opening = false;
    this.replies.status = true;
    this.replies.start = null;
    this.acknowledged = this.executed;
    this.unacked.clear();
    for (const count of this.ahead) this.unacked.add(count);
    if (this.config.datagrams) this.ignoredUntil ??= now + LATEST_DATAGRAM;
    const { order } = this;
    if (order?.stage !== "intake") return;
    if (typeof order.flow === "object" && isDue(order.flow.heldUntil, now)) order.flow = "asking";
    order.gap = "rest";
  }

  disconnected(now: number): void {
    if (this.link.phase === "disconnected") return;
    if (this.link.phase === "connected") this.lose(now);
    this.link = { phase: "disconnected", connectAt: now + this.config.reconnect_delay };
  }

  input(bytes: Uint8Array, now: number): void {
    const { link } = this;
    if (link.phase !== "connected") {
      this.events.push({ event: "unexpected" });
      return;
    }
    this.decoder.push(bytes);
    if (this.config.datagrams) this.decoder.end();
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if (link.cycle.phase === "waiting") link.cycle.answered = true;
      if ("message" in item) {
        this.message(item.message, now);
      } else {
        this.events.push({ event: "corrupt", error: item.error });
        this.failed();
      }
    }
    this.allRead(link, now);
  }

  timeout(now: number): void {
    this.pass(now);
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    const { link } = this;
    if (link.phase !== "connected" || link.cycle.phase !== "ready" || !isDue(link.cycle.at, now)) return null;
    const packet = this.packet(link, now);
    const { order } = this;
    if (order?.stage === "intake" && order.flow === "asking" && order.until === null && this.executed === this.queued) {
      order.until = now + this.config.patience;
    }
    link.cycle = { phase: "waiting", notBefore: now + this.config.exchange, overdueAt: now + this.config.reply_timeout, answered: false };
    return packet.bytes;
  }

  event(): KawasakiRobotEvent | null {
    const event = this.events.take();
    if (event !== null) return event;
    if (this.closing) {
      this.closing = false;
      return { event: "disconnect" };
    }
    if (!this.opening) return null;
    this.opening = false;
    return { event: "connect" };
  }

  deadline(): number {
    const { link, order } = this;
    const times = [link.phase === "disconnected" ? link.connectAt : NEVER];
    if (link.phase === "connected") {
      times.push(link.cycle.phase === "ready" ? link.cycle.at : link.cycle.overdueAt);
      if (order?.stage === "intake") times.push(order.until ?? NEVER, typeof order.flow === "object" ? order.flow.heldUntil : NEVER);
    }
    if (order?.stage === "clearing" || order?.stage === "interrupted") times.push(order.reportedAt ?? NEVER);
    return Math.min(...times);
  }

  // The motion program and the operator

  /** Takes the oldest job, or that of a number. */
  take(number: number | null): QueuedJob {
    if (this.queue.taken !== undefined) throw new Refused("busy");
    const job = this.queue.find(number);
    if (job === undefined) throw new Refused(number === null ? "no_job" : "not_queued");
    job.taken = true;
    return job;
  }

  /** The job of a number is executed (KM-69). */
  report(number: number): void {
    const job = this.queue.unreported(number);
    const individual = this.config.acks === "individual";
    if (job === undefined || (!individual && job.count !== this.executed + 1)) throw new Refused("not_queued");
    job.reported = true;
    if (individual) this.unacked.add(job.count);
    this.ahead.add(job.count);
    while (this.ahead.delete(this.executed + 1)) this.executed += 1;
    this.queued = Math.max(this.queued, this.executed);
    if (this.order?.stage === "intake") {
      this.order.failures = 0;
      this.order.until = null;
    } else if (this.order?.stage === "clearing") {
      this.order.failures = 0;
    }
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
    this.queue.empty();
  }

  // Time

  private pass(now: number): void {
    const { link } = this;
    if (link.phase === "disconnected" && isDue(link.connectAt, now)) {
      this.link = { phase: "connecting" };
      this.opening = true;
    }
    const { order } = this;
    if (order?.stage === "intake" && link.phase === "connected") {
      if (typeof order.flow === "object" && isDue(order.flow.heldUntil, now)) order.flow = "asking";
      if (order.until !== null && isDue(order.until, now)) this.recover(order, now);
    }
    if (link.phase === "connected" && link.cycle.phase === "waiting" && isDue(link.cycle.overdueAt, now)) {
      link.cycle = { phase: "ready", at: now, overdueAt: now };
      link.silent += 1;
      this.events.push({ event: "no_reply" });
      if (this.config.silent_cycles > 0 && link.silent >= this.config.silent_cycles) this.closing = true;
    }
    this.look(now);
  }

  private get next(): number {
    return numberOf(this.queued + 1, this.config.max_number) ?? 1;
  }

  /** A step of the recovery (KM-73). */
  private recover(order: Intake & { number: number }, now: number): void {
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
  private look(now: number): void {
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

  private lose(now?: number): void {
    this.decoder.discard();
    this.closing = false;
    const { order } = this;
    if (order?.stage === "intake" && this.executed === this.queued) this.recover(order, now ?? 0);
  }

  /** What was read is understood (KM-50). */
  private allRead(link: Extract<Link, { phase: "connected" }>, now: number): void {
    const { cycle } = link;
    if (this.decoder.half) {
      if (cycle.phase === "ready" && now < cycle.overdueAt) {
        link.cycle = { phase: "waiting", notBefore: cycle.at, overdueAt: cycle.overdueAt, answered: true };
      }
    } else if (cycle.phase === "ready") {
      cycle.at = Math.max(cycle.at, Math.min(now + CYCLE, cycle.overdueAt));
    } else if (cycle.answered) {
      const at = Math.max(cycle.notBefore, Math.min(now + CYCLE, Math.max(now, cycle.overdueAt)));
      link.cycle = { phase: "ready", at, overdueAt: cycle.overdueAt };
      link.silent = 0;
      link.synced = true;
    }
  }

  // Packets (KM-52)

  private packet(link: Extract<Link, { phase: "connected" }>, now: number): Packet {
    const { replies, order, config } = this;
    const { max_number } = config;
    const packet = new Packet(this.dialect, config.limits.packet);
    const asks = order?.stage === "intake" && order.flow === "asking" && link.synced;
    const statusDue = replies.status || now >= link.statusAt;
    this.addAcks(packet, !statusDue && !replies.pause && replies.start === null && !replies.end && !asks);
    if (replies.start !== null && packet.add("order_ack", { order: replies.start })) replies.start = null;
    const acked = this.unacked.size === 0;
    if (replies.end && acked && this.ended !== null) {
      if (packet.add("end_ack", { ended: this.ended.order, order: order?.number ?? 0, executed: this.ended.executed })) replies.end = false;
    }
    if (statusDue && acked && packet.add("status", this.status())) {
      replies.status = false;
      link.statusAt = now + config.status_period;
    }
    if (replies.pause && packet.add("pause", { order: order?.number ?? 0, queued: numberOf(this.queued, max_number) })) replies.pause = false;
    if (asks && packet.add("job_request", { order: order.number, number: this.next })) {
      if (order.gap === "rest") order.gap = "asked";
      else if (order.gap === "end_once") order.gap = "asked_again";
    }
    if (packet.isEmpty) packet.add("filler", {});
    return packet;
  }

  private status(): Values {
    const { order } = this;
    const { max_number } = this.config;
    const phase = order === null ? 0 : { intake: 2, clearing: 2, ending: 3, interrupted: 4, alarm: 5 }[order.stage];
    return {
      order: order?.number ?? 0,
      phase,
      queued: numberOf(this.queued, max_number),
      executed: numberOf(this.executed, max_number),
      ended: this.ended?.order ?? null,
    };
  }

  private addAcks(packet: Packet, nothingElse: boolean): void {
    const order = this.order?.number ?? this.ended?.order ?? 0;
    const { max_number, acks } = this.config;
    const add = (count: number): boolean => packet.add("job_ack", { order, number: numberOf(count, max_number) });
    if (acks === "individual") {
      for (const count of [...this.unacked].sort((one, other) => one - other)) {
        if (!add(count)) return;
        this.unacked.delete(count);
      }
      return;
    }
    for (let count = this.acknowledged + 1; count <= this.executed; count += 1) {
      if (count % acks !== 0) continue;
      if (!add(count)) return;
      this.acknowledged = count;
    }
    if (this.acknowledged === this.executed || (this.executed !== this.queued && !nothingElse)) return;
    if (add(this.executed)) this.acknowledged = this.executed;
  }

  // Messages

  private message(message: Message, now: number): void {
    const read = this.dialect.read(message);
    if ("error" in read) {
      const { order } = this;
      const another = read.job?.order ?? order?.number ?? 0;
      if (order?.stage === "intake" && order.gap === "rest") return;
      // A job of another order is looked at no further (KM-64).
      if (order !== null && read.job !== undefined && another !== order.number) this.reject({ kind: "wrong_order", active: order.number, found: another });
      else this.reject(read.error);
      this.failed();
      return;
    }
    const { role } = read.meaning;
    if (OF_THE_ROBOT.includes(role)) {
      this.reject({ kind: "not_expected", role });
      return;
    }
    this.meaning(read.meaning, now);
  }

  private reject(error: RobotRejection): void {
    this.events.push({ event: "rejected", error });
  }

  /** A message fails: what follows it is destroyed up to the next request (KM-65). */
  private failed(): void {
    if (this.order?.stage === "intake") this.order.gap = "rest";
  }

  private meaning({ role, values, job = {} }: Meaning, now: number): void {
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
      default:
        if (role.startsWith("command_")) this.events.push({ event: "command", id: Number(role.slice(8)), value: values.value ?? null });
    }
  }

  /** The start of an order (KM-56, KM-57, KM-63). */
  private start(order: number, number: number, now: number): void {
    if (this.config.datagrams && !this.looksAtStarts(now)) return;
    this.replies.status = true;
    const active = this.order?.number ?? 0;
    if (this.order !== null) {
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
    if (order === 0 || number !== 1 || !this.hasProgram || old) {
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
      if (order.stage === "intake") order.gap = "end_once";
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
        if (order.flow !== "full") {
          order.flow = "full";
          this.replies.pause = true;
          this.events.push({ event: "queue_full", last: numberOf(this.queued, max_number) });
        }
        order.gap = "rest";
        return;
      } else {
        this.queued += 1;
        this.queue.add({ order: order.number, count: this.queued, number, job, taken: false, reported: false, freed: false });
      }
      order.gap = "closed";
      order.until = null;
    } else if (number === 0 || number > max_number) {
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
