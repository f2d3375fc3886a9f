/** Tables of a Modbus server, and how its functions are carried out (FM-64). */

import { type RawPdu, type Reply, type Request } from "../modbus-pdu.js";

/** Codes of exceptions (FM-70). */
export const ILLEGAL_FUNCTION = 1;
export const ILLEGAL_ADDRESS = 2;
export const ILLEGAL_VALUE = 3;
export const SERVER_FAILURE = 4;

/** What carries out a request that is well-formed: a reply, or the code of an exception, which leaves everything as it was. */
export interface ModbusTables {
  serve(request: Request): Reply | number;
}

/** Tables in memory; a table that is left out has none of its functions. */
export class MemoryTables implements ModbusTables {
  constructor(
    private readonly tables: { coils?: boolean[]; discreteInputs?: boolean[]; holdingRegisters?: number[]; inputRegisters?: number[] },
    /** Functions of the server's own. */
    private readonly others: Readonly<Record<number, (request: RawPdu) => Reply | number>> = {},
  ) {}

  serve(request: Request): Reply | number {
    if ("data" in request) return this.others[request.function]?.(request) ?? ILLEGAL_FUNCTION;
    const { coils, discreteInputs, holdingRegisters, inputRegisters } = this.tables;
    switch (request.function) {
      case 1:
      case 2: {
        const bits = read(request.function === 1 ? coils : discreteInputs, request.address, request.quantity);
        return typeof bits === "number" ? bits : { function: request.function, bits };
      }
      case 3:
      case 4: {
        const registers = read(request.function === 3 ? holdingRegisters : inputRegisters, request.address, request.quantity);
        return typeof registers === "number" ? registers : { function: request.function, registers };
      }
      case 5:
        return write(coils, request.address, [request.value]) ?? request;
      case 6:
        return write(holdingRegisters, request.address, [request.value]) ?? request;
      case 15: {
        const { address, values } = request;
        return write(coils, address, values) ?? { function: 15, address, quantity: values.length };
      }
      case 16: {
        const { address, values } = request;
        return write(holdingRegisters, address, values) ?? { function: 16, address, quantity: values.length };
      }
      case 22: {
        const { address, and, or } = request;
        const registers = read(holdingRegisters, address, 1);
        if (typeof registers === "number") return registers;
        const masked = registers.map((register) => (register & and) | (or & ~and));
        return write(holdingRegisters, address, masked) ?? request;
      }
      case 23: {
        // It writes before it reads (FM-15), and does neither if it cannot do both.
        const { address, quantity, write_address, values } = request;
        const readAll = (): Reply | number => {
          const registers = read(holdingRegisters, address, quantity);
          return typeof registers === "number" ? registers : { function: 23, registers };
        };
        const before = readAll();
        if (typeof before === "number") return before;
        return write(holdingRegisters, write_address, values) ?? readAll();
      }
    }
  }
}

/** Items of a table, or the code of an exception. */
function read<T>(table: readonly T[] | undefined, address: number, quantity: number): T[] | number {
  if (table === undefined) return ILLEGAL_FUNCTION;
  return address + quantity <= table.length ? table.slice(address, address + quantity) : ILLEGAL_ADDRESS;
}

/** Writes all values, or none and gives the code of an exception. */
function write<T>(table: T[] | undefined, address: number, values: readonly T[]): number | null {
  const before = read(table, address, values.length);
  if (typeof before === "number") return before;
  table?.splice(address, values.length, ...values);
  return null;
}

/** Whether a request reaches beyond address 65535 (FM-34). */
export function isBeyondLast(request: Request): boolean {
  if ("data" in request) return false;
  const quantity = "quantity" in request ? request.quantity : "values" in request ? request.values.length : 1;
  const written = "write_address" in request ? request.write_address + request.values.length : 0;
  return request.address + quantity > 0x10000 || written > 0x10000;
}

