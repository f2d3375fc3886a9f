/** What both ends of VAL II ALTER have in common: a decoder, and the silence that ends a frame (section 5). */

import { AlterDecoder } from "../alter-decoder.js";
import type { AlterMessage, Framing, Side } from "../val2-alter.js";
import { Events, NEVER, isDue, type Unexpected } from "./session.js";

export abstract class AlterLine<M extends AlterMessage, E> {
  protected readonly decoder: AlterDecoder<M>;
  protected readonly events = new Events<E | Unexpected>();
  /** When the silence ends a frame. */
  protected gapAt = NEVER;

  protected constructor(
    sender: Side,
    protected readonly framing: Framing,
    private readonly gap: number,
  ) {
    this.decoder = new AlterDecoder<M>(sender, framing);
  }

  /** Whether there is a connection. */
  protected abstract isOpen(): boolean;

  /** Everything that is due at `now` (AL-91). */
  protected abstract pass(now: number): void;

  /** Takes what the decoder has found. */
  protected abstract read(now: number): void;

  input(bytes: Uint8Array, now: number): void {
    if (!this.isOpen()) {
      this.events.push({ event: "unexpected" });
      return;
    }
    this.pass(now);
    this.decoder.push(bytes);
    this.read(now);
    this.gapAt = this.decoder.pending > 0 ? now + this.gap : NEVER;
  }

  timeout(now: number): void {
    this.pass(now);
  }

  transmitted(): void {}

  event(): E | Unexpected | null {
    return this.events.take();
  }

  /** The line has been silent within a frame, if the gap is due. */
  protected passGap(now: number): void {
    if (!isDue(this.gapAt, now)) return;
    this.gapAt = NEVER;
    this.endBytes(now);
  }

  /** The frame that has begun is not continued. */
  protected endBytes(now: number): void {
    this.decoder.end();
    this.read(now);
  }

  /** What is held belongs to nothing that comes. */
  protected discardBytes(): void {
    this.decoder.discard();
    this.gapAt = NEVER;
  }
}
