import type { Session } from "./cellwire.js";

export interface Driven<Calls> {
  /** Passes bytes that have arrived. */
  received(bytes: Uint8Array): void;
  /** The connection is lost: the last events are given, and nothing is done any more. */
  disconnected(): void;
  /** A call of the end's user; throws Refused. */
  call<N extends keyof Calls>(name: N, argument?: Calls[N]): void;
}

/** Runs a session on a transport, from a connection that is made to one that is lost. */
export declare function drive<Event, Calls>(session: Session<Event, Calls>, transport: {
  /** Sends bytes. */
  write(bytes: Uint8Array): unknown;
  event(event: Event): void;
  /** A serial line whose `write` resolves when the last byte has left the port. */
  transmitted?: boolean;
}): Driven<Calls>;
