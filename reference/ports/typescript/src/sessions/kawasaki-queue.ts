/** The robot's queue of jobs, as the communication and the motion program see it (KM-68, KM-69). */

import type { Job } from "../kawasaki-dialect.js";

export interface QueuedJob {
  order: number;
  /** Its count in the order, and its number on the wire. */
  count: number;
  number: number;
  job: Job;
  /** It is being executed: it keeps its slot until the motion program frees it. */
  taken: boolean;
  reported: boolean;
  /** Its slot is free, before its turn: it counts until all before it are (KM-68). */
  freed: boolean;
}

export class JobQueue {
  private jobs: QueuedJob[] = [];
  /** The job whose slot was freed last, which may be reported still. */
  private freed: QueuedJob | null = null;

  constructor(readonly slots: number) {}

  get size(): number {
    return this.jobs.length;
  }

  get isFull(): boolean {
    return this.jobs.length >= this.slots;
  }

  get taken(): QueuedJob | undefined {
    return this.jobs.find(({ taken, freed }) => taken && !freed);
  }

  add(job: QueuedJob): void {
    this.jobs.push(job);
  }

  /** The oldest job that is not taken, or that of a number. */
  find(number: number | null): QueuedJob | undefined {
    return this.jobs.find((job) => !job.taken && (number === null || job.number === number));
  }

  /** A job of a number that was not reported. */
  unreported(number: number): QueuedJob | undefined {
    const jobs = this.freed === null ? this.jobs : [this.freed, ...this.jobs];
    return jobs.find((job) => job.number === number && !job.reported);
  }

  free(job: QueuedJob): void {
    this.freed = job;
    job.freed = true;
    while (this.jobs[0]?.freed) {
      this.jobs.shift();
    }
  }

  /** Removes every job but the one that is being executed. */
  clear(): void {
    this.jobs = this.jobs.filter(({ taken, freed }) => taken && !freed);
  }
}
