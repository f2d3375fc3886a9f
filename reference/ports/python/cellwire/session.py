"""What the sessions of all links share."""

from abc import ABC, abstractmethod
from typing import ClassVar

from .echo import Echo
from .stream import Decoder, Item, Json

NEVER = 2**63  # or later
MS = 1_000_000
SECOND = 1_000_000_000


def after(now: int, span: int) -> int:
    """A deadline: sums saturate."""
    return min(now + span, NEVER)


def span(length: int, baud: int) -> int:
    """The time of `length` bytes on a line, ten bits each, rounded down."""
    return NEVER if baud == 0 else length * 10 * SECOND // baud


class NotTaken(Exception):
    """A call of the owner that is refused; nothing has changed."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.refused: Json = {"kind": kind}


class Session(ABC):
    """An end of a link: a function of time and input, without a clock and without a socket.

    Give it what happened, take `events`, then what it transmits, and come back at `deadline`. Times are whole nanoseconds, counted
    from any instant. `now` is the time of the calls of the owner that need one: set it before them.
    """

    decoder: Decoder
    echo: Echo  # of an end that has the setting; a new one for each connection
    # Events after which the connection is to be closed, and whether it is opened only after an event `connect`.
    CLOSES: ClassVar[frozenset[str]] = frozenset()
    CONNECTS: ClassVar[bool] = False

    def __init__(self) -> None:
        self.events: list[Json] = []
        self.now = 0

    def waiting(self, names: frozenset[str]) -> int:
        """How many of these events the owner has not taken yet."""
        return sum(event["event"] in names for event in self.events)

    def report(self, event: str, **fields: object) -> None:
        """An event for the owner."""
        self.events.append({"event": event, **fields})

    def unexpected(self, state: object, given: str) -> None:
        """The state does not allow this input, which has changed nothing."""
        self.report("unexpected", state=str(state), input=given)

    @abstractmethod
    def connected(self, now: int) -> None:
        """A connection was made, or the port was opened."""

    @abstractmethod
    def disconnected(self, now: int) -> None:
        """The connection was lost."""

    def input(self, now: int, data: bytes) -> None:
        """Bytes came. What has come due comes first."""
        self.timeout(now)
        self.decoder.push(data)
        self.read(now)

    def wants_input(self) -> bool:
        """Whether bytes are read now; else they are best left in the transport, whose flow control holds the peer."""
        return True

    def without_echo(self, data: bytes) -> bytes:
        """What has come, without what the line has returned of the output."""
        rest, error = self.echo.receive(data)
        if error is not None:
            if error["kind"] == "not_set":
                self.empty()
            self.report("echo", error=error)
        return rest

    def empty(self) -> None:
        """Forgets the bytes that were not read yet: the beginning of a frame that came back is among them."""

    def read(self, now: int) -> None:
        """Takes what the decoder has found."""
        while (item := self.decoder.next()) is not None:
            if item.message is None:
                self.on_error(now, item)
            else:
                self.on_message(now, item.message)

    def on_message(self, now: int, message: Json) -> None:
        """A message of the peer."""

    def on_error(self, now: int, item: Item) -> None:
        """Bytes that are no message."""
        self.report("corrupt", error=item.error)

    @abstractmethod
    def timeout(self, now: int) -> None:
        """Time has passed."""

    def wants_timeout(self) -> bool:
        """Whether `timeout` is to be called at once, whatever the deadline."""
        return False

    def transmitted(self, now: int) -> None:
        """The last byte of what was transmitted has left the port."""

    @abstractmethod
    def transmit(self, now: int) -> bytes | None:
        """What is to be sent now."""

    @abstractmethod
    def deadline(self) -> int | None:
        """When `timeout`, or `transmit`, is to be called at the latest."""


def earliest(*times: int | None) -> int | None:
    """The first of these deadlines; None: there is none, or it never comes."""
    return min((time for time in times if time is not None and time < NEVER), default=None)
