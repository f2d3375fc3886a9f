"""What the sessions of all links share."""

from .stream import Json

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


class Session:
    """An end of a link. Give it what happened, take `events`, then what it transmits, and come back at `deadline`."""

    def __init__(self) -> None:
        self.events: list[Json] = []

    def report(self, event: str, **fields: object) -> None:
        """An event for the owner."""
        self.events.append({"event": event, **fields})

    def connected(self, now: int) -> None:
        """A connection was made, or the port was opened."""
        raise NotImplementedError

    def disconnected(self, now: int) -> None:
        """The connection was lost."""
        raise NotImplementedError

    def input(self, now: int, data: bytes) -> None:
        """Bytes came."""
        raise NotImplementedError

    def timeout(self, now: int) -> None:
        """Time has passed."""
        raise NotImplementedError

    def transmitted(self, now: int) -> None:
        """The last byte of what was transmitted has left the port."""

    def call(self, now: int, name: str, argument: object) -> None:
        """A call of the owner; raises NotTaken."""
        raise NotImplementedError

    def transmit(self, now: int) -> bytes | None:
        """What is to be sent now."""
        raise NotImplementedError

    def deadline(self) -> int | None:
        """When `timeout`, or `transmit`, is to be called at the latest."""
        raise NotImplementedError
