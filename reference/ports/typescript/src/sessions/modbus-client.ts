/** The client of Modbus (section 7): it sends requests, and gives each of them one outcome. */

import { Refused } from "../check.js";
import { decodeFrame, encodeFrame, frameDecoder, type ExceptionLength, type Frame, type FrameError, type ReplyMessage, type RequestMessage } from "../fanuc-hmi-modbus.js";
import { type PduError, type Reply, type Request } from "../modbus-pdu.js";
import { numberAt } from "../stream.js";
import { Echo, type EchoEvent } from "./echo.js";
import { askedBytes, isMirrored, mayBeginReply } from "./modbus-reply.js";
import { longestFrame, silence, type Transport } from "./modbus-transport.js";
import { Events, NEVER, isDue, require, type Session, type Unexpected } from "./session.js";

/** Times are in ns. */
export interface ModbusClientConfig {
  framing: Transport;
  baud: number;
  /** Ends the input on a serial line, or stalls RTU over TCP. */
  silence: number;
  timeout: number;
  /** How many requests are in flight at most; 1 where frames have no transaction. */
  in_flight: number;
  /** A reply from another unit than was asked is taken. */
  any_unit: boolean;
  /** Unit 0 is a broadcast, without a reply. */
  broadcast: boolean;
  turnaround: number;
  settle: number;
  /** From the end of a request to the next one. */
  pause: number;
  /** The line returns what is sent; not over TCP. */
  echo: boolean;
  /** How many requests there can be at once. */
  places: number;
}

export type Mismatch =
  | { kind: "unit" | "function"; expected: number; found: number }
  /** Bytes of data. */
  | { kind: "quantity"; expected: number; found: number }
  | { kind: "echo" };

type Misfit = { mismatch: Mismatch } | { malformed: PduError | ExceptionLength };

export type FailReason = "disconnected" | "not_sent" | "timed_out" | "returned" | Misfit;

export type ModbusClientEvent =
  | { event: "replied"; ticket: number; message: ReplyMessage }
  | { event: "announced"; ticket: number }
  | { event: "failed"; ticket: number; reason: FailReason }
  | { event: "stray"; unit: number; function: number; transaction?: number; late?: number; mismatch?: Mismatch }
  | { event: "corrupt" | "out_of_step"; error: FrameError | PduError }
  | EchoEvent
  | Unexpected;

/** A request in its place (FM-75); `probing`: the probe before it was sent; `expired`: the outcome was taken, and the reply may still come. */
interface Place {
  ticket: number;
  request: RequestMessage;
  stage: "queued" | "probing" | "in_flight" | "ended" | "timed_out" | "expired";
  transaction: number | null;
  deadline: number;
  /** The probe before it has ended (FM-93). */
  probed: boolean;
  /** A frame that equals it has come while the line was not proven (FM-95). */
  returned: boolean;
  /** When it timed out, or expired, among the others. */
  order: number;
}

const MS = 1e6;
const READING = [1, 2, 3, 4, 23];
/** What shows whether the line returns what is sent (FM-93). */
const PROBE = { function: 3, address: 0, quantity: 1 } as const;

export class ModbusClient implements Session<ModbusClientEvent> {
  private up = false;
  /** When a busy line is silent; null: it is silent. */
  private silentAt: number | null = null;
  /** Until then the rest of a reply is waited for (FM-86). */
  private partial = false;
  /** The last end of the input was that of such a wait. */
  private cut = false;
  /** Until when nothing is sent; null: quiet is over. */
  private quietUntil: number | null = null;
  /** A reply has come that the line cannot have returned (FM-93). */
  private proven = false;
  private echo = new Echo(false);
  private readonly places: (Place | null)[];
  private tickets = 0;
  private lastTransaction = 0;
  private order = 0;
  /** An error of the decoder was given since the last request was sent (FM-84). */
  private damaged = false;
  /** An exception in doubt, after which nothing has come yet (FM-84). */
  private doubtful: Frame | null = null;
  /** The last read ended within corruption (FM-81). */
  private wasLost = false;
  /** The transaction of a broadcast (FM-43); null, where frames have none. */
  private readonly none: number | null;
  private readonly decoder;
  private readonly events = new Events<ModbusClientEvent>();
  private readonly config: ModbusClientConfig;

  constructor(given: Partial<ModbusClientConfig> = {}) {
    const { framing = "tcp", baud = 19200 } = given;
    const serial = framing === "rtu";
    const longest = serial ? longestFrame(baud) : 0;
    this.config = {
      framing,
      baud,
      silence: silence(framing, baud),
      timeout: 1000 * MS + 2 * longest,
      in_flight: 1,
      any_unit: false,
      broadcast: framing !== "tcp",
      turnaround: 100 * MS + longest,
      settle: (framing === "rtu_over_tcp" ? 10_000 : 1000) * MS,
      pause: 0,
      echo: false,
      places: 8,
      ...given,
    };
    const { timeout, in_flight, places } = this.config;
    require(timeout > 0, "a timeout of 0 (FM-56)");
    require(this.config.silence > 0, "a silence of 0 (FM-77)");
    require(in_flight >= 1 && in_flight <= (framing === "tcp" ? places : 1), "in_flight is outside its range (FM-56)");
    require(!(this.config.echo && framing === "tcp"), "an echo over TCP (FM-56)");
    this.places = new Array<Place | null>(places).fill(null);
    this.none = framing === "tcp" ? 0 : null;
    this.decoder = frameDecoder("server", framing === "tcp" ? "tcp" : "rtu");
  }

  connected(now: number): void {
    if (this.up) this.close();
    this.discard();
    this.wasLost = false;
    this.up = true;
    this.silentAt = null;
    this.partial = false;
    const { framing, timeout, settle, echo } = this.config;
    this.proven = framing === "tcp";
    this.echo = new Echo(echo);
    this.quietUntil = framing === "rtu" ? now + timeout + settle : null;
  }

  disconnected(): void {
    if (this.up) this.close();
    this.up = false;
  }

  /** Makes a request, and gives its ticket (FM-39). */
  request(request: RequestMessage): number {
    this.encode(request, this.none);
    if (this.isBroadcast(request) && READING.includes(request.function)) throw new Refused("broadcast_read");
    const place = this.freePlace();
    if (place === null) throw new Refused("full");
    this.tickets += 1;
    this.places[place] = { ticket: this.tickets, request, stage: "queued", transaction: null, deadline: NEVER, probed: false, returned: false, order: 0 };
    return this.tickets;
  }

  input(bytes: Uint8Array, now: number): void {
    if (!this.up) {
      this.events.push({ event: "unexpected" });
      return;
    }
    const rest = this.echo.remove(bytes, this.events, () => this.discard());
    if (rest.length === 0) return;
    if (this.silentAt !== null && !this.partial && isDue(this.silentAt, now)) this.endInput(now);
    this.decoder.push(rest);
    this.decide(now);
    this.read(now);
    if (this.config.framing === "tcp") return;
    this.silentAt = now + this.config.silence;
    const [place] = this.inFlight();
    this.partial = place !== undefined && mayBeginReply(this.decoder.waiting, sentFor(place), this.config.any_unit);
    if (place !== undefined && this.partial) this.silentAt = Math.max(this.silentAt, place.deadline);
  }

  /** One thing at a time, until nothing is left (FM-50). */
  timeout(now: number): void {
    for (;;) {
      if (this.silentAt !== null && isDue(this.silentAt, now)) {
        this.silentAt = null;
        this.endInput(now);
      }
      if (this.quietUntil !== null && isDue(this.quietUntil, now)) this.quietUntil = null;
      const late = this.inFlight().filter((place) => isDue(place.deadline, now));
      if (late.length === 0) return;
      for (const place of late) {
        if (place.stage === "probing") {
          place.stage = "queued";
          place.probed = true;
        } else {
          place.stage = "timed_out";
          this.events.push({ event: "failed", ticket: place.ticket, reason: place.returned ? "returned" : "timed_out" });
        }
      }
      const { framing, pause, settle } = this.config;
      this.rest(now, framing === "tcp" ? pause : Math.max(pause, settle));
    }
  }

  transmitted(): void {}

  transmit(now: number): Uint8Array | null {
    const { framing, in_flight, timeout, turnaround, echo } = this.config;
    if (!this.up || this.quietUntil !== null || ((framing === "rtu" || echo) && this.silentAt !== null)) return null;
    if (this.inFlight().length >= in_flight) return null;
    const place = this.queued()[0];
    if (place === undefined) return null;
    this.damaged = false;
    const { request } = place;
    if (this.isBroadcast(request)) {
      place.stage = "ended";
      this.quietUntil = now + turnaround;
      this.events.push({ event: "announced", ticket: place.ticket });
      return this.sent(this.encode(request, this.none), true);
    }
    const mirrored = isMirrored(request);
    place.stage = mirrored && !this.proven && !place.probed ? "probing" : "in_flight";
    place.deadline = now + timeout;
    place.transaction = framing === "tcp" ? this.nextTransaction() : null;
    return this.sent(this.encode(sentFor(place), place.transaction), place.stage === "probing" || !mirrored);
  }

  /** A frame that the line may return; over TCP it does not (FM-92). */
  private sent(frame: Uint8Array, isProof: boolean): Uint8Array {
    if (this.config.framing !== "tcp") this.echo.sent(frame, isProof);
    return frame;
  }

  event(): ModbusClientEvent | null {
    const event = this.events.take();
    if (event !== null && "ticket" in event) this.taken(event.ticket);
    return event;
  }

  deadline(): number {
    if (!this.up) return NEVER;
    return Math.min(this.silentAt ?? NEVER, this.quietUntil ?? NEVER, ...this.inFlight().map((place) => place.deadline));
  }

  // Places

  private occupied(): Place[] {
    return this.places.filter((place) => place !== null);
  }

  /** The requests in flight, or whose probe is. */
  private inFlight(): Place[] {
    return this.occupied().filter((place) => place.stage === "in_flight" || place.stage === "probing");
  }

  /** The oldest first. */
  private queued(): Place[] {
    return this.occupied()
      .filter((place) => place.stage === "queued")
      .sort((one, other) => one.ticket - other.ticket);
  }

  /** The lowest place without a request, or that of the request that expired longest ago (FM-39). */
  private freePlace(): number | null {
    const free = this.places.indexOf(null);
    if (free >= 0) return free;
    const [oldest] = this.occupied()
      .filter((place) => place.stage === "expired")
      .sort((one, other) => one.order - other.order);
    return oldest === undefined ? null : this.places.indexOf(oldest);
  }

  private free(place: Place): void {
    this.places[this.places.indexOf(place)] = null;
  }

  /** The caller has taken the outcome of a request. */
  private taken(ticket: number): void {
    const place = this.occupied().find((candidate) => candidate.ticket === ticket);
    if (place === undefined) return;
    if (place.stage === "timed_out") {
      place.stage = "expired";
      place.order = this.nextOrder();
    } else {
      this.free(place);
    }
  }

  private nextOrder(): number {
    this.order += 1;
    return this.order;
  }

  /** The transaction after the last, those skipped whose reply may come (FM-41). */
  private nextTransaction(): number {
    const used = this.occupied().map((place) => (place.stage === "ended" ? null : place.transaction));
    do this.lastTransaction = (this.lastTransaction + 1) & 0xffff;
    while (used.includes(this.lastTransaction));
    return this.lastTransaction;
  }

  private isBroadcast(request: RequestMessage): boolean {
    return this.config.broadcast && request.unit === 0;
  }

  private encode(request: RequestMessage, transaction: number | null): Uint8Array {
    return transaction === null ? encodeFrame(request, "client", "rtu") : encodeFrame({ ...request, transaction }, "client", "tcp");
  }

  /** A connection is lost or replaced (FM-54). */
  private close(): void {
    for (const place of this.inFlight()) if (place.stage === "in_flight") this.fail(place, "disconnected");
    for (const place of this.occupied()) {
      if (place.stage === "queued" || place.stage === "probing") this.fail(place, "not_sent");
      else if (place.stage === "timed_out") place.stage = "ended";
      else if (place.stage === "expired") this.free(place);
    }
  }

  private fail(place: Place, reason: FailReason): void {
    place.stage = "ended";
    this.events.push({ event: "failed", ticket: place.ticket, reason });
  }

  // Replies

  /** Nothing is sent for so long, if it is above 0. */
  private rest(now: number, time: number): void {
    if (time > 0) this.quietUntil = now + time;
  }

  private endInput(now: number): void {
    this.cut = this.partial;
    this.partial = false;
    this.decoder.end();
    this.decide(now);
    this.read(now);
  }

  /** More bytes have come after the exception that is in doubt, or the input has ended (FM-84). */
  private decide(now: number): void {
    const { doubtful } = this;
    this.doubtful = null;
    if (doubtful !== null) this.frame(doubtful, now);
  }

  /** Forgets what was not read yet. */
  private discard(): void {
    this.decoder.discard();
    this.doubtful = null;
  }

  private read(now: number): void {
    for (let item = this.decoder.next(); item !== null; item = this.decoder.next()) {
      if ("message" in item) {
        this.frame(item.message, now);
      } else {
        this.damaged = true;
        if (item.error.kind !== "noise") this.events.push({ event: "corrupt", error: item.error });
      }
    }
    if (this.config.framing !== "tcp") return;
    const { corruption } = this.decoder;
    if (corruption !== null && !this.wasLost) this.events.push({ event: "out_of_step", error: corruption });
    this.wasLost = corruption !== null;
  }

  /** A frame belongs to the request in flight with its transaction (FM-44). */
  private frame(frame: Frame, now: number): void {
    const { transaction = null, unit, pdu } = frame;
    const decoded = decodeFrame(frame, "server");
    const code = numberAt(pdu, 0) & 0x7f;
    const stray = { event: "stray", ...(transaction === null ? {} : { transaction }), unit, function: code } as const;
    const place = this.inFlight().find((candidate) => candidate.transaction === transaction);
    if (place === undefined) {
      const late = this.expectsNoMore(transaction);
      this.events.push({ ...stray, ...(late === null ? {} : { late }) });
      return;
    }
    const misfit = this.misfitOf(place, unit, decoded);
    if (transaction === null && misfit === null && this.isDoubtful(pdu) && this.decoder.isOpen) {
      this.doubtful = frame;
      return;
    }
    if (transaction === null && (misfit !== null || this.isDoubtful(pdu))) {
      this.events.push(misfit !== null && "mismatch" in misfit ? { ...stray, ...misfit } : stray);
      return;
    }
    const equal = place.stage === "in_flight" && transaction === null && isSame(frame, place.request);
    if (equal && !this.proven) {
      place.returned = true;
      return;
    }
    this.proven ||= !equal;
    this.rest(now, this.config.pause);
    if (place.stage === "probing") {
      place.stage = "queued";
      place.probed = true;
    } else if (misfit !== null) {
      this.fail(place, misfit);
    } else if ("message" in decoded) {
      place.stage = "ended";
      this.events.push({ event: "replied", ticket: place.ticket, message: { unit, ...asked(place.request, decoded.message as Reply) } });
    }
  }

  /** Why a frame does not fit what was sent; null, if it does (FM-44). */
  private misfitOf(place: Place, unit: number, decoded: ReturnType<typeof decodeFrame>): Misfit | null {
    if (unit !== place.request.unit && !this.config.any_unit) return { mismatch: { kind: "unit", expected: place.request.unit, found: unit } };
    if ("error" in decoded) return { malformed: decoded.error };
    const mismatch = mismatchOf(sentFor(place), decoded.message as Reply);
    return mismatch === null ? null : { mismatch };
  }

  /** Whether an exception may be data of a reply that was damaged (FM-84). */
  private isDoubtful(pdu: Uint8Array): boolean {
    return numberAt(pdu, 0) > 0x7f && this.damaged && (this.cut || !this.decoder.isAtEnd);
  }

  /** The newest request that has timed out with a transaction expects no more reply (FM-48). */
  private expectsNoMore(transaction: number | null): number | null {
    const [newest] = this.occupied()
      .filter((place) => (place.stage === "timed_out" || place.stage === "expired") && place.transaction === transaction)
      .sort((one, other) => other.ticket - one.ticket);
    if (newest === undefined) return null;
    if (newest.stage === "expired") this.free(newest);
    else newest.stage = "ended";
    return newest.ticket;
  }
}

/** The request, or the probe before it (FM-93). */
function sentFor({ stage, request }: Place): RequestMessage {
  return stage === "probing" ? { ...PROBE, unit: request.unit } : request;
}

/** Whether a frame has the bytes of a request: the line may have returned it (FM-95). */
function isSame({ unit, pdu }: Frame, request: RequestMessage): boolean {
  const sent = encodeFrame(request, "client", "rtu");
  return unit === sent[0] && pdu.length === sent.length - 3 && pdu.every((byte, at) => byte === sent[at + 1]);
}

/** Why a reply does not fit a request, in function and data; null, if it does (FM-44). */
function mismatchOf(request: Request, reply: Reply): Mismatch | null {
  if (reply.function !== request.function) return { kind: "function", expected: request.function, found: reply.function };
  if ("exception" in reply || "data" in reply) return null;
  if ("bits" in reply) return quantity(askedBytes(request.function, (request as { quantity: number }).quantity), reply.bits.length / 8);
  if ("registers" in reply) return quantity(askedBytes(request.function, (request as { quantity: number }).quantity), 2 * reply.registers.length);
  const repeated = "values" in request ? { address: request.address, quantity: request.values.length } : (request as object);
  const same = Object.entries(reply).every(([name, value]) => name === "function" || Number((repeated as Record<string, unknown>)[name]) === Number(value));
  return same ? null : { kind: "echo" };
}

function quantity(expected: number, found: number): Mismatch | null {
  return expected === found ? null : { kind: "quantity", expected, found };
}

/** A reply with as many bits as were asked for (FM-35). */
function asked(request: Request, reply: Reply): Reply {
  return "bits" in reply ? { ...reply, bits: reply.bits.slice(0, (request as { quantity: number }).quantity) } : reply;
}
