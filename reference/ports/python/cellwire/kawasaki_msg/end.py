"""What both ends of kawasaki-msg share: the decoder of a connection, and the order of events."""

from abc import ABC, abstractmethod
from typing import ClassVar

from ..session import Session
from ..stream import Json
from . import codec
from .dialect import COMMAND, Dialect
from .job import Wrong
from .numbering import LARGEST, Numbering

# Events that come behind all others (KM-81, KM-120).
LAST = {"connect": 1, "disconnect": 1, "progress": 2}
PLACES = 32  # of all others that wait


class End(Session, ABC):
    """One end of a connection."""

    CLOSES = frozenset({"disconnect"})
    OUTCOMES: ClassVar[frozenset[str]]  # what is never lost

    def __init__(self, dialect: Dialect, max_number: int, datagrams: bool) -> None:
        super().__init__()
        if not 2 <= max_number <= LARGEST:
            raise ValueError("max_number is 2 to 9999")  # KM-43
        if datagrams and dialect.lacks_order():
            raise ValueError("with datagrams each message names its order")  # KM-83
        self.dialect, self.datagrams = dialect, datagrams
        self.numbering = Numbering(max_number)
        self.messages = codec.Decoder(options=dialect.options)

    def report(self, event: str, **fields: object) -> None:
        """An event; some come behind others, each once, and of other notices that find no place the oldest is lost."""
        if event in LAST:
            self.forget(event)
        place = len(self.events)
        while place > 0 and LAST.get(self.events[place - 1]["event"], 0) > LAST.get(event, 0):
            place -= 1
        self.events.insert(place, {"event": event, **fields})
        waiting = [event for event in self.events if event["event"] not in LAST]
        if len(waiting) > PLACES:
            self.events.remove(next(event for event in waiting if not self.is_outcome(event)))

    def forget(self, *names: str) -> None:
        """Events that are true no more."""
        self.events[:] = [event for event in self.events if event["event"] not in names]

    def is_outcome(self, event: Json) -> bool:
        return event["event"] in self.OUTCOMES or event.get("given_up", False)

    def has_room(self, outcomes: int) -> bool:
        """Room for so many outcomes."""
        return sum(self.is_outcome(event) for event in self.events) + outcomes <= PLACES

    def reject(self, kind: str, **fields: object) -> None:
        self.report("rejected", error={"kind": kind, **fields})

    def not_expected(self, role: str) -> None:
        """A message of the other side's (KM-22)."""
        _, is_command, number = role.partition(COMMAND)
        self.reject("not_expected", role={"command": int(number)} if is_command else role)

    @abstractmethod
    def is_connected(self) -> bool:
        """Whether bytes can come."""

    def clear(self) -> None:
        """Half a message of the connection before is forgotten (KM-8); offsets count on."""
        before = self.messages
        self.messages = codec.Decoder(options=self.dialect.options)
        self.messages.position = before.position + before.dropped + len(before.held)

    def input(self, now: int, data: bytes) -> None:
        if not self.is_connected():
            self.unexpected("not connected", "bytes")
            return
        self.messages.push(data)
        self.read(now)
        if self.datagrams:  # KM-9
            self.messages.end()
            self.read(now)
        self.all_read(now, self.is_half())

    def is_half(self) -> bool:
        """Whether a message is not whole; what is corrupt is none, and not held."""
        return bool(self.messages.held)

    @abstractmethod
    def all_read(self, now: int, is_half: bool) -> None:
        """Whatever has come was understood, but for half a message."""

    def read(self, now: int) -> None:
        while (item := self.messages.next()) is not None:
            if item.message is None:
                self.on_error(now, item)
                continue
            self.on_any(now)
            try:
                found = self.dialect.read(item.message)
            except Wrong as wrong:
                self.on_wrong(now, wrong.error)
            else:
                self.on_message(now, found)

    @abstractmethod
    def on_any(self, now: int) -> None:
        """A whole message has come, whether it means something or not."""

    @abstractmethod
    def on_wrong(self, now: int, error: Json) -> None:
        """A message that means nothing (KM-35)."""
