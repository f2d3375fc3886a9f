/** What a central controller of the MM&A cell knows of a device's motion (section 7.3). */

import { MAX_COUNT, countsOf, type Command, type StatusReply } from "../mmacell-proto.js";

/** Where a motion goes: coordinates as counts of their last digit, or not known, or nowhere. */
type Target = "none" | "unknown" | number[];

type State =
  /** A status that was asked for before `believedFrom` may be older than the motion. */
  | { phase: "starting"; target: Target; believedFrom: number }
  | { phase: "moving"; target: Target }
  | { phase: "stopping" }
  /** The pose is null while it is unknown. */
  | { phase: "rest"; target: Target; pose: number[] | null };

/** What a status says about the motion (MM-70). */
export type MotionReport = "moving" | "stopping" | "still" | "starting" | "arrived" | { missed: "servo_off" | "elsewhere" };

export class Motion {
  private state: State = { phase: "rest", target: "none", pose: null };

  constructor(
    /** How long after the start of a motion a status may be older than it, in ns. */
    private readonly settle: number,
    /** How far from its target a device has arrived, in its last digit. */
    private readonly tolerance: number,
  ) {}

  /** What is known of a motion belongs to its connection (MM-39). */
  reset(): void {
    this.state = { phase: "rest", target: "none", pose: null };
  }

  /** A device has answered `OK` (MM-42 to MM-44). */
  done(command: Command, now: number): void {
    const { state } = this;
    const believedFrom = now + this.settle;
    if (command.command === "MOV") {
      const target = command.mode === "absolute" ? countsOf(command.axes) : this.sum(countsOf(command.axes));
      this.state = { phase: "starting", target, believedFrom };
    } else if (command.command === "RST") {
      this.state = { phase: "starting", target: "unknown", believedFrom };
    } else if (command.command === "STP" || (command.command === "SRV" && !command.on)) {
      this.state = state.phase === "rest" ? { ...state, target: "none" } : { phase: "stopping" };
    }
  }

  /** STA is sent: a status is not older than its question (MM-45). */
  asked(now: number): void {
    const { state } = this;
    if (state.phase === "starting" && now >= state.believedFrom) this.state = { phase: "moving", target: state.target };
  }

  /** A status has come (MM-70, MM-77). */
  status(status: StatusReply): MotionReport {
    const { state } = this;
    if (state.phase === "stopping") {
      if (status.moving) return "stopping";
      this.state = { phase: "rest", target: "none", pose: countsOf(status.axes) };
      return "still";
    }
    const { target } = state;
    if (status.moving) {
      this.state = { phase: "moving", target };
      return "moving";
    }
    const pose = countsOf(status.axes);
    const report = this.atRest(target, pose, status.servo);
    if (state.phase === "starting" && report !== "arrived") return "starting";
    this.state = { phase: "rest", target, pose };
    return report;
  }

  private atRest(target: Target, pose: number[], servo: boolean): MotionReport {
    if (target === "none") return "still";
    if (!servo) return { missed: "servo_off" };
    if (target === "unknown") return "still";
    const arrived = target.every((count, axis) => Math.abs(count - (pose[axis] ?? 0)) <= this.tolerance);
    return arrived ? "arrived" : { missed: "elsewhere" };
  }

  private sum(way: number[]): Target {
    if (this.state.phase !== "rest" || this.state.pose === null) return "unknown";
    return sumOf(this.state.pose, way) ?? "unknown";
  }
}

/** The pose behind a relative motion; null if it does not fit the fields. */
export function sumOf(pose: number[], way: number[]): number[] | null {
  const sum = pose.map((count, axis) => count + (way[axis] ?? 0));
  return sum.every((count) => Math.abs(count) <= MAX_COUNT) ? sum : null;
}
