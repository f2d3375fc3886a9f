/** How a server finds requests among RTU frames: nowhere but where its input begins, or behind a whole frame (FM-82). */

import { MAX_RTU, MIN_RTU, RtuFrameDecoder, hasRightCrc, rtuLength, type FrameError, type RtuLength } from "../fanuc-hmi-modbus.js";
import { numberAt } from "../stream.js";

/** Which unit a server is, or null for every one. */
export type Unit = number | null;

function isOurs(bytes: Uint8Array, unit: Unit): boolean {
  return unit === null || bytes[0] === unit || bytes[0] === 0;
}

/** The lengths that the bytes can have, as a request and, unless it is for us, also as a reply. */
function lengths(bytes: Uint8Array, unit: Unit): RtuLength[] {
  const request = rtuLength(bytes, "client");
  return isOurs(bytes, unit) ? [request] : [request, rtuLength(bytes, "server")];
}

/** Whether one of the lengths needs bytes that are not there. */
export function needsMore(bytes: Uint8Array, unit: Unit): boolean {
  return lengths(bytes, unit).some((length) => {
    if (length === "silence") return false;
    return "needed" in length || (length.known <= MAX_RTU && length.known > bytes.length);
  });
}

/** The bytes of a message that has ended behind the frames at its beginning. */
export function behindFrames(bytes: Uint8Array, unit: Unit): Uint8Array {
  let left = bytes;
  for (let length; left.length > 0 && (length = endedFrame(left, unit, false)) !== null; ) left = left.subarray(length);
  return left;
}

/** Whether the rest of a message may come after a silence; `pieces` are what came after each silence before (FM-87). */
export function mayGoOn(bytes: Uint8Array, unit: Unit, pieces: Uint8Array[]): boolean {
  let left = bytes;
  for (let length; left.length > 0 && (length = openFrame(left, unit)) !== null; ) left = left.subarray(length);
  if (needsMore(left, unit)) return true;
  if (left.length > MAX_RTU || !lengths(left, unit).includes("silence")) return false;
  return pieces.every((piece) => behindFrames(piece, unit).length > 0);
}

/** The longest of the lengths whose CRC is right; null, if there is none. */
function longestRight(bytes: Uint8Array, unit: Unit): number | null {
  const right = lengths(bytes, unit)
    .flatMap((length) => (length !== "silence" && "known" in length ? [length.known] : []))
    .filter((length) => length <= Math.min(bytes.length, MAX_RTU) && hasRightCrc(bytes.subarray(0, length)));
  return right.length === 0 ? null : Math.max(...right);
}

/** The length of the frame that bytes begin with behind which more may come; null, if there is none, or more bytes have to show it. */
export function openFrame(bytes: Uint8Array, unit: Unit): number | null {
  return needsMore(bytes, unit) ? null : longestRight(bytes, unit);
}

/** The length of the frame that bytes begin with behind which the input has ended; null, if there is none. */
export function endedFrame(bytes: Uint8Array, unit: Unit, throughTcp: boolean): number | null {
  const size = bytes.length;
  const isWhole = size >= MIN_RTU && size <= MAX_RTU && hasRightCrc(bytes) && !(throughTcp && needsMore(bytes, unit));
  return isWhole ? size : longestRight(bytes, unit);
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
  return { unit: numberAt(frame, 0), pdu: frame.subarray(1, -2) };
}
