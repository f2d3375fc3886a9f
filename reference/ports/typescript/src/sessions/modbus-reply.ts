/** What a client takes for the beginning of a reply in RTU frames (FM-86). */

import { MAX_RTU, MIN_RTU, hasRightCrc, rtuLength, type RequestMessage } from "../fanuc-hmi-modbus.js";

/** What begins with some bytes. */
type Begins = "part" | "whole" | "other";

/** Whether the rest of the reply may follow these bytes. */
export function mayBeginReply(held: Uint8Array, request: RequestMessage, anyUnit: boolean): boolean {
  const found = Array.from(held, (_, at) => begins(held.subarray(at), request, anyUnit));
  return found[0] === "part" || (found.includes("part") && !found.includes("whole"));
}

function begins(bytes: Uint8Array, request: RequestMessage, anyUnit: boolean): Begins {
  const [unit, code] = bytes;
  if (!anyUnit && unit !== request.unit) return "other";
  if (code !== undefined && (code & 0x7f) !== request.function) return "other";
  const isWhole = bytes.length >= MIN_RTU && bytes.length <= MAX_RTU && hasRightCrc(bytes);
  const length = rtuLength(bytes, "server");
  if (length === "silence") return isWhole ? "whole" : "part";
  if (!("known" in length)) return "part";
  if (length.known < bytes.length || !hasAskedCount(bytes, request)) return "other";
  if (length.known > bytes.length) return "part";
  return isWhole ? "whole" : "other";
}

/** Whether the reply to a read, as far as it has come, counts the bytes that were asked for. */
function hasAskedCount(bytes: Uint8Array, request: RequestMessage): boolean {
  const [, code, count] = bytes;
  if (code === undefined || count === undefined || code >= 0x80 || !("quantity" in request)) return true;
  return count === askedBytes(request.function, request.quantity);
}

/** How many bytes of data the reply to a read has. */
export function askedBytes(code: number, quantity: number): number {
  return code <= 2 ? Math.ceil(quantity / 8) : 2 * quantity;
}

/** Whether a reply can begin with the bytes of the request (FM-93). */
export function isMirrored(request: RequestMessage): boolean {
  if ("quantity" in request) return request.address >> 8 === askedBytes(request.function, request.quantity);
  return !("values" in request);
}
