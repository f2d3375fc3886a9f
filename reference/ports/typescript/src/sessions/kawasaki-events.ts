/** Events of an end of kawasaki-msg that wait to be taken (KM-81, KM-120). */

const PLACES = 32;

export class KawasakiEvents<E> {
  private readonly waiting: E[] = [];

  /** Outcomes are kept; all others are notices. */
  constructor(private readonly isOutcome: (event: E) => boolean) {}

  /** Of notices that find no place the oldest is lost. */
  push(event: E): void {
    this.waiting.push(event);
    if (this.waiting.length <= PLACES) return;
    const oldest = this.waiting.findIndex((waiting) => !this.isOutcome(waiting));
    this.waiting.splice(oldest, 1);
  }

  take(): E | null {
    return this.waiting.shift() ?? null;
  }

  /** Room for so many outcomes. */
  hasRoom(outcomes: number): boolean {
    return this.waiting.filter(this.isOutcome).length + outcomes <= PLACES;
  }
}
