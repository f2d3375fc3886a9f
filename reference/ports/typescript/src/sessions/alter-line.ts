/** What both ends of VAL II ALTER have in common: a decoder, and the silence that ends a frame (section 5). */

import { AlterDecoder } from "../alter-decoder.js";
import type { AlterMessage, Framing, Side } from "../val2-alter.js";
import { NEVER, isDue, type Unexpected } from "./session.js";

/** Reports that wait for the owner. */
const PLACES = 16;

export abstract class AlterLine<M extends AlterMessage, E> {
  protected readonly decoder: AlterDecoder<M>;
  private readonly waiting: { report: E | Unexpected; isOutcome: boolean }[] = [];
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
      this.notice({ event: "unexpected" });
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
    return this.waiting.shift()?.report ?? null;
  }

  /** A report that may be dropped (AL-96). */
  protected notice(report: E | Unexpected): void {
    this.report(report, false);
  }

  /** A report that is never dropped. */
  protected outcome(report: E): void {
    this.report(report, true);
  }

  private report(report: E | Unexpected, isOutcome: boolean): void {
    this.waiting.push({ report, isOutcome });
    if (this.waiting.length <= PLACES) return;
    const oldest = this.waiting.findIndex((each) => !each.isOutcome);
    this.waiting.splice(oldest, 1);
  }

  /** Whether so many more outcomes fit (AL-96). */
  protected hasRoom(outcomes: number): boolean {
    return this.waiting.filter(({ isOutcome }) => isOutcome).length + outcomes <= PLACES;
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
