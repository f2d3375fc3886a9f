/** mmacell-proto: the text protocol between the central controller of the MM&A cell and its devices. */

import { Refused, boolean, fields, integer, isInteger, oneOf } from "./check.js";
import { Decoder, bytesOf, latin1, type Found } from "./stream.js";
import { LineFault, LineReader, type LineError } from "./mmacell-line.js";

/** The longest line with its end, in bytes (MM-7). */
export const MAX_LINE = 64;

const LF = 0x0a;
const CR = 0x0d;

/** The other readings of the source (MM-63); what is accepted and what is written are two dialects. */
export interface Dialect {
  /** ITR is STP. */
  itr: boolean;
  /** OVRD is OVR. */
  ovrd: boolean;
  /** HND…CLOS is HND…CLOSE. */
  clos: boolean;
  /** SRVOFF is SRVOF. */
  off: boolean;
  /** A line ends with an LF alone. */
  lone_lf: boolean;
  /** A blank follows the sign of an integer. */
  blank: boolean;
  /** Integers are −99999 to 99999. */
  wide_integers: boolean;
}

export const STRICT: Dialect = { itr: false, ovrd: false, clos: false, off: false, lone_lf: false, blank: false, wide_integers: false };

/** The axes of a device: a robot has X, Y, Z in mm and C in rad, a platform A and B in rad (MM-64). */
export type Device = "robot" | "platform" | "none";

export type Mode = "absolute" | "relative";

export type Command =
  | { command: "STA" | "STP" | "RST" | "CLO" }
  | { command: "SRV"; on: boolean }
  | { command: "OVR"; percent: number }
  | { command: "MOV"; mode: Mode; axes: number[] }
  | { command: "ACQ"; camera: number }
  | { command: "HND"; gripper: number; open: boolean };

export interface StatusReply {
  reply: "status";
  moving: boolean;
  axes: number[];
  servo: boolean;
  /** % */
  override: number;
  error: number;
}

export type Reply = { reply: "ok" } | { reply: "error"; error: number } | StatusReply;

export type CellError = LineError | { kind: "too_long"; limit: number } | { kind: "incomplete" };

/** The last digits of a millimetre (µm) and of a radian (0.1 mrad). */
const MILLI = 1000;
const TENTH_OF_MILLI = 10000;
/** The most that a coordinate can be, in its last digit. */
export const MAX_COUNT = 999999;

/** How many of its last digit an axis of a device has in its unit: a robot has four axes, a platform two. */
function scaleOf(axes: number, axis: number): number {
  return axes === 4 && axis < 3 ? MILLI : TENTH_OF_MILLI;
}

/** Coordinates as counts of their last digit, rounded, halves away from zero; refuses what does not fit (MM-11). */
export function countsOf(axes: unknown): number[] {
  if (!Array.isArray(axes) || (axes.length !== 2 && axes.length !== 4)) throw new Refused("message", "neither two nor four axes");
  return axes.map((value: unknown, axis) => {
    if (typeof value !== "number") throw new Refused("message", `axis ${axis} is no number`);
    const count = Math.sign(value) * Math.round(Math.abs(value) * scaleOf(axes.length, axis));
    if (!isInteger(count, -MAX_COUNT, MAX_COUNT)) throw new Refused("axis_range", `axis ${axis} is ${value}`);
    return count;
  });
}

/** Coordinates in millimetres and radians. */
export function axesOf(counts: number[]): number[] {
  return counts.map((count, axis) => 0 + count / scaleOf(counts.length, axis)); // no -0
}

// Encoding

/** The line of a command (MM-28, MM-29). */
export function encodeCommand(command: Command, dialect: Dialect = STRICT): Uint8Array {
  return line(commandText(command, dialect), dialect);
}

/** What a command, or a reply, has beside its name. */
const COMMAND_FIELDS = { STA: [], STP: [], RST: [], CLO: [], SRV: ["on"], OVR: ["percent"], MOV: ["mode", "axes"], ACQ: ["camera"], HND: ["gripper", "open"] };
const REPLY_FIELDS = { ok: [], error: ["error"], status: ["moving", "axes", "servo", "override", "error"] };

function commandText(command: Command, dialect: Dialect): string {
  const kind = oneOf((command as Partial<Command> | null)?.command, Object.keys(COMMAND_FIELDS) as (keyof typeof COMMAND_FIELDS)[]);
  fields(command, "command", ...COMMAND_FIELDS[kind]);
  switch (command.command) {
    case "SRV":
      return `SRV${boolean(command.on) ? "ON" : dialect.off ? "OFF" : "OF"}`;
    case "OVR":
      return `OVR${dialect.ovrd ? "D" : ""}${writeInteger(integer(command.percent, 0, 100, "percent"), dialect)}`;
    case "MOV":
      return `MOV${oneOf(command.mode, ["absolute", "relative"]) === "absolute" ? "A" : "R"}${writeAxes(command.axes)}`;
    case "ACQ":
      return `ACQ${writeInteger(command.camera, dialect)}`;
    case "HND":
      return `HND${writeInteger(command.gripper, dialect)}${boolean(command.open) ? "OPEN" : dialect.clos ? "CLOS" : "CLOSE"}`;
    default:
      return kind === "STP" && dialect.itr ? "ITR" : kind;
  }
}

/** The line of a reply of a device. */
export function encodeReply(reply: Reply, device: Device, dialect: Dialect = STRICT): Uint8Array {
  return line(replyText(reply, device, dialect), dialect);
}

function replyText(reply: Reply, device: Device, dialect: Dialect): string {
  const kind = oneOf((reply as Partial<Reply> | null)?.reply, Object.keys(REPLY_FIELDS) as (keyof typeof REPLY_FIELDS)[]);
  fields(reply, "reply", ...REPLY_FIELDS[kind]);
  switch (kind) {
    case "ok":
      return "OK";
    case "error": {
      const { error } = reply as { error: number };
      if (error === 0) throw new Refused("error_zero");
      return `ER${writeInteger(error, dialect)}`;
    }
    case "status": {
      const { moving, axes, servo, override, error } = reply as StatusReply;
      if (!Array.isArray(axes) || axes.length !== axisCount(device)) throw new Refused("message", "axes of another device");
      const percent = writeInteger(integer(override, 0, 100, "percent"), dialect);
      return `OK${flag(moving)}${writeAxes(axes)}${flag(servo)}${percent}${writeInteger(error, dialect)}`;
    }
  }
}

function axisCount(device: Device): number {
  return { robot: 4, platform: 2, none: 0 }[device];
}

function line(content: string, dialect: Dialect): Uint8Array {
  return bytesOf(content + (dialect.lone_lf ? "\n" : "\r\n"));
}

function flag(value: boolean): string {
  return boolean(value) ? "T" : "F";
}

function sign(value: number): string {
  return value < 0 ? "-" : "+";
}

function writeAxes(axes: number[]): string {
  return countsOf(axes)
    .map((count, axis) => {
      const decimals = scaleOf(axes.length, axis) === MILLI ? 3 : 4;
      const digits = String(Math.abs(count)).padStart(6, "0");
      return `${sign(count)}${digits.slice(0, -decimals)}.${digits.slice(-decimals)}`;
    })
    .join("");
}

function writeInteger(value: number, dialect: Dialect): string {
  const [min, max] = dialect.wide_integers ? [-99999, 99999] : [-0x8000, 0x7fff];
  const digits = String(Math.abs(integer(value, min, max, "integer_range"))).padStart(5, "0");
  return `${sign(value)}${dialect.blank ? " " : ""}${digits}`;
}

// Decoding

/** Splits a stream into lines, and reads each (MM-21 to MM-24). */
abstract class LineDecoder<M> extends Decoder<M, CellError> {
  constructor(protected readonly dialect: Dialect) {
    super();
  }

  /** The last byte that was dropped was a CR. */
  private afterCr = false;

  protected abstract readLine(content: string): M;

  protected read(): Found<M, CellError> | null {
    const { held } = this;
    const isCr = (place: number): boolean => (place < 0 ? this.afterCr : held[place] === CR);
    const end = held.findIndex((byte, place) => byte === LF && (this.dialect.lone_lf || isCr(place - 1))) + 1;
    const length = this.dropped + (end > 0 ? end : held.length);
    if (end > 0 ? length > MAX_LINE : this.ended && length >= MAX_LINE) {
      this.afterCr = false;
      return { length, error: { kind: "too_long", limit: MAX_LINE } };
    }
    if (end > 0) {
      const content = latin1(held.subarray(0, end)).replace(/\r?\n$/, "");
      try {
        return { length, message: this.readLine(content) };
      } catch (fault) {
        if (fault instanceof LineFault) return { length, error: fault.error };
        throw fault;
      }
    }
    if (this.ended) return length > 0 ? { length, error: { kind: "incomplete" } } : null;
    if (length > MAX_LINE && held.length > 0) {
      this.afterCr = held[held.length - 1] === CR;
      this.drop(held.length);
    }
    return null;
  }

  override discard(): void {
    super.discard();
    this.afterCr = false;
  }
}

/** A device's or a listener's decoder of commands; a listener may not know the device (MM-27). */
export class CommandDecoder extends LineDecoder<Command> {
  constructor(
    dialect: Dialect = STRICT,
    private readonly device: Device | "unknown" = "unknown",
  ) {
    super(dialect);
  }

  protected override readLine(content: string): Command {
    const reader = new LineReader(content);
    const command = this.readCommand(reader);
    reader.end();
    return command;
  }

  private readCommand(reader: LineReader): Command {
    const { dialect } = this;
    const word = reader.take(3, "command");
    switch (word) {
      case "STA":
      case "STP":
      case "RST":
      case "CLO":
        return { command: word };
      case "SRV":
        return { command: word, on: reader.word(dialect.off ? ["ON", "OF", "OFF"] : ["ON", "OF"], "on_or_off") === "ON" };
      case "OVR":
        if (dialect.ovrd) reader.skip("D");
        return { command: word, percent: readPercent(reader, dialect) };
      case "MOV": {
        const mode = reader.oneOf("AR", "absolute_or_relative") === "A" ? "absolute" : "relative";
        return { command: word, mode, axes: readAxes(reader, this.device) };
      }
      case "ACQ":
        return { command: word, camera: reader.integer(dialect.blank, dialect.wide_integers) };
      case "HND": {
        const gripper = reader.integer(dialect.blank, dialect.wide_integers);
        const words = dialect.clos ? ["OPEN", "CLOSE", "CLOS"] : ["OPEN", "CLOSE"];
        return { command: word, gripper, open: reader.word(words, "open_or_close") === "OPEN" };
      }
    }
    if (word === "ITR" && dialect.itr) return { command: "STP" };
    throw new LineFault({ kind: "unknown_command", found: [...bytesOf(word)] });
  }
}

/** The central controller's decoder of what a device replies. */
export class ReplyDecoder extends LineDecoder<Reply> {
  constructor(
    dialect: Dialect = STRICT,
    private readonly device: Device | "unknown" = "unknown",
  ) {
    super(dialect);
  }

  protected override readLine(content: string): Reply {
    const reader = new LineReader(content);
    const reply = this.readReply(reader);
    reader.end();
    return reply;
  }

  private readReply(reader: LineReader): Reply {
    const { blank, wide_integers: wide } = this.dialect;
    const word = reader.take(2, "reply");
    if (word === "ER") {
      const error = reader.integer(blank, wide, (value) => {
        if (value === 0) throw new LineFault({ kind: "error_zero" });
      });
      return { reply: "error", error };
    }
    if (word !== "OK") throw new LineFault({ kind: "unknown_reply", found: [...bytesOf(word)] });
    if (reader.left === 0) return { reply: "ok" };
    const moving = reader.flag();
    const axes = readAxes(reader, this.device);
    const servo = reader.flag();
    const override = readPercent(reader, this.dialect);
    return { reply: "status", moving, axes, servo, override, error: reader.integer(blank, wide) };
  }
}

function readAxes(reader: LineReader, device: Device | "unknown"): number[] {
  if (device === "none") reader.noAxes();
  const count = device === "robot" || (device === "unknown" && reader.left >= 32) ? 4 : 2;
  return axesOf(Array.from({ length: count }, (_, axis) => reader.coordinate(scaleOf(count, axis) === MILLI ? 3 : 4)));
}

function readPercent(reader: LineReader, dialect: Dialect): number {
  return reader.integer(dialect.blank, dialect.wide_integers, (value, offset) => {
    if (value < 0 || value > 100) throw new LineFault({ kind: "percent", offset, found: value });
  });
}
