"""What both ends of val2-alter share: the decoder, the gap that ends a frame, and the queue of events (AL-38, AL-52, AL-91, AL-96)."""

from abc import abstractmethod
from typing import Any

from ..session import MS, Session, after, span
from ..stream import Item, Json
from . import codec

CYCLE = 28 * MS
PLACES = 16  # of events that wait for the owner


def window(mode: int) -> int:
    """W (section 7.5)."""
    return (15 if mode & 1 else 17) * MS


def shortest_window(mode: int, framing: codec.Framing, baud: int) -> int:
    """What the shortest standard message of a mode leaves, less a reply with one value (AL-42, AL-69)."""
    marks = framing.leading_dle + 4
    message, reply = marks + (30 if mode & 4 else 6), marks + 4
    return min(window(mode), CYCLE - span(message, baud)) - span(reply, baud)


class Outcome(dict[str, Any]):
    """An event that is never dropped; all others are notices."""


class Line(Session):
    """One end of a line."""

    def __init__(self, sender: str, framing: Json, gap: int) -> None:
        super().__init__()
        self.framing = codec.Framing(**framing)
        self.options, self.gap = framing, gap
        self.frames = codec.Decoder(sender, framing)
        self.failures = 0  # of the decoder, that were looked at
        self.gap_at: int | None = None

    def report(self, event: str, **fields: object) -> None:
        """A notice."""
        self.add({"event": event, **fields})

    def settle(self, event: str, **fields: object) -> None:
        """An outcome."""
        self.add(Outcome(event=event, **fields))

    def add(self, event: Json) -> None:
        """AL-96: of too many notices the oldest is dropped."""
        self.events.append(event)
        if len(self.events) > PLACES:
            del self.events[next(at for at, each in enumerate(self.events) if not isinstance(each, Outcome))]

    def has_room(self, outcomes: int) -> bool:
        """Whether so many more outcomes fit (AL-96)."""
        return sum(isinstance(event, Outcome) for event in self.events) + outcomes <= PLACES

    @abstractmethod
    def is_open(self) -> bool:
        """Whether bytes are read."""

    def input(self, now: int, data: bytes) -> None:
        if not self.is_open():
            self.unexpected("Disconnected", "Bytes")
            return
        self.timeout(now)
        self.frames.push(data)
        self.read(now)
        self.gap_at = after(now, self.gap) if self.frames.pending() > 0 else None

    def end_gap(self, now: int) -> None:
        """The line has been silent within a frame."""
        if self.gap_at is not None and now >= self.gap_at:
            self.gap_at = None
            self.end_frame(now)

    def end_frame(self, now: int) -> None:
        self.frames.end()
        self.read(now)

    def read(self, now: int) -> None:
        while True:
            item = self.frames.next()
            if self.frames.failures > self.failures:
                self.failures = self.frames.failures
                self.on_failure(now, self.frames.failure)
            if item is None:
                return
            if item.message is None:
                self.on_error(now, item)
            else:
                self.on_frame(now, item, item.message)

    @abstractmethod
    def on_failure(self, now: int, kind: str) -> None:
        """A frame is corrupt, but it is not known yet which bytes its error covers (AL-38)."""

    @abstractmethod
    def on_frame(self, now: int, item: Item, message: Json) -> None:
        """A message of the peer."""
