// The links of a robot cell: codecs and sessions, which are cellwire.wasm. `load` gives them; types are in cellwire.d.ts.

/** The input of a call that a codec or a session refuses; `refusal` is the object of its error. */
export class Refused extends Error {
  constructor(refusal, text = refusal.kind) {
    super(text);
    this.name = "Refused";
    this.refusal = refusal;
  }
}

/** A time without an end. */
export const NEVER = (1n << 64n) - 1n;

/** The time since the program began, in nanoseconds. */
export const now = () => BigInt(Math.round(performance.now() * 1e6));

/** Instantiates the module: a URL of it, its bytes, or a compiled WebAssembly.Module. */
export async function load(module = new URL("cellwire.wasm", import.meta.url)) {
  if (module instanceof URL) {
    // Node has no fetch of files.
    module = module.protocol === "file:"
      ? await (await import("node:fs/promises")).readFile(module)
      : await (await fetch(module)).arrayBuffer();
  }
  const made = await WebAssembly.instantiate(module);
  return new Cellwire((made.instance ?? made).exports);
}

/** JSON with the numbers that JSON.stringify does not write: bigint, negative zero, and Infinity for never. */
export function stringify(value) {
  if (typeof value === "bigint") return String(value);
  if (Object.is(value, -0)) return "-0.0";
  if (value === Infinity) return String(NEVER);
  if (Array.isArray(value)) return `[${value.map((each) => stringify(each ?? null)).join()}]`;
  if (value === null || typeof value !== "object") return JSON.stringify(value);
  const fields = Object.entries(value).filter(([, each]) => each !== undefined);
  return `{${fields.map(([name, each]) => `${JSON.stringify(name)}:${stringify(each)}`).join()}}`;
}

const encoder = new TextEncoder(), decoder = new TextDecoder();

class Cellwire {
  #wasm;
  #released = new FinalizationRegistry((number) => this.#wasm.release(number));

  constructor(wasm) {
    this.#wasm = wasm;
    this.links = this.#ask("links");
  }

  /** Every message and error of these bytes, which are a whole stream. */
  decode(link, bytes, side = {}) {
    const stream = this.decoder(link, side);
    try {
      return [...stream.push(bytes), ...stream.finish()];
    } finally {
      stream.free();
    }
  }

  /** The bytes of a message. */
  encode(link, message, { from, options } = {}) {
    return Uint8Array.from(this.#ask({ encode: { link, from, options, message } }).bytes);
  }

  /** A decoder of a stream. */
  decoder(link, { from, options } = {}) {
    return new Decoder(this.#make({ decoder: { link, from, options } }));
  }

  /** An end of a link; `config` are the fields other than the defaults. */
  session(link, end, config = {}) {
    return new Session(this.#make({ session: { link, end, config } }), link, end);
  }

  #make(request) {
    const wasm = this.#wasm, { number } = this.#ask(request);
    const held = { wasm, number, ask: (request) => this.#ask(request), free: () => { this.#released.unregister(held); wasm.release(number); } };
    this.#released.register(held, number, held);
    return held;
  }

  #ask(request) {
    put(this.#wasm, encoder.encode(stringify(request)));
    const answer = JSON.parse(take(this.#wasm, this.#wasm.answer()));
    if (answer.wrong !== undefined) throw new TypeError(answer.wrong);
    if (answer.refused !== undefined) throw new Refused(answer.refused, answer.text);
    return answer;
  }
}

/** A decoder of one side: items cover the stream, however it is divided. */
class Decoder {
  #held;

  constructor(held) {
    this.#held = held;
  }

  /** The items that these bytes complete. */
  push(bytes) {
    const { wasm, number } = this.#held;
    put(wasm, bytes);
    return JSON.parse(take(wasm, wasm.push(number)));
  }

  /** The items that only the end gives: the stream has ended, or the line is silent. */
  finish() {
    const { wasm, number } = this.#held;
    return JSON.parse(take(wasm, wasm.finish(number)));
  }

  /** Drops it at once; otherwise the garbage collector does. */
  free() {
    this.#held.free();
  }
}

/** One end of a link, without a clock and without a socket. Times are nanoseconds of any clock that does not go back. */
class Session {
  #held;

  constructor(held, link, end) {
    this.#held = held;
    this.link = link;
    this.end = end;
  }

  handleConnected(now) {
    this.#handle(0, now);
  }

  handleDisconnected(now) {
    this.#handle(1, now);
  }

  handleTimeout(now) {
    this.#handle(2, now);
  }

  /** The last byte has left the port. */
  handleTransmitted(now) {
    this.#handle(3, now);
  }

  handleInput(bytes, now) {
    put(this.#held.wasm, bytes);
    this.#handle(4, now);
  }

  #handle(what, now) {
    this.#held.wasm.handle(this.#held.number, what, now);
  }

  /** The bytes to transmit next, or null. */
  pollTransmit(now) {
    const { wasm, number } = this.#held, length = wasm.poll_transmit(number, now);
    return length < 0 ? null : output(wasm, length).slice();
  }

  /** The next event, or null. */
  pollEvent() {
    const { wasm, number } = this.#held, length = wasm.poll_event(number);
    return length === 0 ? null : JSON.parse(take(wasm, length));
  }

  /** When to call handleTimeout and pollTransmit at the latest, or null. */
  pollTimeout() {
    const deadline = BigInt.asUintN(64, this.#held.wasm.poll_timeout(this.#held.number));
    return deadline === NEVER ? null : deadline;
  }

  /** Whether it reads input now; if not, leave the bytes in the transport. */
  get wantsInput() {
    return this.#held.wasm.wants_input(this.#held.number) !== 0;
  }

  /** A call of the end's user; throws Refused. */
  call(name, argument, now) {
    this.#held.ask({ call: { session: this.#held.number, now, name, argument: argument ?? null } });
  }

  /** Its counters. */
  get statistics() {
    return this.#held.ask({ statistics: { session: this.#held.number } });
  }

  /** Drops it at once; otherwise the garbage collector does. */
  free() {
    this.#held.free();
  }
}

function put(wasm, bytes) {
  const at = wasm.reserve(bytes.length);
  new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
}

const output = (wasm, length) => new Uint8Array(wasm.memory.buffer, wasm.answered(), length);
const take = (wasm, length) => decoder.decode(output(wasm, length));
