import type { Links } from "./links.js";

export type { Links };
/** Nanoseconds of any clock that does not go back. */
export type Time = bigint;

type End<L extends keyof Links, E extends keyof Links[L]["ends"]> = Links[L]["ends"][E] & { config: unknown; event: unknown; calls: object };
type From<L extends keyof Links> = keyof Links[L]["messages"] & string;

/** A side of a link, the first if none is named, and the settings of its bytes. */
export interface Side<L extends keyof Links, F extends From<L> = From<L>> {
  from?: F;
  options?: Partial<Links[L]["options"]>;
}

/** The bytes of a message, or corrupt bytes. */
export type Item<L extends keyof Links, F extends From<L> = From<L>> = {
  /** The first byte, from the start of the stream. */
  offset: number;
  length: number;
  /** It is given only because the stream ends. */
  end?: true;
} & ({ message: Links[L]["messages"][F]; error?: never } | { error: Links[L]["error"]; message?: never });

export declare const NEVER: Time;
export declare function now(): Time;
/** JSON in which bigint, negative zero and Infinity (never) are numbers. */
export declare function stringify(value: unknown): string;

/** The input of a call that a codec or a session refuses. */
export declare class Refused extends Error {
  readonly refusal: { kind: string; [field: string]: unknown };
}

/** Instantiates the module, which is beside this file if none is given. */
export declare function load(module?: URL | BufferSource | WebAssembly.Module): Promise<Cellwire>;

export interface Cellwire {
  readonly links: readonly { name: keyof Links; about: string; sides: string[]; ends: Record<string, string[]> }[];
  /** Every message and error of these bytes, which are a whole stream. */
  decode<L extends keyof Links, F extends From<L>>(link: L, bytes: Uint8Array, side?: Side<L, F>): Item<L, F>[];
  /** The bytes of a message; throws Refused. */
  encode<L extends keyof Links, F extends From<L>>(link: L, message: Links[L]["messages"][F], side?: Side<L, F>): Uint8Array;
  decoder<L extends keyof Links, F extends From<L>>(link: L, side?: Side<L, F>): Decoder<L, F>;
  /** An end; `config` are the fields other than the defaults. Throws Refused. */
  session<L extends keyof Links, E extends keyof Links[L]["ends"] & string>(link: L, end: E, config?: Partial<End<L, E>["config"]>): Session<End<L, E>["event"], End<L, E>["calls"]>;
}

/** A decoder of one side: items cover the stream, however it is divided. */
export interface Decoder<L extends keyof Links, F extends From<L> = From<L>> {
  push(bytes: Uint8Array): Item<L, F>[];
  /** The items that only the end gives: the stream has ended, or the line is silent. */
  finish(): Item<L, F>[];
  free(): void;
}

/** One end of a link. After each `handle…` and each call: take the events, then what it transmits, until there is neither. */
export interface Session<Event, Calls> {
  handleConnected(now: Time): void;
  handleDisconnected(now: Time): void;
  handleInput(bytes: Uint8Array, now: Time): void;
  handleTimeout(now: Time): void;
  /** The last byte has left the port. */
  handleTransmitted(now: Time): void;
  pollEvent(): Event | null;
  pollTransmit(now: Time): Uint8Array | null;
  /** When to call `handleTimeout` and `pollTransmit` at the latest. */
  pollTimeout(): Time | null;
  readonly wantsInput: boolean;
  /** A call of the end's user; throws Refused, and nothing has changed. */
  call<N extends keyof Calls>(name: N, argument: Calls[N], now: Time): void;
  readonly statistics: Record<string, number>;
  free(): void;
}
