/** The order of a PC of kawasaki-msg (sections 9.2 to 9.4): what its owner asks, and what the robot's messages change. */

import { Refused } from "../check.js";
import { Dialect, ahead, checkEnd, numberAfter, phaseName, shownRole, type Job, type Meaning, type Values } from "../kawasaki-dialect.js";
import { KAWASAKI_PC_DEFAULTS, type KawasakiPcConfig, type KawasakiPcEvent, type OrderRequest, type PcRejection, type ResumeRequest } from "./kawasaki-pc-config.js";
import { KawasakiEvents } from "./kawasaki-events.js";
import { require } from "./session.js";

type StartState = { kind: "unsent" | "lost" } | { kind: "sent"; answerBy: number } | { kind: "foreign"; order: number };

type Order =
  | { phase: "idle" }
  | { phase: "starting"; number: number; start: StartState; refusals: number; cancelled: boolean }
  | { phase: "running"; number: number; stage: "active" | "ending" | "interrupted"; leftAt: number | null };

type Running = Extract<Order, { phase: "running" }>;
type Starting = Extract<Order, { phase: "starting" }>;

/** What an answer has to hold. */
interface Contents {
  status: boolean;
  jobsFrom: number | null;
}

/** A datagram may come so much later (KM-9). */
export const LATEST_DATAGRAM = 1e9;
/** Outcomes that there has to be room for (KM-120). */
export const ROOM = 6;
const OUTCOMES = ["order_over", "outcome_unknown", "job_unfit", "command"];

/** What the session of a PC is built on. */
export class PcOrder {
  protected contents: Contents = { status: false, jobsFrom: null };
  /** The order that the robot said it is in on this connection. */
  protected robot: number | null = null;
  protected order: Order = { phase: "idle" };
  protected executed = 0;
  protected queued = 0;
  protected sent = 0;
  protected total: number | null = null;
  /** Counts of jobs that are executed ahead of others. */
  private readonly ahead = new Set<number>();
  private unsure = false;
  protected jobs: Job[] = [];
  protected open = false;
  protected progress = false;
  protected readonly dialect: Dialect;
  protected readonly events = new KawasakiEvents<KawasakiPcEvent>((event) => OUTCOMES.includes(event.event) || ("given_up" in event && event.given_up));
  protected readonly config: KawasakiPcConfig;

  constructor(given: Partial<KawasakiPcConfig> = {}) {
    this.config = { ...KAWASAKI_PC_DEFAULTS, ...given };
    const { cumulative_acks, takeover, silence } = this.config;
    this.dialect = new Dialect(this.config);
    checkEnd(this.dialect, this.config, !cumulative_acks);
    require(takeover !== "interrupt" || this.dialect.has("order_interrupt"), "no order_interrupt to take over with (KM-122)");
    require(silence > 0, "a silence of 0");
    require(["never", "end", "interrupt"].includes(takeover), "no such takeover");
  }

  // The owner (KM-112 to KM-114, KM-118, KM-128)

  start({ order, jobs, open = false }: OrderRequest): void {
    this.begin(order, jobs, open, 0, 0);
    const start: StartState = this.robot === order ? { kind: "foreign", order } : { kind: "unsent" };
    this.order = { phase: "starting", number: order, start, refusals: 0, cancelled: false };
  }

  resume({ order, jobs, open = false, executed, sent, ahead: done = [] }: ResumeRequest): void {
    if (sent < executed || sent - executed > this.window) throw new Refused("not_in_flight");
    this.begin(order, jobs, open, executed, sent);
    if (!open && jobs.length <= sent) this.total = sent;
    for (const index of done) if (!this.config.cumulative_acks && index < sent) this.ahead.add(index + 1);
    this.unsure = true;
    this.order = { phase: "running", number: order, stage: "active", leftAt: null };
  }

  private begin(order: number, jobs: Job[], open: boolean, executed: number, sent: number): void {
    if (this.order.phase !== "idle") throw new Refused("order_active");
    if (!this.events.hasRoom(ROOM)) throw new Refused("too_many_events");
    if (order < 1 || order > 0xffff) throw new Refused("order_zero");
    this.jobs = [...jobs];
    this.open = open;
    this.executed = this.queued = executed;
    this.sent = sent;
    this.total = null;
    this.ahead.clear();
    this.unsure = false;
    this.progress = false;
  }

  /** Jobs behind those of the order. */
  add(jobs: Job[]): void {
    if (this.order.phase === "idle" || !this.open) throw new Refused("no_order");
    this.jobs.push(...jobs);
  }

  /** No more jobs come. */
  close(): void {
    if (this.order.phase === "idle") throw new Refused("no_order");
    this.open = false;
  }

  end(): void {
    if (this.order.phase !== "running" || this.order.stage !== "active") throw new Refused("no_order");
    this.order.stage = "ending";
  }

  interrupt(): void {
    const { order } = this;
    if (!this.dialect.has("order_interrupt")) throw new Refused("lacks");
    if (order.phase === "running" && order.stage !== "interrupted") {
      order.stage = "interrupted";
    } else if (order.phase === "starting" && !order.cancelled) {
      if (order.start.kind === "unsent" || order.start.kind === "foreign") this.over();
      else order.cancelled = true;
    } else {
      throw new Refused("no_order");
    }
  }

  protected get window(): number {
    const { datagrams, max_number } = this.config;
    return datagrams ? Math.floor(max_number / 2) : max_number - 1;
  }

  protected get number(): number {
    return this.order.phase === "idle" ? 0 : this.order.number;
  }

  // What comes

  protected reject(error: PcRejection): void {
    this.events.push({ event: "rejected", error });
  }

  /** With individual acknowledgement something may be lost (KM-110). */
  protected meansNothing(): void {
    if (this.order.phase === "running") this.unsure = true;
  }

  protected meaning({ role, values }: Meaning, now: number): void {
    const order = values.order ?? (role === "end_ack" ? 0 : this.number);
    const { order: ours } = this;
    switch (role) {
      case "job_ack":
        if (ours.phase !== "running" || order !== ours.number) this.wrongOrder(order);
        else this.jobAck(values.number ?? 0, ours);
        break;
      case "pause":
        if (ours.phase !== "running" || order !== ours.number) this.wrongOrder(order);
        else this.paused(values.queued, ours);
        break;
      case "job_request":
        if (ours.phase === "idle" || (ours.phase === "running" && order !== ours.number)) this.wrongOrder(order);
        else if (ours.phase === "running") this.request(values.number ?? 0, ours);
        break;
      case "order_ack":
        if (ours.phase !== "starting" || ours.start.kind !== "sent") break;
        if (order === ours.number) this.accepted(ours);
        else this.refusedBy(order, ours);
        break;
      case "end_ack":
        this.robot = order;
        this.endAck(values.ended ?? null, order, values.executed ?? null);
        break;
      case "status":
        this.robot = order;
        this.contents.status = true;
        this.peerStatus(order, values, now);
        break;
      case "filler":
        break;
      default:
        this.reject({ kind: "not_expected", role: shownRole(role) });
    }
  }

  private wrongOrder(found: number): void {
    this.reject({ kind: "wrong_order", active: this.number, found });
  }

  /** The count of a number of the robot's, or of none; null, if it means nothing (KM-99). */
  private countOf(number: number | null): number | null {
    const { max_number } = this.config;
    if (number === null) return this.executed;
    const count = this.executed + ahead(this.executed, number, max_number);
    return number <= max_number && count <= this.sent ? count : null;
  }

  /** The same of a job that is executed: what means nothing is rejected. */
  private executedOf(number: number | null): number | null {
    const count = this.countOf(number);
    if (count === null) this.outOfOrder(this.executed, number);
    return count;
  }

  private outOfOrder(count: number, found: number | null): void {
    this.reject({ kind: "out_of_order", expected: numberAfter(count, this.config.max_number), found: found ?? 0 });
  }

  private counts(executed: number, queued: number): void {
    let done = this.executed;
    while (done < executed || this.ahead.has(done + 1)) {
      done += 1;
      this.ahead.delete(done);
    }
    const last = Math.max(queued, done);
    if (done !== this.executed || last !== this.queued) this.progress = true;
    this.executed = done;
    this.queued = last;
  }

  private jobAck(number: number, ours: Running): void {
    ours.leftAt = null;
    const count = this.executedOf(number);
    if (count === null) return;
    if (this.config.cumulative_acks || count <= this.executed + 1) {
      this.counts(count, this.queued);
    } else if (!this.ahead.has(count)) {
      this.ahead.add(count);
      this.events.push({ event: "executed_ahead", index: count - 1 });
    }
  }

  private paused(number: number | null | undefined, ours: Running): void {
    ours.leftAt = null;
    const count = this.countOf(number ?? null) ?? this.queued;
    this.counts(this.executed, count);
    this.events.push({ event: "paused", queued: count });
  }

  /** The robot asks for the jobs from a number on (KM-101). */
  private request(number: number, ours: Running): void {
    ours.leftAt = null;
    if (ours.stage !== "active") return;
    const { max_number } = this.config;
    const from = this.executed + ((ahead(this.executed, number, max_number) - 1 + max_number) % max_number);
    if (number <= max_number && from <= this.sent) {
      this.counts(this.executed, from);
      this.contents.jobsFrom = from;
    } else if (this.sent === 0) {
      const starting: Starting = { phase: "starting", number: ours.number, start: { kind: "unsent" }, refusals: 0, cancelled: false };
      this.order = starting;
      this.refusedBy(ours.number, starting);
    } else {
      this.outOfOrder(this.sent, number);
    }
  }

  private accepted({ number, cancelled }: Starting): void {
    this.order = { phase: "running", number, stage: cancelled ? "interrupted" : "active", leftAt: null };
    this.events.push({ event: "order_started", order: number });
  }

  /** The start is refused by an order, or by none (KM-105). */
  private refusedBy(active: number, ours: Starting): void {
    if (ours.cancelled) {
      this.over();
      return;
    }
    if (active === 0) ours.refusals += 1;
    const given_up = active === 0 ? ours.refusals > this.config.start_retries : this.config.takeover === "never";
    ours.start = active === 0 ? { kind: "unsent" } : { kind: "foreign", order: active };
    if (given_up) this.order = { phase: "idle" };
    this.events.push({ event: "order_refused", order: ours.number, active, given_up });
  }

  private endAck(ended: number | null, active: number, executed: number | null): void {
    const { order } = this;
    if (order.phase === "starting" && order.start.kind === "foreign" && order.start.order !== active) order.start = { kind: "unsent" };
    if (order.phase !== "running" || ended !== order.number || active === order.number) return;
    const count = this.executedOf(executed);
    if (count === null) return;
    this.counts(count, this.queued);
    this.over();
  }

  private peerStatus(order: number, values: Values, now: number): void {
    const { queued = null, executed = null, phase } = values;
    const code = phase ?? 0;
    this.events.push({ event: "peer_status", order, phase: phaseName(code), queued, executed });
    const { order: ours } = this;
    if (ours.phase === "starting") this.statusInStarting(order, queued !== null || executed !== null || code !== 2, ours);
    if (ours.phase !== "running") return;
    if (order === ours.number) this.ownStatus(queued, executed, ours);
    else this.left(order, executed, values.ended ?? 0, ours, now);
  }

  /** The first line of KM-107 that applies. */
  private statusInStarting(order: number, begun: boolean, ours: Starting): void {
    const { start } = ours;
    if (start.kind === "foreign") {
      if (order !== start.order) ours.start = { kind: "unsent" };
      else if (this.config.takeover === "never") this.refusedBy(order, ours);
    } else if (order === ours.number) {
      if (begun || start.kind === "unsent") this.refusedBy(order, ours);
      else this.accepted(ours);
    } else if (start.kind === "lost") {
      if (ours.cancelled) this.over();
      else ours.start = { kind: "unsent" };
    }
  }

  private ownStatus(queued: number | null, executed: number | null, ours: Running): void {
    ours.leftAt = null;
    const done = this.executedOf(executed);
    if (done === null) return;
    this.counts(done, this.queued);
    this.counts(this.executed, this.countOf(queued) ?? this.queued);
  }

  /** The robot has left our order (KM-109). */
  private left(order: number, executed: number | null, ended: number, ours: Running, now: number): void {
    if (this.config.datagrams) {
      ours.leftAt ??= now;
      if (now < ours.leftAt + LATEST_DATAGRAM) return;
    }
    const count = this.countOf(executed);
    if (ended === ours.number && order === 0 && count !== null) {
      this.counts(count, this.queued);
      this.over();
    } else if (this.executed === this.sent) {
      this.over();
    } else {
      this.unknown(ours.number);
    }
  }

  private unknown(order: number): void {
    this.order = { phase: "idle" };
    this.events.push({ event: "outcome_unknown", order, executed: this.executed, sent: this.sent });
  }

  /** The order is over (KM-110). */
  private over(): void {
    const { number } = this;
    const { cumulative_acks, datagrams } = this.config;
    if (!cumulative_acks && this.executed < this.sent && (this.unsure || datagrams)) {
      this.unknown(number);
      return;
    }
    const complete = this.order.phase === "running" && this.executed === this.total;
    this.order = { phase: "idle" };
    this.events.push({ event: "order_over", order: number, executed: this.executed, complete });
  }
}
