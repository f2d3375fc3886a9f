"""The settings of both ends of kawasaki-msg (KM-82, KM-121 of reference/kawasaki-msg.md)."""

from dataclasses import dataclass, field

from ..session import MS, SECOND
from .dialect import Dialect, Limits

SLOTS = 256
INDIVIDUAL = "individual"
TAKEOVERS = {"end": "order_end", "interrupt": "order_interrupt"}
NEVER = "never"  # no other order is ended


@dataclass
class PcConfig:
    """KM-121. Times are in nanoseconds; `NEVER` is never."""

    dialect: Dialect = field(default_factory=Dialect)
    limits: Limits = field(default_factory=Limits)
    datagrams: bool = False
    max_number: int = 9999
    cumulative_acks: bool = True
    reply_delay: int = 2 * MS
    silence: int = 10 * SECOND
    takeover: str = "interrupt"
    start_retries: int = 10
    end_when_done: bool = True

    def __post_init__(self) -> None:
        self.limits.check(self.dialect)
        entries = self.dialect.entries
        if self.silence == 0 or self.takeover not in (*TAKEOVERS, NEVER):
            raise ValueError("a silence of 0, or a takeover that is none")
        if self.takeover == "interrupt" and "order_interrupt" not in entries:
            raise ValueError("a takeover by an interruption that the table lacks")  # KM-122
        if not self.cumulative_acks and "job_ack" not in entries:
            raise ValueError("individual acknowledgement without a job_ack")  # KM-83


@dataclass
class RecoveryLimits:
    """KM-73."""

    resends: int = 3
    pauses: int = 3
    clears: int = 1

    def step(self, failures: int) -> str:
        """The name of the n-th step."""
        if failures <= self.resends:
            return "resend"
        if failures <= self.resends + self.pauses:
            return "pause"
        return "clear" if failures <= self.resends + self.pauses + self.clears else "alarm"


@dataclass
class RobotConfig:
    """KM-82, and how many jobs the queue holds. Times are in nanoseconds; `NEVER` is never. No `low_water`: half the queue."""

    dialect: Dialect = field(default_factory=Dialect)
    limits: Limits = field(default_factory=Limits)
    datagrams: bool = False
    max_number: int = 9999
    queue: int | None = None
    acks: int | str = 1
    low_water: int | None = None
    recovery: RecoveryLimits = field(default_factory=RecoveryLimits)
    patience: int = SECOND
    pause: int = 500 * MS
    reply_timeout: int = SECOND
    exchange: int = 32 * MS
    silent_cycles: int = 5
    reconnect_delay: int = SECOND
    status_period: int = SECOND
    refuse_repeated_start: bool = True
    end_foreign_order: bool = False

    def __post_init__(self) -> None:
        self.limits.check(self.dialect)
        if not 1 <= self.slots < self.max_number or self.acks == 0:
            raise ValueError("a queue without a slot, or with as many as there are numbers; or acks of 0")
        if self.acks == INDIVIDUAL and "job_ack" not in self.dialect.entries:
            raise ValueError("individual acknowledgement without a job_ack")  # KM-83

    @property
    def slots(self) -> int:
        """How many jobs the queue holds."""
        return min(SLOTS, self.max_number - 1) if self.queue is None else self.queue
