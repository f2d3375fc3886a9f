"""The host of isra-ball (section 7 of reference/isra-ball.md)."""

from dataclasses import dataclass
from enum import Enum, auto

from ..echo import Echo
from ..session import MS, NEVER, Session, after, earliest, span
from ..stream import Json
from .codec import DATA_LEN, POLL, Decoder

EXCHANGE_LEN = 13  # poll and packet
# Places for events that wait for the owner, and those that a poll needs (IB-30); only outcomes fill one.
PLACES, NEEDED = 8, 3
OUTCOMES = frozenset({"new", "old", "missed", "stale"})


class Poll(Enum):
    """The link, and what it waits for (section 7.2)."""

    DISCONNECTED = auto()
    IDLE = auto()
    WAITING = auto()


@dataclass
class HostConfig:
    """Section 7.1. Times are in nanoseconds; `NEVER` is never."""

    baud: int = 9600
    period: int = 28 * MS
    max_delay: int = 14 * MS
    max_age: int = 150 * MS
    echo: bool = False  # the line returns what is sent

    def __post_init__(self) -> None:
        if self.period < -(-self.exchange // MS) * MS:
            raise ValueError("a period shorter than poll and packet")  # IB-21
        if self.max_age < NEVER and self.max_age <= 2 * max(self.period, self.window) + self.window:
            raise ValueError("a max_age with which values become stale although nothing goes wrong")  # IB-22

    @property
    def exchange(self) -> int:
        """The time of poll and packet."""
        return span(EXCHANGE_LEN, self.baud)

    @property
    def window(self) -> int:
        return self.exchange + self.max_delay

    @property
    def spread(self) -> int:
        return self.max_delay + self.exchange // 5


class Host(Session):
    """Polls a ball, and says how long its values may be used."""

    def __init__(self, config: HostConfig | None = None) -> None:
        super().__init__()
        self.config = config or HostConfig()
        self.poll = Poll.DISCONNECTED
        self.decoder = Decoder()
        self.echo = Echo(self.config.echo)
        self.due = self.begin = self.until = self.proof = self.proven = 0
        self.live_until: int | None = None  # None: stale

    def close(self) -> None:
        """The connection ends."""
        if self.poll is Poll.WAITING:
            self.report("missed")
        if self.live_until is not None:
            self.report("stale")
        self.live_until = None
        self.poll = Poll.DISCONNECTED

    def connected(self, now: int) -> None:
        """IB-23"""
        self.timeout(now)
        self.close()
        self.decoder = Decoder()
        self.poll = Poll.IDLE
        config = self.config
        self.echo = Echo(config.echo)
        self.due = after(now, max(config.period, config.window) + config.spread)
        self.proven = 0

    def disconnected(self, now: int) -> None:
        self.timeout(now)
        self.close()

    def input(self, now: int, data: bytes) -> None:
        self.timeout(now)
        self.decoder.push(self.without_echo(data))
        self.read(now)

    def timeout(self, now: int) -> None:
        if self.poll is Poll.WAITING and now >= self.until:
            self.give_up(now)
            self.poll = Poll.IDLE
            self.due = after(max(self.due, now), self.config.spread)  # IB-40
            self.report("missed")
        if self.live_until is not None and now >= self.live_until:
            self.live_until = None
            self.report("stale")

    def give_up(self, now: int) -> None:
        """IB-28"""
        self.decoder.end()
        self.read(now)

    def on_message(self, now: int, message: Json) -> None:
        if "data" in message:
            self.report("corrupt", error={"kind": "layout", "expected": DATA_LEN, "found": len(message["data"])})
        elif self.poll is Poll.DISCONNECTED:
            self.unexpected(self.poll.name, "Packet")
        elif self.poll is Poll.IDLE or not self.begin <= now < self.until:
            self.report("unasked", message=message)
        else:
            self.take_reply(now, message)

    def take_reply(self, now: int, message: Json) -> None:
        """IB-26"""
        self.poll = Poll.IDLE
        if message["status"] == "fresh" and now < self.proven:
            self.live_until = self.proven
            live = {} if self.proven >= NEVER else {"live_until": self.proven}
            self.report("new", message=message, **live)
        else:
            self.report("old", message=message)
        self.proven = self.proof

    def transmit(self, now: int) -> bytes | None:
        """IB-24, IB-39"""
        self.timeout(now)
        if self.poll is not Poll.IDLE or now < self.due or self.waiting(OUTCOMES) + NEEDED > PLACES:
            return None
        self.give_up(now)
        config = self.config
        self.poll = Poll.WAITING
        self.begin = after(now, config.exchange - config.exchange // 10)
        self.until = after(now, config.window)
        self.due = after(now, config.period)
        self.proof = after(now, config.max_age)
        poll = bytes([POLL])
        self.echo.sent(poll, False)  # a packet may begin with it
        return poll

    def deadline(self) -> int | None:
        if self.poll is Poll.DISCONNECTED:
            return None
        return earliest(self.due if self.poll is Poll.IDLE else self.until, self.live_until)
