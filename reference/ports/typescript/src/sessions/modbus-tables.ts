/** Tables of a Modbus server, and how its functions are carried out (FM-64). */

import { type RawPdu, type Reply, type Request } from "../modbus-pdu.js";

/** Codes of exceptions (FM-70). */
export const ILLEGAL_FUNCTION = 1;
export const ILLEGAL_ADDRESS = 2;
export const ILLEGAL_VALUE = 3;
export const SERVER_FAILURE = 4;

/** What carries out a request that is well-formed: a reply, or the code of an exception, which leaves everything as it was. */
export interface ModbusTables {
  /** Whether the server has a function. */
  has(code: number): boolean;
  serve(request: Request): Reply | number;
}

/** Tables in memory; a table that is left out has none of its functions. */
export class MemoryTables implements ModbusTables {
  constructor(
    private readonly tables: { coils?: boolean[]; discreteInputs?: boolean[]; holdingRegisters?: number[]; inputRegisters?: number[] },
    /** Functions of the server's own. */
    private readonly others: Readonly<Record<number, (request: RawPdu) => Reply | number>> = {},
  ) {}

  has(code: number): boolean {
    if (code in this.others) return true;
    const { coils, discreteInputs, holdingRegisters, inputRegisters } = this.tables;
    switch (code) {
      case 1:
      case 5:
      case 15:
        return coils !== undefined;
      case 2:
        return discreteInputs !== undefined;
      case 3:
      case 6:
      case 16:
      case 22:
      case 23:
        return holdingRegisters !== undefined;
      case 4:
        return inputRegisters !== undefined;
      default:
        return false;
    }
  }

  serve(request: Request): Reply | number {
    if ("data" in request) return this.others[request.function]?.(request) ?? ILLEGAL_FUNCTION;
    const { coils = [], discreteInputs = [], holdingRegisters = [], inputRegisters = [] } = this.tables;
    switch (request.function) {
      case 1:
      case 2: {
        const bits = slice(request.function === 1 ? coils : discreteInputs, request.address, request.quantity);
        return bits === null ? ILLEGAL_ADDRESS : { function: request.function, bits };
      }
      case 3:
      case 4: {
        const registers = slice(request.function === 3 ? holdingRegisters : inputRegisters, request.address, request.quantity);
        return registers === null ? ILLEGAL_ADDRESS : { function: request.function, registers };
      }
      case 5:
        return write(coils, request.address, [request.value]) ? request : ILLEGAL_ADDRESS;
      case 6:
        return write(holdingRegisters, request.address, [request.value]) ? request : ILLEGAL_ADDRESS;
      case 15: {
        const { address, values } = request;
        return write(coils, address, values) ? { function: 15, address, quantity: values.length } : ILLEGAL_ADDRESS;
      }
      case 16: {
        const { address, values } = request;
        return write(holdingRegisters, address, values) ? { function: 16, address, quantity: values.length } : ILLEGAL_ADDRESS;
      }
      case 22: {
        const { address, and, or } = request;
        const [register] = slice(holdingRegisters, address, 1) ?? [];
        if (register === undefined) return ILLEGAL_ADDRESS;
        write(holdingRegisters, address, [((register & and) | (or & ~and)) & 0xffff]);
        return request;
      }
      case 23: {
        // It writes before it reads (FM-15), and does neither if it cannot do both.
        const { address, quantity, write_address, values } = request;
        if (slice(holdingRegisters, address, quantity) === null) return ILLEGAL_ADDRESS;
        if (!write(holdingRegisters, write_address, values)) return ILLEGAL_ADDRESS;
        return { function: 23, registers: slice(holdingRegisters, address, quantity) ?? [] };
      }
    }
  }
}

function slice<T>(table: readonly T[], address: number, quantity: number): T[] | null {
  return address + quantity <= table.length ? table.slice(address, address + quantity) : null;
}

/** Writes all values, or none. */
function write<T>(table: T[], address: number, values: readonly T[]): boolean {
  if (address + values.length > table.length) return false;
  table.splice(address, values.length, ...values);
  return true;
}

/** Whether a request reaches beyond address 65535 (FM-34). */
export function isBeyondLast(request: Request): boolean {
  if ("data" in request) return false;
  const quantity = "quantity" in request ? request.quantity : "values" in request ? request.values.length : 1;
  const written = "write_address" in request ? request.write_address + request.values.length : 0;
  return request.address + quantity > 0x10000 || written > 0x10000;
}

