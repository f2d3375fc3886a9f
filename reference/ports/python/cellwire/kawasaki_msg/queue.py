"""The queue of a robot's jobs, and the motion program that takes them (section 8.6 of reference/kawasaki-msg.md)."""

from dataclasses import dataclass

from ..session import NotTaken
from ..stream import Json


@dataclass
class Job:
    """A job in its slot."""

    order: int
    number: int
    job: Json
    is_free: bool = False  # before its turn (KM-68)


class Queue:
    """So many slots, each held from when a job is queued until it is completed."""

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self.jobs: list[Job] = []
        self.taken: Job | None = None
        self.is_abandoned = False  # there is no motion program any more

    def __len__(self) -> int:
        return len(self.jobs)

    def is_full(self) -> bool:
        return len(self) >= self.slots

    def add(self, order: int, number: int, job: Json) -> None:
        """Into the next slot."""
        self.jobs.append(Job(order, number, job))

    def take(self, number: int | None) -> Job:
        """The oldest job, or the one of this number; raises NotTaken."""
        if self.taken is not None:
            raise NotTaken("busy")
        found = next((job for job in self.jobs if not job.is_free and number in (None, job.number)), None)
        if found is None:
            raise NotTaken("no_job")
        self.taken = found
        return found

    def complete(self) -> None:
        """The slot of the job that was taken is free; raises NotTaken."""
        if self.taken is None:
            raise NotTaken("no_job")
        self.taken.is_free, self.taken = True, None
        while self.jobs and self.jobs[0].is_free:
            self.jobs.pop(0)

    def clear(self) -> None:
        """Every job but the one that is being executed is removed."""
        self.jobs = [job for job in self.jobs if job is self.taken]

    def has_settled(self) -> bool:
        """Nothing of what was cleared is left, and nothing is being executed (KM-72)."""
        return self.is_abandoned or not self.jobs
