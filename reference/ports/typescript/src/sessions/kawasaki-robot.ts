/** The robot of kawasaki-msg (section 8): it asks for jobs, queues them for its motion program, and acknowledges them. */

import { numberOf, type Values } from "../kawasaki-dialect.js";
import { MessageDecoder, type Message } from "../kawasaki-msg.js";
import { Packet } from "./kawasaki-packet.js";
import { MS, type KawasakiRobotConfig, type KawasakiRobotEvent } from "./kawasaki-robot-config.js";
import { CYCLE, RobotOrder } from "./kawasaki-robot-order.js";
import { NEVER, isDue, type Session } from "./session.js";

type Cycle = { phase: "ready"; at: number; overdueAt: number } | { phase: "waiting"; notBefore: number; overdueAt: number; answered: boolean };

type Link =
  | { phase: "disconnected"; connectAt: number }
  | { phase: "connecting" }
  | { phase: "connected"; cycle: Cycle; silent: number; synced: boolean; statusAt: number };

const LATEST_DATAGRAM = 1000 * MS;

export class KawasakiRobot extends RobotOrder implements Session<KawasakiRobotEvent> {
  private link: Link = { phase: "disconnected", connectAt: 0 };
  private opening = false;
  private closing = false;
  private readonly decoder: MessageDecoder;

  constructor(given: Partial<KawasakiRobotConfig> = {}) {
    super(given);
    this.decoder = new MessageDecoder(this.dialect.charset);
  }

  connected(now: number): void {
    this.decoder.discard();
    this.closing = this.opening = false;
    this.link = {
      phase: "connected",
      cycle: { phase: "ready", at: now, overdueAt: now },
      silent: 0,
      synced: false,
      statusAt: now + this.config.status_period,
    };
    this.unanswered = 0;
    this.replies.status = true;
    this.replies.start = null;
    this.acknowledged = this.executed;
    this.unacked.clear();
    for (const count of this.ahead) this.unacked.add(count);
    this.ignoredUntil ??= now + LATEST_DATAGRAM;
    const { order } = this;
    if (order?.stage !== "intake") return;
    if (typeof order.flow === "object" && isDue(order.flow.heldUntil, now)) order.flow = "asking";
    order.gap = "rest";
  }

  disconnected(now: number): void {
    const { link, order } = this;
    if (link.phase === "disconnected") return;
    if (link.phase === "connected" && order?.stage === "intake" && this.executed === this.queued) this.recover(order, now);
    this.closing = this.opening = false;
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

  // Time

  private pass(now: number): void {
    const { link } = this;
    if (link.phase === "disconnected" && isDue(link.connectAt, now)) {
      this.link = { phase: "connecting" };
      this.opening = true;
    }
    const { order } = this;
    if (order?.stage === "intake") {
      if (typeof order.flow === "object" && isDue(order.flow.heldUntil, now)) order.flow = "asking";
      if (order.until !== null && isDue(order.until, now)) this.recover(order, now);
    }
    if (link.phase === "connected" && link.cycle.phase === "waiting" && isDue(link.cycle.overdueAt, now)) {
      link.cycle = { phase: "ready", at: now, overdueAt: now };
      link.silent += 1;
      this.unanswered = Math.min(this.unanswered + 1, this.config.silent_cycles || 65535);
      this.events.push({ event: "no_reply" });
      if (this.config.silent_cycles > 0 && link.silent >= this.config.silent_cycles) this.closing = true;
    }
    this.look(now);
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
    this.addAcks(packet, !statusDue && !replies.pause && replies.start === null && !asks);
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
      const named = read.job?.order;
      if (order?.stage === "intake" && order.gap === "rest") return;
      // A job of another order is looked at no further (KM-64).
      if (order !== null && typeof named === "number" && named !== order.number) this.reject({ kind: "wrong_order", active: order.number, found: named });
      else this.reject(read.error);
      this.failed();
      return;
    }
    this.meaning(read.meaning, now);
  }
}
