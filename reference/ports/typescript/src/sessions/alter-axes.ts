/** The values of the host's replies, and for which axes the controller may hold a word that is not zero (AL-63 to AL-65, AL-95). */

import { CYCLE, isCumulative } from "./alter-timing.js";
import { AT_REST, MAX_WORD, brake, positions, speeds, takenBack, type AxisState, type Limits } from "./alter-limiter.js";

/** What moves an arm: `hold` is an interruption, `none` a target that is missing or stale. */
export type Aim = { target: number[] } | "none" | "hold" | "zero";

const AXES = 6;

export class AlterAxes {
  private axes = atRest();
  /** Axes for which the controller may hold a word that is not zero. */
  kept = new Set<number>();
  private sent = new Set<number>();
  /** From when on a message settles what was sent, where replies may be late (AL-95). */
  private settlesAt = 0;
  /** The message before said that ALTER is interrupted. */
  private wasInterrupted = false;

  constructor(
    private readonly mode: number,
    private readonly limits: Limits,
    /** Replies may be so late that two of them come in one window (AL-95). */
    private readonly late: boolean,
    private readonly settles: number,
  ) {}

  /** ALTER is accepted: everything is at zero and at rest (AL-51). */
  reset(now: number): void {
    this.axes = atRest();
    this.kept = new Set();
    this.sent = new Set();
    this.settlesAt = now + 2 * (this.settles + CYCLE);
    this.wasInterrupted = false;
  }

  /** A standard message has come (AL-64, AL-95). */
  message(error: number, interrupted: boolean, now: number): void {
    const { sent } = this;
    if (!this.late) {
      this.kept = error === 0 ? sent : union(this.kept, sent);
      this.sent = this.kept;
      return;
    }
    this.kept = union(this.kept, sent);
    if (interrupted || this.wasInterrupted) {
      this.sent = this.kept;
    } else if (error === 0 && now >= this.settlesAt) {
      this.kept = sent;
      this.sent = new Set();
      this.settlesAt = now + 2 * (this.settles + CYCLE);
    }
    this.wasInterrupted = interrupted;
  }

  /** A message may have been among corrupt bytes. */
  corrupt(): void {
    if (this.late) this.sent = union(this.sent, this.kept);
  }

  /** A reply was missed: the axes start again from rest. */
  missed(): void {
    this.axes = this.axes.map((axis) => ({ ...axis, speed: 0 }));
  }

  /** The controller says that it has not read the last reply. */
  rejected(): void {
    this.axes = this.axes.map(takenBack);
  }

  get isMoving(): boolean {
    return this.axes.some(({ speed }) => speed !== 0);
  }

  /** The axes as they are after a reply that aims there. */
  next(aim: Aim): AxisState[] {
    const cumulative = isCumulative(this.mode);
    return this.axes.map((axis, index) => {
      const [v = 0, a = 0] = [this.limits.velocity[index], this.limits.acceleration[index]].map((limit = 0) => Math.min(limit, MAX_WORD));
      if (aim === "hold") return { ...axis, speed: 0 };
      if (aim === "none") return cumulative ? speeds(axis, 0, v, a) : brake(axis, v, a);
      const target = aim === "zero" ? 0 : (aim.target[index] ?? 0);
      return cumulative ? speeds(axis, target, v, a) : positions(axis, target, v, a);
    });
  }

  valueOf({ speed, position }: AxisState): number {
    return isCumulative(this.mode) ? speed : position;
  }

  /** A reply with these axes is sent; a word that is left out stays at zero (AL-65). */
  reply(axes: AxisState[], transmitted: Set<number>, uncertain: boolean): void {
    this.axes = axes.map((axis, index) => (transmitted.has(index) ? axis : AT_REST));
    let sent = new Set([...transmitted].filter((index) => this.valueOf(axes[index] ?? AT_REST) !== 0));
    if (uncertain) {
      this.kept = union(this.kept, sent);
      sent = this.kept;
    }
    this.sent = this.late ? union(this.sent, sent) : sent;
  }
}

function atRest(): AxisState[] {
  return Array.from({ length: AXES }, () => AT_REST);
}

function union(one: Set<number>, other: Set<number>): Set<number> {
  return new Set([...one, ...other]);
}
