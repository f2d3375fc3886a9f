/** ISRA Robot Command Teach Ball: a force and moment ball that answers a poll with a packet. */

import { Refused, fields, integer, integers, oneOf } from "./check.js";
import { Decoder, numberAt, sum, type Found } from "./stream.js";

/** ENQ, the poll (IB-9). */
export const POLL = 0x05;
/** The data bytes of a packet of values, with the switches of the source. */
export const DATA_BYTES = 8;
/** The longest packet, and the most that an error covers (IB-8, IB-16). */
export const MAX_PACKET = 259;

const HEADER = 3;
/** The header of a packet of values. */
const VALUES_HEADER = [0x08, 0xf8, 0x5d];

export type Status = "fresh" | "old" | "reserved";

/** Forces and moments along and about X, Y, Z, in units of the sensor, −128..=127. */
export interface Values {
  sensor_type: number;
  sensor: number;
  status: Status;
  force: number[];
  moment: number[];
  /** Bit k − 1 is key k; 1 is down. */
  keys: number;
}

/** A packet with another number of data bytes than 8 (IB-13). */
export interface RawPacket {
  data: number[];
}

export type BallPacket = Values | RawPacket;

export type BallError =
  | { kind: "noise"; length: number }
  | { kind: "checksum"; offset: number; expected: number; found: number }
  | { kind: "incomplete"; expected: number; found: number };

/** The bytes of a packet of values (IB-19). */
export function encodePacket(packet: BallPacket): Uint8Array {
  fields(packet, "sensor_type", "sensor", "status", "force", "moment", "keys");
  if (!("status" in packet)) throw new Refused("message");
  const type = integer(packet.sensor_type, 0, 7, "sensor_type");
  const sensor = integer(packet.sensor, 0, 7, "sensor");
  const ab = { fresh: 0x00, old: 0x80, reserved: 0x08 }[oneOf(packet.status, ["fresh", "old", "reserved"])];
  const values = [...integers(packet.force, -128, 127, 3), ...integers(packet.moment, -128, 127, 3)];
  const data = [ab | (type << 4) | sensor, ...values.map((value) => value & 0xff), integer(packet.keys, 0, 255)];
  return Uint8Array.of(...VALUES_HEADER, ...data, checksumOf(DATA_BYTES, data));
}

function decodeData(data: Uint8Array): BallPacket {
  if (data.length !== DATA_BYTES) return { data: [...data] };
  const id = numberAt(data, 0);
  const signed = [...data].map((value) => (value << 24) >> 24);
  return {
    sensor_type: (id >> 4) & 7,
    sensor: id & 7,
    status: (id & 0x08) !== 0 ? "reserved" : (id & 0x80) !== 0 ? "old" : "fresh",
    force: signed.slice(1, 4),
    moment: signed.slice(4, 7),
    keys: numberAt(data, 7),
  };
}

/** What makes the sum of n, data and checksum 0 (IB-6). */
function checksumOf(n: number, data: Iterable<number>): number {
  return -(n + sum(data)) & 0xff;
}

/** Whether a header stands at a place, as far as its bytes are there. */
function headerAt(held: Uint8Array, place: number): boolean {
  const n = numberAt(held, place);
  const [negated, mixed] = [held[place + 1], held[place + 2]];
  return (negated === undefined || negated === (-n & 0xff)) && (mixed === undefined || mixed === (n ^ 0x55));
}

/** The host's decoder of what the ball sends (IB-14 to IB-18). */
export class BallDecoder extends Decoder<BallPacket, BallError> {
  protected read(): Found<BallPacket, BallError> | null {
    const { held, ended } = this;
    const n = held[0];
    if (n === undefined) return null;
    const header = headerAt(held, 0);
    let kind: BallError["kind"] = "noise";
    if (header && held.length >= n + 4) {
      const data = held.subarray(HEADER, HEADER + n);
      if (checksumOf(n, data) === held[HEADER + n]) return { length: n + 4, message: decodeData(data) };
      kind = "checksum";
    } else if (header) {
      if (!ended) return null;
      kind = "incomplete";
    }
    const length = this.extent();
    if (length === null) return null;
    switch (kind) {
      case "noise":
        return { length, error: { kind, length } };
      case "incomplete":
        return { length, error: { kind, expected: n + 4, found: length } };
      case "checksum": {
        const expected = checksumOf(n, held.subarray(HEADER, HEADER + n));
        return { length, error: { kind, offset: HEADER + n, expected, found: numberAt(held, HEADER + n) } };
      }
    }
  }

  /** How many bytes an error covers: up to the next whole header (IB-15, IB-16). */
  private extent(): number | null {
    const { held } = this;
    for (let place = 1; place + HEADER <= held.length && place <= MAX_PACKET; place += 1) {
      if (headerAt(held, place)) return place;
    }
    if (held.length >= MAX_PACKET + HEADER) return MAX_PACKET;
    return this.ended ? Math.min(held.length, MAX_PACKET) : null;
  }
}
