/** What the decoders of all links have in common. */

/** A frame or an error, and the bytes that belong to it: items cover the stream without gaps. */
export type Item<M, E> = { offset: number; length: number } & ({ message: M } | { error: E });

/** What every decoder does. */
export interface ItemReader<M, E> {
  push(bytes: Uint8Array): void;
  end(): void;
  next(): Item<M, E> | null;
}

/** What a decoder finds at the beginning of the bytes that it holds. */
export type Found<M, E> = { length: number } & ({ message: M } | { error: E });

/**
 * A decoder of one side of a link. Give it bytes with `push`, and take items with `next` until there is none. `end` says that
 * the stream has ended (or that the line has fallen silent, or that the datagram is over); bytes may follow.
 */
export abstract class Decoder<M, E> implements ItemReader<M, E> {
  /** Bytes that belong to no item yet. */
  protected held: Uint8Array = new Uint8Array(0);
  /** Bytes of the next item that are not kept any more. */
  protected dropped = 0;
  protected ended = false;
  /** The offset in the stream of the next item. */
  protected position = 0;

  push(bytes: Uint8Array): void {
    this.held = concat(this.held, bytes);
  }

  end(): void {
    this.ended = true;
  }

  next(): Item<M, E> | null {
    const found = this.read();
    if (found === null) {
      this.ended = false;
      return null;
    }
    const offset = this.position;
    this.position += found.length;
    this.held = this.held.subarray(found.length - this.dropped);
    this.dropped = 0;
    return { ...found, offset };
  }

  /** How many bytes are held that belong to no item yet. */
  get pending(): number {
    return this.dropped + this.held.length;
  }

  /** The bytes that are held. */
  get waiting(): Uint8Array {
    return this.held;
  }

  /** Whether the input has ended, and all of it was given. */
  get isAtEnd(): boolean {
    return this.ended && this.held.length === 0;
  }

  /** Whether all that has come was given, and the input has not ended. */
  get isOpen(): boolean {
    return !this.ended && this.held.length === 0;
  }

  /** Forgets what is held, without a report. */
  discard(): void {
    this.position += this.pending;
    this.held = new Uint8Array(0);
    this.dropped = 0;
    this.ended = false;
  }

  /** Gives up the first bytes of the next item, which count as its own. */
  protected drop(count: number): void {
    this.held = this.held.subarray(count);
    this.dropped += count;
  }

  /** The next item, which covers at least one byte; or null, if more bytes are needed. */
  protected abstract read(): Found<M, E> | null;
}

export function concat(...parts: Uint8Array[]): Uint8Array {
  const whole = new Uint8Array(parts.reduce((size, part) => size + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

/** The number at a place that is known to be there: a byte, a register. */
export function numberAt(numbers: ArrayLike<number>, place: number): number {
  return numbers[place] ?? 0;
}

/** The sum of bytes. */
export function sum(bytes: Iterable<number>): number {
  let total = 0;
  for (const byte of bytes) total += byte;
  return total;
}

/** One byte a character, U+0000 to U+00FF. */
export function latin1(bytes: Uint8Array): string {
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return text;
}

/** The bytes of a text of characters U+0000 to U+00FF. */
export function bytesOf(text: string): Uint8Array {
  return Uint8Array.from(text, (character) => character.charCodeAt(0));
}
