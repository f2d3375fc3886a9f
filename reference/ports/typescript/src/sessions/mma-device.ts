/** A device of the MM&A cell, on its connection to the central controller (section 8). */

import { Refused, isInteger } from "../check.js";
import {
  CommandDecoder,
  STRICT,
  axesOf,
  countsOf,
  encodeReply,
  type CellError,
  type Command,
  type Device,
  type Dialect,
  type Reply,
} from "../mmacell-proto.js";
import type { Item } from "../stream.js";
import { sumOf } from "./mma-motion.js";
import { Events, NEVER, require, type Session, type Unexpected } from "./session.js";

export interface DeviceConfig {
  accepts: Partial<Dialect>;
  writes: Partial<Dialect>;
  /** The error number of what the protocol itself refuses; not 0. */
  refusal: number;
}

export const DEVICE_DEFAULTS: DeviceConfig = { accepts: {}, writes: {}, refusal: 1 };

/** What the owner of a device is asked to do (MM-53). */
export type Order =
  | { order: "servo"; on: boolean }
  | { order: "override"; percent: number }
  /** mm and rad, absolute. */
  | { order: "move"; target: number[] }
  | { order: "stop" | "home" | "close" }
  | { order: "acquire"; camera: number }
  | { order: "grip"; gripper: number; open: boolean };

export type AxesState = "Off" | "Still" | "Moving" | "Stopping" | "Fault";

export type DeviceEvent =
  | { event: "asked"; order: Order }
  | { event: "rejected"; reason: "no_pose" | "out_of_range" | { malformed: CellError } | { not_now: { state: AxesState } } }
  | { event: "closed"; reason: "agreed" | "overrun" }
  | Unexpected;

type Link =
  | { phase: "down" | "idle" | "leaving" | "ended" }
  | { phase: "asked"; order: Order }
  | { phase: "answering"; reply: Reply };

/** The most bytes that are kept while a reply is not sent (MM-50). */
const MOST_KEPT = 512;
/** A line is not read, and a connection not begun, while more outcomes wait (MM-50). */
const MOST_OUTCOMES = 6;
const SMALLEST = -0x8000;
const LARGEST = 0x7fff;

export class MmaDevice implements Session<DeviceEvent> {
  private link: Link = { phase: "down" };
  private axes: AxesState = "Off";
  /** The number of a fault, else 0. */
  private error = 0;
  /** Counts of the last digit; null while it is unknown. */
  private pose: number[] | null = null;
  /** % */
  private override = 100;
  private readonly decoder: CommandDecoder;
  private readonly writes: Dialect;
  private readonly events = new Events<DeviceEvent>();
  private readonly config: DeviceConfig;

  constructor(
    private readonly device: Device,
    config: Partial<DeviceConfig> = {},
  ) {
    this.config = { ...DEVICE_DEFAULTS, ...config };
    const { refusal, accepts, writes } = this.config;
    require(refusal !== 0 && isInteger(refusal, SMALLEST, LARGEST), "a refusal that has no form (MM-59)");
    this.decoder = new CommandDecoder({ ...STRICT, ...accepts }, device);
    this.writes = { ...STRICT, ...writes };
  }

  /** A new connection takes the place of the one before (MM-56). */
  connected(): void {
    this.decoder.discard();
    this.link = { phase: this.hasRoom ? "idle" : "down" };
  }

  disconnected(): void {
    this.decoder.discard();
    this.link = { phase: "down" };
  }

  input(bytes: Uint8Array): void {
    if (this.link.phase === "ended") return;
    this.decoder.push(bytes);
    this.read();
    if (this.link.phase === "down" || this.reads || this.decoder.pending <= MOST_KEPT) return;
    this.link = { phase: "ended" };
    this.events.push({ event: "closed", reason: "overrun" });
  }

  timeout(): void {}

  transmitted(): void {}

  transmit(): Uint8Array | null {
    this.read();
    const { link } = this;
    if (link.phase === "leaving") {
      this.link = { phase: "ended" };
      this.events.push({ event: "closed", reason: "agreed" });
      return encodeReply({ reply: "ok" }, this.device, this.writes);
    }
    if (link.phase !== "answering") return null;
    this.link = { phase: "idle" };
    this.read();
    return encodeReply(link.reply, this.device, this.writes);
  }

  event(): DeviceEvent | null {
    return this.events.take();
  }

  deadline(): number {
    return NEVER;
  }

  // The owner's calls

  /** The order that is asked, if there is one. */
  get asked(): Order | null {
    return this.link.phase === "asked" ? this.link.order : null;
  }

  /** The owner accepts an order (MM-54). */
  accept(order: Order): void {
    if (!this.isAsked(order)) throw new Refused("not_pending");
    if (!this.canObey(order)) {
      this.reject({ not_now: { state: this.axes } });
      throw new Refused("not_possible");
    }
    this.obey(order);
    if (order.order === "close") this.link = { phase: "leaving" };
    else this.answer({ reply: "ok" });
  }

  /** The owner refuses an order with an error number. */
  refuse(order: Order, error: number): void {
    if (error === 0) throw new Refused("error_zero");
    if (!isInteger(error, SMALLEST, LARGEST)) throw new Refused("integer_range");
    if (!this.isAsked(order)) throw new Refused("not_pending");
    this.answer({ reply: "error", error });
  }

  /** Where the device is, in mm and rad; what does not fit its fields is not known (MM-52). */
  setPose(axes: number[]): void {
    try {
      this.pose = countsOf(axes);
    } catch {
      this.pose = null;
    }
  }

  /** The axes are at rest. */
  arrived(): void {
    if (this.axes === "Moving" || this.axes === "Stopping") this.axes = "Still";
  }

  /** An error that the owner reports (MM-57). */
  fail(error: number): void {
    this.axes = "Fault";
    this.error = error !== 0 && isInteger(error, SMALLEST, LARGEST) ? error : 1;
  }

  private isAsked(order: Order): boolean {
    return this.link.phase === "asked" && JSON.stringify(this.link.order) === JSON.stringify(order);
  }

  // Lines

  private get hasRoom(): boolean {
    return this.events.count(isOutcome) <= MOST_OUTCOMES;
  }

  /** A line is read when the reply to the one before was sent, and with room (MM-50). */
  private get reads(): boolean {
    return this.link.phase === "idle" && this.hasRoom;
  }

  private read(): void {
    while (this.reads || this.link.phase === "down") {
      const item = this.decoder.next();
      if (item === null) return;
      if (this.link.phase === "down") this.events.push({ event: "unexpected" });
      else this.take(item);
    }
  }

  private take(item: Item<Command, CellError>): void {
    if ("error" in item) {
      this.reject({ malformed: item.error });
    } else if (item.message.command === "STA") {
      this.status();
    } else {
      this.ask(item.message);
    }
  }

  private status(): void {
    const { axes, pose, override, error } = this;
    if (pose === null) {
      this.reject("no_pose");
      return;
    }
    const moving = axes === "Moving" || axes === "Stopping";
    this.answer({ reply: "status", moving, axes: axesOf(pose), servo: moving || axes === "Still", override, error });
  }

  /** A command becomes an order, if it can be obeyed (MM-53). */
  private ask(command: Command): void {
    const order = this.orderOf(command);
    if (order === null) return;
    if (!this.canObey(order)) {
      this.reject({ not_now: { state: this.axes } });
      return;
    }
    this.link = { phase: "asked", order };
    this.events.push({ event: "asked", order });
  }

  /** The order of a command; null, if it was rejected. */
  private orderOf(command: Command): Order | null {
    switch (command.command) {
      case "SRV":
        return { order: "servo", on: command.on };
      case "OVR":
        return { order: "override", percent: command.percent };
      case "ACQ":
        return { order: "acquire", camera: command.camera };
      case "HND":
        return { order: "grip", gripper: command.gripper, open: command.open };
      case "MOV": {
        const way = countsOf(command.axes);
        if (command.mode === "absolute") return { order: "move", target: axesOf(way) };
        const target = this.pose === null ? null : sumOf(this.pose, way);
        if (target !== null) return { order: "move", target: axesOf(target) };
        this.reject(this.pose === null ? "no_pose" : "out_of_range");
        return null;
      }
      case "STP":
        return { order: "stop" };
      case "RST":
        return { order: "home" };
      default:
        return { order: "close" };
    }
  }

  private answer(reply: Reply): void {
    this.link = { phase: "answering", reply };
  }

  /** The protocol itself refuses, with the configured number. */
  private reject(reason: Extract<DeviceEvent, { event: "rejected" }>["reason"]): void {
    this.events.push({ event: "rejected", reason });
    this.answer({ reply: "error", error: this.config.refusal });
  }

  // Axes (MM-74)

  private canObey(order: Order): boolean {
    if (order.order === "move") return this.axes === "Still";
    return !(order.order === "servo" && order.on && this.axes === "Fault");
  }

  private obey(order: Order): void {
    switch (order.order) {
      case "servo":
        if (order.on && this.axes === "Off") this.axes = "Still";
        if (!order.on && this.axes !== "Fault") this.axes = "Off";
        break;
      case "move":
        this.axes = "Moving";
        break;
      case "stop":
        if (this.axes === "Moving") this.axes = "Stopping";
        break;
      case "home":
        this.axes = "Moving";
        this.error = 0;
        break;
      case "override":
        this.override = order.percent;
        break;
      default:
    }
  }
}

function isOutcome({ event }: DeviceEvent): boolean {
  return event === "asked" || event === "closed";
}
