/** The server of Modbus (section 8). */

import { Refused } from "../check.js";
import { TcpFrameDecoder, crcOf, type Frame, type FrameError } from "../fanuc-hmi-modbus.js";
import { decodePdu, encodeReply, type Reply, type Request } from "../modbus-pdu.js";
import { numberAt, concat } from "../stream.js";
import { Echo, type EchoEvent } from "./echo.js";
import { behindFrames, endedFrame, lineError, mayGoOn, needsMore, openFrame, partsOf, type Unit } from "./modbus-line.js";
import { ILLEGAL_ADDRESS, ILLEGAL_FUNCTION, ILLEGAL_VALUE, SERVER_FAILURE, isBeyondLast, type ModbusTables } from "./modbus-tables.js";
import { pieceTime, silence, type Transport } from "./modbus-transport.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

export interface ModbusServerConfig {
  framing: Transport;
  baud: number;
  /** ns without a byte that end the input. */
  silence: number;
  /** The unit that it is; null: every one. */
  unit: Unit;
  /** Unit 0 is a broadcast: carried out, never answered. */
  broadcast: boolean;
  /** ns for which the rest of an incomplete request is waited for on a serial line. */
  frame_timeout: number;
  /** The line returns what is sent; not over TCP. */
  echo: boolean;
  /** How many replies may wait. */
  places: number;
}

export type ModbusServerEvent =
  | { event: "served"; unit: number; function: number; transaction?: number; exception?: number }
  | { event: "refused"; unit: number; function: number }
  | { event: "corrupt" | "out_of_step"; error: FrameError }
  | EchoEvent
  | Unexpected;

/** The most bytes that are kept while replies wait (FM-62). */
const MOST_KEPT = 504;
/** The most bytes that come on a serial line without a silence, and how many are left of them (FM-63). */
const MOST_WITHOUT_SILENCE = 1024;
const LEFT_WITHOUT_SILENCE = 256;
/** The bytes of an RTU request to read. */
const READ_REQUEST = 8;

export class ModbusServer implements Session<ModbusServerEvent> {
  private up = false;
  /** When a busy line is silent; null: it is silent. */
  private silentAt: number | null = null;
  /** Until then the rest of a request is waited for (FM-87). */
  private partial = false;
  private readonly replies: Uint8Array[] = [];
  private echo = new Echo(false);
  private readonly decoder = new TcpFrameDecoder("client");
  /** The last read ended within corruption (FM-81). */
  private wasLost = false;
  /** Bytes of RTU frames. */
  private held: Uint8Array = new Uint8Array(0);
  /** Where silences were within them. */
  private silences: number[] = [];
  /** Behind bytes that are no frame: everything is dropped up to the next silence of a serial line. */
  private dropping = false;
  /** The error of what was dropped on a serial line, which is reported at its silence. */
  private burst: FrameError | null = null;
  private readonly events = new Events<ModbusServerEvent>();
  private readonly config: ModbusServerConfig;

  constructor(
    private readonly tables: ModbusTables,
    given: Partial<ModbusServerConfig> = {},
  ) {
    const { framing = "tcp", baud = 19200 } = given;
    this.config = {
      framing,
      baud,
      silence: silence(framing, baud),
      unit: framing === "tcp" ? null : 1,
      broadcast: framing !== "tcp",
      frame_timeout: pieceTime(framing, baud),
      echo: false,
      places: 8,
      ...given,
    };
    require(!(this.config.unit === 0 && this.config.broadcast), "unit 0 is a broadcast (FM-67)");
    require(!(this.config.echo && framing === "tcp"), "an echo over TCP (FM-67)");
    require(this.config.silence > 0, "a silence of 0 (FM-79)");
  }

  connected(): void {
    this.empty();
    this.up = true;
  }

  disconnected(): void {
    this.empty();
    this.up = false;
  }

  input(bytes: Uint8Array, now: number): void {
    if (!this.up) {
      this.events.push({ event: "unexpected" });
      return;
    }
    if (this.config.framing === "tcp") {
      this.decoder.push(bytes);
      this.readTcp();
      return;
    }
    const rest = this.echo.remove(bytes, this.events, () => this.discard());
    if (rest.length === 0) return;
    this.silentAt = now + this.config.silence;
    this.partial = false;
    if (this.config.framing === "rtu") {
      this.takeLine(rest);
    } else {
      this.held = concat(this.held, rest);
      this.readStream();
    }
  }

  timeout(now: number): void {
    if (this.silentAt === null || !isDue(this.silentAt, now) || this.isFullStream()) return;
    this.silentAt = null;
    if (this.config.framing === "rtu") this.judgeLine(now);
    else this.judgeStall();
    if (this.burst !== null) this.events.push({ event: "corrupt", error: this.burst });
    this.burst = null;
    this.dropping = false;
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    if (this.config.framing === "rtu" && this.silentAt !== null && !this.partial) return null;
    const full = this.isFull();
    const reply = this.replies.shift();
    if (reply === undefined) return null;
    if (this.config.framing === "tcp") {
      this.readTcp();
      return reply;
    }
    const isRead = [1, 2, 3, 4, 23].includes(numberAt(reply, 1));
    this.echo.sent(reply, isRead && reply.length > READ_REQUEST); // FM-92
    if (full && this.config.framing === "rtu_over_tcp") {
      if (this.silentAt !== null) this.silentAt = now + this.config.silence;
      this.readStream();
    }
    return reply;
  }

  event(): ModbusServerEvent | null {
    return this.events.take();
  }

  deadline(): number {
    return this.silentAt === null || this.isFullStream() ? NEVER : this.silentAt;
  }

  private empty(): void {
    this.replies.length = 0;
    this.decoder.discard();
    this.wasLost = false;
    this.discard();
    this.echo = new Echo(this.config.echo);
    this.silentAt = null;
    this.partial = false;
  }

  /** Forgets what has come of RTU frames. */
  private discard(): void {
    this.forget(this.held.length);
    this.dropping = false;
    this.burst = null;
  }

  private isFull(): boolean {
    return this.replies.length >= this.config.places;
  }

  /** RTU over TCP has no silence while nothing is read (FM-66). */
  private isFullStream(): boolean {
    return this.config.framing === "rtu_over_tcp" && this.isFull();
  }

  // Frames

  private readTcp(): void {
    while (!this.isFull()) {
      const item = this.decoder.next();
      if (item === null) break;
      if ("message" in item) this.request(item.message);
      else if (item.error.kind !== "noise") this.events.push({ event: "corrupt", error: item.error });
    }
    if (this.isFull()) this.decoder.keep(MOST_KEPT);
    const { corruption } = this.decoder;
    if (corruption !== null && !this.wasLost) this.events.push({ event: "out_of_step", error: corruption });
    this.wasLost = corruption !== null;
  }

  /** RTU over TCP, as bytes come: frames from the beginning of what is held. What is no frame and long is judged by its beginning. */
  private readStream(): void {
    while (!this.isFull()) {
      const length = openFrame(this.held, this.config.unit);
      if (length === null) break;
      this.takeFrame(length);
    }
    this.held = this.held.subarray(0, MOST_KEPT);
  }

  /** RTU over TCP at a stall: what needs more bytes is kept, its rest may come however late. */
  private judgeStall(): void {
    while (!this.isFull()) {
      const length = endedFrame(this.held, this.config.unit, true);
      if (length === null) {
        if (!needsMore(this.held, this.config.unit)) this.corrupt(this.held);
        return;
      }
      this.takeFrame(length);
    }
  }

  private takeFrame(length: number): void {
    const frame = this.held.subarray(0, length);
    this.held = this.held.subarray(length);
    this.request(partsOf(frame));
  }

  /** A serial line at a silence, or when the rest of a request has not come: frames, one behind the other, to the end, or nothing. */
  private judgeLine(now: number): void {
    const isPause = !this.partial;
    this.partial = false;
    while (this.held.length > 0) {
      const { held, silences, config } = this;
      const wrong = behindFrames(held, config.unit);
      if (wrong.length === 0) {
        this.takeFrames();
        return;
      }
      const within = silences.filter((at) => at < held.length);
      if (isPause && mayGoOn(held, config.unit, within.map((at) => held.subarray(at)))) {
        silences.push(held.length);
        for (let length; (length = openFrame(this.held, config.unit)) !== null; ) {
          const frame = this.held.subarray(0, length);
          this.forget(length);
          this.request(partsOf(frame), true);
        }
        this.partial = true;
        this.silentAt = now + config.frame_timeout;
        return;
      }
      const end = within[0] ?? held.length;
      const ofPiece = behindFrames(held.subarray(0, end), config.unit);
      this.events.push({ event: "corrupt", error: lineError(ofPiece.length > 0 ? ofPiece : wrong) });
      this.forget(end);
    }
  }

  private takeFrames(): void {
    while (this.held.length > 0) {
      const length = endedFrame(this.held, this.config.unit, false) ?? this.held.length;
      const frame = this.held.subarray(0, length);
      this.forget(length);
      this.request(partsOf(frame), this.held.length > 0);
    }
  }

  private forget(length: number): void {
    this.held = this.held.subarray(length);
    this.silences = this.silences.map((at) => at - length).filter((at) => at > 0);
  }

  /** What a serial line has brought: of more than 1024 bytes without a silence whole frames at the beginning are dropped (FM-63). */
  private takeLine(bytes: Uint8Array): void {
    let left = bytes;
    while (left.length > 0) {
      if (this.held.length === MOST_WITHOUT_SILENCE) this.dropLong();
      if (this.dropping) return;
      const room = MOST_WITHOUT_SILENCE - this.held.length;
      this.held = concat(this.held, left.subarray(0, room));
      left = left.subarray(room);
    }
  }

  private dropLong(): void {
    while (this.held.length > LEFT_WITHOUT_SILENCE) {
      const length = openFrame(this.held, this.config.unit);
      if (length === null) {
        this.drop();
        return;
      }
      const [unit, code] = [numberAt(this.held, 0), numberAt(this.held, 1)];
      if (unit === 0 || this.isOwn(unit)) this.events.push({ event: "refused", unit, function: code });
      this.forget(length);
    }
  }

  /** No frame begins what is held: it is dropped with what comes, and reported at the silence. */
  private drop(): void {
    this.burst = lineError(this.held);
    this.forget(this.held.length);
    this.dropping = true;
  }

  private corrupt(bytes: Uint8Array): void {
    this.events.push({ event: "corrupt", error: lineError(bytes) });
    this.held = new Uint8Array(0);
  }

  // Requests

  private isOwn(unit: number): boolean {
    return this.config.unit === null || unit === this.config.unit;
  }

  /** A request; one that is followed by another frame is not carried out on a serial line (FM-61, FM-62). */
  private request({ pdu, ...address }: Frame, followed = false): void {
    const { transaction, unit } = address;
    const code = numberAt(pdu, 0);
    const broadcast = unit === 0 && this.config.broadcast;
    if (!broadcast && !this.isOwn(unit)) return;
    if (!broadcast && (followed || this.isFull())) {
      this.events.push({ event: "refused", unit, function: code });
      return;
    }
    const reply = this.carryOut(pdu);
    const exception = typeof reply === "number" ? { exception: reply } : {};
    const bytes = typeof reply === "number" ? [code | 0x80, reply] : reply;
    this.events.push({ event: "served", ...address, function: code, ...exception });
    if (!broadcast) this.replies.push(frameOf(transaction, unit, bytes));
  }

  /** The PDU of the reply, or the code of an exception (FM-64). */
  private carryOut(pdu: Uint8Array): number[] | number {
    const decoded = decodePdu(pdu, "client");
    if ("error" in decoded) return decoded.error.kind === "function" ? ILLEGAL_FUNCTION : ILLEGAL_VALUE;
    const request = decoded.message as Request;
    if (isBeyondLast(request)) return ILLEGAL_ADDRESS;
    const reply = this.tables.serve(request);
    return typeof reply === "number" ? reply : encoded(reply);
  }
}

/** The bytes of a reply; one that does not fit is a failure of the server. */
function encoded(reply: Reply): number[] | number {
  try {
    return encodeReply(reply);
  } catch (refusal) {
    if (refusal instanceof Refused) return SERVER_FAILURE;
    throw refusal;
  }
}

/** The frame of a reply, whose PDU may be an exception to a function that no encoder takes. */
function frameOf(transaction: number | undefined, unit: number, pdu: number[]): Uint8Array {
  const body = [unit, ...pdu];
  if (transaction !== undefined) return Uint8Array.of(transaction >> 8, transaction & 0xff, 0, 0, 0, body.length, ...body);
  const crc = crcOf(body);
  return Uint8Array.of(...body, crc & 0xff, crc >> 8);
}
