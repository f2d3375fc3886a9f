/** Checks of what an encoder is given. */

/** What an encoder refuses, without writing a byte; and a configuration or a call that is refused. */
export class Refused extends Error {
  constructor(
    readonly kind: string,
    about = kind,
  ) {
    super(about);
  }
}

/** Refuses an object that has not exactly these fields. */
export function fields(value: unknown, ...names: string[]): void {
  if (typeof value !== "object" || value === null) throw new Refused("message", "no object");
  const found = Object.keys(value);
  const wrong = found.find((name) => !names.includes(name)) ?? names.find((name) => !found.includes(name));
  if (wrong !== undefined) throw new Refused("message", `field ${wrong}`);
}

/** Whether a value is a whole number of a range that includes both ends. */
export function isInteger(value: unknown, min: number, max: number): value is number {
  return Number.isInteger(value) && (value as number) >= min && (value as number) <= max;
}

export function integer(value: unknown, min: number, max: number, kind = "message"): number {
  if (!isInteger(value, min, max)) throw new Refused(kind, `${kind}: ${String(value)} is no integer in ${min}..=${max}`);
  return value;
}

export function boolean(value: unknown): boolean {
  if (typeof value !== "boolean") throw new Refused("message", `${String(value)} is neither true nor false`);
  return value;
}

/** A list of whole numbers, of this length if one is given. */
export function integers(value: unknown, min: number, max: number, length?: number): number[] {
  if (!Array.isArray(value) || (length !== undefined && value.length !== length)) throw new Refused("message", "no list of this length");
  return value.map((element) => integer(element, min, max));
}

export function oneOf<T extends string>(value: unknown, words: readonly T[]): T {
  const word = words.find((candidate) => candidate === value);
  if (word === undefined) throw new Refused("message", `${String(value)} is none of ${words.join(", ")}`);
  return word;
}
