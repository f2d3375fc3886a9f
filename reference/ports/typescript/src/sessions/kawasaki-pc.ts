/** The PC of kawasaki-msg (section 9): it answers a robot, and sends it the jobs of an order. */

import { Refused } from "../check.js";
import { Dialect, ahead, checkEnd, numberOf, isCommand, phaseName, shownRole, type FieldFault, type GivenDialect, type Job, type Meaning, type MeaningError, type PhaseName, type Role, type ShownRole, type Values } from "../kawasaki-dialect.js";
import { MessageDecoder, type Message, type MessageError } from "../kawasaki-msg.js";
import { Packet } from "./kawasaki-packet.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

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
  executed?: number;
  sent?: number;
  /** Places of jobs, from 0, that are executed ahead of others. */
  ahead?: number[];
}

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

interface Command {
  id: number;
  value: number;
  inFlight: boolean;
}

const MOST_COMMANDS = 4;
/** A datagram may come so much later (KM-9). */
const LATEST_DATAGRAM = SECOND;
const PHASE_CODES = { idle: 0, starting: 1, active: 2, ending: 3, interrupted: 4 } as const;
const OF_THE_PC: readonly Role[] = ["order_start", "job", "order_end", "order_interrupt"];

export class KawasakiPc implements Session<KawasakiPcEvent> {
  private up = false;
  private silentAt = NEVER;
  private reply: "nothing" | "receiving" | "due" = "nothing";
  private replyAt = NEVER;
  private contents: Contents = { status: false, jobsFrom: null };
  /** The order that the robot said it is in on this connection. */
  private robot: number | null = null;
  private order: Order = { phase: "idle" };
  private executed = 0;
  private queued = 0;
  private sent = 0;
  private total: number | null = null;
  /** Counts of jobs that are executed ahead of others. */
  private readonly ahead = new Set<number>();
  private unsure = false;
  private jobs: Job[] = [];
  private open = false;
  private commands: Command[] = [];
  private closing = false;
  private progress = false;
  private readonly dialect: Dialect;
  private readonly decoder: MessageDecoder;
  private readonly events = new Events<KawasakiPcEvent>();
  private readonly config: KawasakiPcConfig;

  constructor(given: Partial<KawasakiPcConfig> = {}) {
    this.config = { ...KAWASAKI_PC_DEFAULTS, ...given };
    const { cumulative_acks, takeover, silence } = this.config;
    this.dialect = new Dialect(this.config);
    checkEnd(this.dialect, this.config, !cumulative_acks);
    require(takeover !== "interrupt" || this.dialect.has("order_interrupt"), "no order_interrupt to take over with (KM-122)");
    require(silence > 0, "a silence of 0");
    require(["never", "end", "interrupt"].includes(takeover), "no such takeover");
    this.decoder = new MessageDecoder(this.dialect.charset);
  }

  connected(now: number): void {
    if (this.up) this.lose();
    this.up = true;
    this.decoder.discard();
    this.silentAt = now + this.config.silence;
    this.forgetReply();
    this.robot = null;
  }

  disconnected(): void {
    if (this.up) this.lose();
    this.up = false;
  }

  input(bytes: Uint8Array, now: number): void {
    if (!this.up) {
      this.events.push({ event: "unexpected" });
      return;
    }
    this.decoder.push(bytes);
    if (this.config.datagrams) this.decoder.end();
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("message" in item) {
        this.message(item.message, now);
      } else {
        this.events.push({ event: "corrupt", error: item.error });
        this.meansNothing();
      }
    }
    if (this.reply === "nothing") return;
    if (this.decoder.half) {
      this.reply = "receiving";
    } else {
      this.reply = "due";
      this.replyAt = now + this.config.reply_delay;
    }
  }

  timeout(now: number): void {
    if (!this.up) return;
    if (isDue(this.silentAt, now)) {
      this.closing = true;
      this.silentAt = now + this.config.silence;
    }
    const { order } = this;
    if (order.phase !== "starting" || order.start.kind !== "sent" || !isDue(order.start.answerBy, now)) return;
    if (this.config.datagrams) {
      order.start = { kind: "lost" };
    } else {
      this.closing = true;
      order.start.answerBy = NEVER;
    }
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    if (!this.up || this.reply !== "due" || !isDue(this.replyAt, now)) return null;
    const { contents } = this;
    this.forgetReply();
    const packet = new Packet(this.dialect, this.config.limits.packet);
    this.endWhenDone();
    if (contents.status) packet.add("status", this.status());
    this.addOrder(packet, now);
    this.addCommands(packet);
    if (contents.jobsFrom !== null) this.addJobs(packet, contents.jobsFrom);
    if (packet.isEmpty) packet.add("filler", {});
    return packet.bytes;
  }

  event(): KawasakiPcEvent | null {
    const event = this.events.take();
    if (event !== null) return event;
    if (this.closing) {
      this.closing = false;
      return { event: "disconnect" };
    }
    if (!this.progress) return null;
    this.progress = false;
    return { event: "progress", executed: this.executed, queued: this.queued };
  }

  deadline(): number {
    if (!this.up) return NEVER;
    const { order } = this;
    const answerBy = order.phase === "starting" && order.start.kind === "sent" ? order.start.answerBy : NEVER;
    return Math.min(this.silentAt, this.reply === "due" ? this.replyAt : NEVER, answerBy);
  }

  // The owner (KM-112 to KM-114, KM-118, KM-128)

  start({ order, jobs, open = false }: OrderRequest): void {
    this.begin(order, jobs, open, 0, 0);
    const start: StartState = this.robot === order ? { kind: "foreign", order } : { kind: "unsent" };
    this.order = { phase: "starting", number: order, start, refusals: 0, cancelled: false };
  }

  resume({ order, jobs, open = false, executed = 0, sent = executed, ahead: done = [] }: ResumeRequest): void {
    if (sent < executed || sent - executed > this.window) throw new Refused("not_in_flight");
    this.begin(order, jobs, open, executed, sent);
    if (!open && jobs.length <= sent) this.total = sent;
    for (const index of done) if (!this.config.cumulative_acks && index >= executed && index < sent) this.ahead.add(index + 1);
    this.unsure = !this.config.cumulative_acks;
    this.order = { phase: "running", number: order, stage: "active", leftAt: null };
  }

  private begin(order: number, jobs: Job[], open: boolean, executed: number, sent: number): void {
    if (this.order.phase !== "idle") throw new Refused("order_active");
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

  command(id: number, value: number): void {
    if (!this.dialect.has(`command_${id}`)) throw new Refused("unknown_command");
    if (this.commands.length >= MOST_COMMANDS) throw new Refused("too_many_commands");
    this.commands.push({ id, value, inFlight: false });
  }

  // Connection

  private lose(): void {
    if (this.order.phase === "starting" && this.order.start.kind === "sent") this.order.start = { kind: "lost" };
    this.endCommands("unknown");
    this.decoder.discard();
    this.closing = false;
    this.forgetReply();
  }

  private forgetReply(): void {
    this.reply = "nothing";
    this.replyAt = NEVER;
    this.contents = { status: false, jobsFrom: null };
  }

  /** What becomes of the commands in flight (KM-98). */
  private endCommands(outcome: "transmitted" | "unknown"): void {
    for (const { id, value, inFlight } of this.commands) {
      if (inFlight) this.events.push({ event: "command", id, value, outcome });
    }
    this.commands = this.commands.filter(({ inFlight }) => !inFlight);
  }

  // Answers

  private get window(): number {
    const { datagrams, max_number } = this.config;
    return datagrams ? Math.floor(max_number / 2) : max_number - 1;
  }

  private get number(): number {
    return this.order.phase === "idle" ? 0 : this.order.number;
  }

  private status(): Values {
    const { order } = this;
    const phase = order.phase === "running" ? order.stage : order.phase;
    const { max_number } = this.config;
    return { order: this.number, phase: PHASE_CODES[phase], queued: numberOf(this.sent, max_number), executed: numberOf(this.executed, max_number), ended: null };
  }

  /** The order's end is sent when all jobs are executed (KM-94). */
  private endWhenDone(): void {
    const { order } = this;
    if (order.phase !== "running" || order.stage !== "active" || !this.config.end_when_done) return;
    if (this.executed !== this.sent || this.jobs.length > this.sent || this.open) return;
    order.stage = "ending";
    this.total = this.sent;
  }

  /** What the order asks of the robot (KM-93). */
  private addOrder(packet: Packet, now: number): void {
    const { order, config } = this;
    if (order.phase === "running") {
      if (order.stage !== "active") packet.add(order.stage === "ending" ? "order_end" : "order_interrupt", { order: order.number });
      return;
    }
    if (order.phase === "idle") return;
    const { start } = order;
    if (order.cancelled) {
      if (config.datagrams && start.kind === "sent") start.answerBy = Math.min(start.answerBy, now + 2 * LATEST_DATAGRAM);
    } else if (start.kind === "foreign") {
      if (config.takeover !== "never") packet.add(config.takeover === "end" ? "order_end" : "order_interrupt", { order: start.order });
    } else if (start.kind === "sent" ? config.datagrams : this.robot !== null) {
      if (!packet.add("order_start", { order: order.number, number: 1 })) return;
      if (start.kind !== "sent") order.start = { kind: "sent", answerBy: config.datagrams ? NEVER : now + config.silence };
    }
  }

  private addCommands(packet: Packet): void {
    for (const command of this.commands) {
      if (command.inFlight) continue;
      if (!packet.add(`command_${command.id}`, { order: this.number, value: command.value })) return;
      command.inFlight = true;
    }
  }

  /** Jobs from a count on (KM-95, KM-97). */
  private addJobs(packet: Packet, from: number): void {
    const { order, config } = this;
    if (order.phase !== "running" || order.stage !== "active") return;
    for (let count = Math.max(from, this.executed); count - this.executed < this.window; count += 1) {
      const job = this.jobs[count];
      if (job === undefined) {
        if (!this.open) this.total = count;
        return;
      }
      const error = this.dialect.unfit(job);
      if (error !== null) {
        this.events.push({ event: "job_unfit", order: order.number, index: count, error });
        order.stage = "ending";
        return;
      }
      if (!packet.add("job", { order: order.number, number: numberOf(count + 1, config.max_number) }, job)) return;
      this.sent = Math.max(this.sent, count + 1);
    }
  }

  // Messages

  private message(message: Message, now: number): void {
    this.silentAt = now + this.config.silence;
    this.reply = "receiving";
    this.endCommands("transmitted");
    const read = this.dialect.read(message);
    if ("error" in read) {
      this.reject(read.error);
      this.meansNothing();
      return;
    }
    const { role } = read.meaning;
    if (OF_THE_PC.includes(role) || isCommand(role)) {
      this.reject({ kind: "not_expected", role: shownRole(role) });
      return;
    }
    this.meaning(read.meaning, now);
  }

  private reject(error: PcRejection): void {
    this.events.push({ event: "rejected", error });
  }

  /** With individual acknowledgement something may be lost (KM-110). */
  private meansNothing(): void {
    if (this.order.phase === "running" && !this.config.cumulative_acks) this.unsure = true;
  }

  private meaning({ role, values }: Meaning, now: number): void {
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
      default:
    }
  }

  private wrongOrder(found: number): void {
    this.reject({ kind: "wrong_order", active: this.number, found });
  }

  /** The count of a number of the robot's; null, if it means nothing, which is rejected (KM-99). */
  private countOf(number: number): number | null {
    const { max_number } = this.config;
    const count = this.executed + ahead(this.executed, number, max_number);
    if (number <= max_number && count <= this.sent) return count;
    this.outOfOrder(this.executed, number);
    return null;
  }

  /** The count of a job that was queued last: that of the last executed one, if it is empty; as it was, if it means nothing. */
  private queuedOf(number: number | null): number {
    const { max_number } = this.config;
    if (number === null) return this.executed;
    const count = this.executed + ahead(this.executed, number, max_number);
    return number <= max_number && count <= this.sent ? count : this.queued;
  }

  private outOfOrder(count: number, found: number): void {
    this.reject({ kind: "out_of_order", expected: numberOf(count + 1, this.config.max_number) ?? 1, found });
  }

  private counts(executed: number, queued: number): void {
    const now = Math.max(queued, executed);
    if (executed !== this.executed || now !== this.queued) this.progress = true;
    this.executed = executed;
    this.queued = now;
    for (const count of this.ahead) if (count <= executed) this.ahead.delete(count);
  }

  private jobAck(number: number, ours: Running): void {
    ours.leftAt = null;
    const count = this.countOf(number);
    if (count === null) return;
    if (this.config.cumulative_acks) {
      this.counts(count, this.queued);
      return;
    }
    if (count === this.executed || this.ahead.has(count)) return;
    if (count > this.executed + 1) {
      this.ahead.add(count);
      this.events.push({ event: "executed_ahead", index: count - 1 });
      return;
    }
    let executed = count;
    while (this.ahead.has(executed + 1)) executed += 1;
    this.counts(executed, this.queued);
  }

  private paused(number: number | null | undefined, ours: Running): void {
    ours.leftAt = null;
    const count = this.queuedOf(number ?? null);
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
    const count = executed === null ? this.executed : this.countOf(executed);
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
    const done = executed === null ? this.executed : this.countOf(executed);
    if (done === null) return;
    this.counts(done, this.queued);
    this.counts(this.executed, this.queuedOf(queued));
  }

  /** The robot has left our order (KM-109). */
  private left(order: number, executed: number | null, ended: number, ours: Running, now: number): void {
    if (this.config.datagrams) {
      ours.leftAt ??= now;
      if (now < ours.leftAt + LATEST_DATAGRAM) return;
    }
    const { max_number } = this.config;
    const count = executed === null ? this.executed : this.executed + ahead(this.executed, executed, max_number);
    if (ended === ours.number && order === 0 && (executed ?? 0) <= max_number && count <= this.sent) {
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
    const running = this.order.phase === "running";
    if (running && !cumulative_acks && this.executed < this.sent && (this.unsure || datagrams)) {
      this.unknown(number);
      return;
    }
    this.order = { phase: "idle" };
    this.events.push({ event: "order_over", order: number, executed: this.executed, complete: running && this.executed === this.total });
  }
}
