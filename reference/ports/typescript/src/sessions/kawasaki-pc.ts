/** The PC of kawasaki-msg (section 9): it answers a robot, and sends it the jobs of an order. */

import { Refused } from "../check.js";
import { numberAfter, numberOf, type Values } from "../kawasaki-dialect.js";
import { MessageDecoder, type Message } from "../kawasaki-msg.js";
import { Packet } from "./kawasaki-packet.js";
import type { KawasakiPcConfig, KawasakiPcEvent } from "./kawasaki-pc-config.js";
import { LATEST_DATAGRAM, PcOrder, ROOM } from "./kawasaki-pc-order.js";
import { NEVER, isDue, type Session } from "./session.js";

export type { OrderRequest, ResumeRequest } from "./kawasaki-pc-config.js";

interface Command {
  id: number;
  value: number;
  inFlight: boolean;
}

const MOST_COMMANDS = 4;
const PHASE_CODES = { idle: 0, starting: 1, active: 2, ending: 3, interrupted: 4 } as const;

export class KawasakiPc extends PcOrder implements Session<KawasakiPcEvent> {
  private up = false;
  private silentAt = NEVER;
  private reply: "nothing" | "receiving" | "due" = "nothing";
  private replyAt = NEVER;
  private commands: Command[] = [];
  private closing = false;
  private readonly decoder: MessageDecoder;

  constructor(given: Partial<KawasakiPcConfig> = {}) {
    super(given);
    this.decoder = new MessageDecoder(this.dialect.charset);
  }

  connected(now: number): void {
    this.lose();
    this.up = true;
    this.silentAt = now + this.config.silence;
  }

  disconnected(): void {
    this.lose();
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
    if (this.reply !== "due" || !isDue(this.replyAt, now)) return null;
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

  command(id: number, value: number): void {
    if (!this.dialect.has(`command_${id}`)) throw new Refused("unknown_command");
    if (this.commands.length >= MOST_COMMANDS || !this.events.hasRoom(ROOM)) throw new Refused("too_many_commands");
    this.commands.push({ id, value, inFlight: false });
  }

  // Connection

  private lose(): void {
    if (this.order.phase === "starting" && this.order.start.kind === "sent") this.order.start = { kind: "lost" };
    this.endCommands("unknown");
    this.decoder.discard();
    this.robot = null;
    this.closing = false;
    this.forgetReply();
  }

  private forgetReply(): void {
    this.reply = "nothing";
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
      order.start = { kind: "sent", answerBy: config.datagrams ? NEVER : now + config.silence };
    }
  }

  private addCommands(packet: Packet): void {
    for (const command of this.commands) {
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
      if (!packet.add("job", { order: order.number, number: numberAfter(count, config.max_number) }, job)) return;
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
    this.meaning(read.meaning, now);
  }
}
