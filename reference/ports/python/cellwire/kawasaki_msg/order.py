"""A robot's order: its stage, what is queued and executed, and what was acknowledged (KM-46 of reference/kawasaki-msg.md)."""

from enum import Enum, auto

from .numbering import Numbering


class Stage(Enum):
    """Idle, or where an order is."""

    IDLE = auto()
    INTAKE = auto()
    CLEARING = auto()
    ENDING = auto()
    INTERRUPTED = auto()
    ALARM = auto()


PHASES = {Stage.IDLE: 0, Stage.INTAKE: 2, Stage.CLEARING: 2, Stage.ENDING: 3, Stage.INTERRUPTED: 4, Stage.ALARM: 5}


class Flow(Enum):
    """Whether jobs are asked for."""

    ASKING = auto()
    FULL = auto()
    HELD = auto()


class Gap(Enum):
    """Whether jobs are missing."""

    CLOSED = auto()
    REST = auto()
    ASKED = auto()
    END_ONCE = auto()
    ASKED_AGAIN = auto()


class Acks:
    """Acknowledgements: cumulative, one for `every` jobs; or, None, each job individually."""

    def __init__(self, every: int | None) -> None:
        self.every = every

    def begin(self) -> None:
        self.until = 0  # acknowledged up to this count
        self.ahead: set[int] = set()  # numbers executed ahead of others
        self.unacked: set[int] = set()
        self.counts: dict[int, int]  # of the numbers that `due` has given

    def connected(self, executed: int) -> None:
        """What is executed in order the status covers (KM-49)."""
        self.until = executed
        self.unacked = set(self.ahead)

    def is_ahead(self, number: int) -> bool:
        return number in self.ahead

    def due(self, order: "Order", is_alone: bool) -> list[int]:
        """The numbers that are to be acknowledged (KM-54, KM-55)."""
        if self.every is None:
            return sorted(self.unacked)
        counts = [count for count in range(self.until + 1, order.executed + 1) if count % self.every == 0]
        last = counts[-1] if counts else self.until
        if order.executed > last and (order.is_done() or is_alone):
            counts.append(order.executed)
        self.counts = {order.numbering.number(count): count for count in counts}
        return [order.numbering.number(count) for count in counts]

    def sent(self, number: int) -> None:
        if self.every is None:
            self.unacked.discard(number)
        else:
            self.until = self.counts[number]

    def are_sent(self) -> bool:
        """Whether no job waits to be acknowledged individually."""
        return not self.unacked


class Order:
    """What a robot knows of its order; counts stay when it is over."""

    def __init__(self, numbering: Numbering, acks: Acks) -> None:
        self.numbering, self.acks = numbering, acks
        self.begin(0)
        self.stage = Stage.IDLE

    def begin(self, number: int) -> None:
        """KM-56"""
        self.number, self.stage = number, Stage.INTAKE
        self.flow, self.gap = Flow.ASKING, Gap.CLOSED
        self.held_until = self.failures = self.queued = self.executed = 0
        self.waits_until: int | None = None  # the recovery
        self.reported_at: int | None
        self.acks.begin()

    def phase(self) -> int:
        return PHASES[self.stage]

    def is_done(self) -> bool:
        return self.executed == self.queued

    def next_number(self) -> int:
        """The number of the job after the last that is queued."""
        return self.numbering.number(self.queued + 1)

    def next_executed(self) -> int:
        return self.numbering.number(self.executed + 1)

    def queue_job(self) -> None:
        """The next job is queued."""
        self.queued += 1
        self.gap, self.waits_until = Gap.CLOSED, None

    def job_done(self, number: int) -> bool:
        """Whether a report is one of a job of the queue (KM-69)."""
        numbering, acks = self.numbering, self.acks
        if not 1 <= number <= numbering.largest:
            return False
        count = numbering.count(self.executed, number)
        is_next = count == self.executed + 1
        if not self.executed < count <= self.queued or acks.every is not None and not is_next or acks.is_ahead(number):
            return False
        if acks.every is None:
            acks.unacked.add(number)
            acks.ahead.add(number)
            self.advance()
        else:
            self.executed = count
        self.failures, self.waits_until = 0, None
        return True

    def advance(self) -> None:
        """Past all that are executed in one row."""
        while self.next_executed() in self.acks.ahead:
            self.acks.ahead.discard(self.next_executed())
            self.executed += 1
        self.queued = max(self.queued, self.executed)  # where the list was cleared meanwhile

    def cleared(self) -> None:
        """The list has settled (KM-72)."""
        self.stage, self.flow, self.gap, self.waits_until = Stage.INTAKE, Flow.ASKING, Gap.REST, None
        self.queued = self.executed
