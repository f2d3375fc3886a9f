"""What the drivers share: a session, its clock, and its events on their way to the owner."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, ParamSpec, TypeVar

from .session import SECOND, Session
from .stream import Json

S = TypeVar("S", bound=Session)
P = ParamSpec("P")
R = TypeVar("R")
# Seconds between attempts to connect, each twice as long as the one before.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0


class Core(Generic[S]):
    """A session between its owner and a transport."""

    def __init__(self, session: S) -> None:
        self.session = session
        self.taken: deque[Json] = deque()
        self.begun = time.monotonic_ns()
        self.pause = FIRST_PAUSE
        self.retry_at = 0  # when to connect again
        self.is_open = False
        self.may_connect = not session.CONNECTS
        self.has_closed = False  # the session has asked for the end of the connection

    def now(self) -> int:
        """Nanoseconds since the driver began."""
        return time.monotonic_ns() - self.begun

    def do(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """A call of the session, at the time that it is now."""
        self.session.now = self.now()
        result = call(*args, **kwargs)
        self.take()
        return result

    def take(self) -> None:
        """Takes the session's events."""
        for event in self.session.events:
            self.has_closed |= self.is_open and event["event"] in self.session.CLOSES
            self.may_connect |= event["event"] == "connect"
        self.taken.extend(self.session.events)
        self.session.events.clear()

    def opened(self) -> None:
        """A connection was made."""
        self.is_open, self.has_closed, self.pause = True, False, FIRST_PAUSE
        self.session.connected(self.now())
        self.take()

    def closed(self) -> None:
        """A connection was lost, closed, or not to be had."""
        self.is_open, self.may_connect = False, not self.session.CONNECTS
        self.session.disconnected(self.now())
        self.take()
        self.retry_at = self.now() + round(self.pause * SECOND)
        self.pause = min(2 * self.pause, LONGEST_PAUSE)

    def received(self, data: bytes) -> None:
        self.session.input(self.now(), data)
        self.take()

    def expire(self) -> None:
        """Time has passed; what has come was read."""
        deadline = self.session.deadline()
        if self.session.wants_timeout() or deadline is not None and self.now() >= deadline:
            self.session.timeout(self.now())
            self.take()

    def due(self) -> Iterator[bytes]:
        """What is to be sent now; without a connection, nothing."""
        self.take()
        while self.is_open and (data := self.session.transmit(self.now())) is not None:
            self.take()
            yield data
        self.take()

    def wait(self) -> float | None:
        """Seconds until the session's deadline; None: it has none."""
        deadline = self.session.deadline()
        return None if deadline is None else max(deadline - self.now(), 0) / SECOND

    def rest(self) -> float | None:
        """Seconds until a connection is to be made; None: not before the session asks for it."""
        if not self.may_connect:
            return None
        return 0 if self.session.CONNECTS else max(self.retry_at - self.now(), 0) / SECOND


def shortest(*times: float | None) -> float | None:
    """The shortest of these times; None: none of them ends."""
    return min((time for time in times if time is not None), default=None)
