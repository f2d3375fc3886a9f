/** How a server finds requests among RTU frames: nowhere but where its input begins, or behind a whole frame (FM-82). */

import { MAX_RTU, RtuFrameDecoder, hasRightCrc, rtuLength, type FrameError } from "../fanuc-hmi-modbus.js";
import { byteAt } from "../stream.js";

const MIN_RTU = 4;

/** A frame at the beginning of bytes; `skipped`: only a reply is that long. */
export type LineFrame = { length: number; skipped: boolean };

/** Which unit a server is, or null for every one. */
export type Unit = number | null;

function isOurs(bytes: Uint8Array, unit: Unit): boolean {
  return unit === null || bytes[0] === unit || bytes[0] === 0;
}

/** The lengths that the bytes can have, as a request and, unless it is for us, also as a reply. */
function lengths(bytes: Uint8Array, unit: Unit): { request: ReturnType<typeof rtuLength>; reply: ReturnType<typeof rtuLength> | null } {
  return { request: rtuLength(bytes, "client"), reply: isOurs(bytes, unit) ? null : rtuLength(bytes, "server") };
}

/** Whether one of the lengths needs bytes that are not there. */
export function needsMore(bytes: Uint8Array, unit: Unit): boolean {
  const { request, reply } = lengths(bytes, unit);
  return [request, reply].some((length) => {
    if (length === null || length === "silence") return false;
    return "needed" in length || (length.known <= MAX_RTU && length.known > bytes.length);
  });
}

/** The frame that bytes begin with; "wait", if more bytes may show one; null, if there is none. */
export function lineFrame(bytes: Uint8Array, ended: boolean, unit: Unit, throughTcp: boolean): LineFrame | "wait" | null {
  const size = bytes.length;
  const more = needsMore(bytes, unit);
  if (ended && size >= MIN_RTU && size <= MAX_RTU && hasRightCrc(bytes) && !(throughTcp && more)) return { length: size, skipped: false };
  if (!ended && more) return "wait";
  const { request, reply } = lengths(bytes, unit);
  const candidates = [request, reply]
    .map((length) => (length !== null && length !== "silence" && "known" in length ? length.known : 0))
    .map((length, index) => ({ length, skipped: index === 1 }))
    .filter(({ length }) => length >= MIN_RTU && length <= Math.min(size, MAX_RTU) && hasRightCrc(bytes.subarray(0, length)))
    .sort((one, other) => other.length - one.length);
  if (candidates[0] !== undefined) return candidates[0];
  return !ended && size <= MAX_RTU ? "wait" : null;
}

/** The error of bytes that are no frame: that of a decoder of requests (FM-73). */
export function lineError(bytes: Uint8Array): FrameError {
  const decoder = new RtuFrameDecoder("client");
  decoder.push(bytes);
  decoder.end();
  const item = decoder.next();
  return item !== null && "error" in item ? item.error : { kind: "cut", expected: MIN_RTU, found: bytes.length };
}

/** The unit and the PDU of a frame. */
export function partsOf(frame: Uint8Array): { unit: number; pdu: Uint8Array } {
  return { unit: byteAt(frame, 0), pdu: frame.subarray(1, -2) };
}
