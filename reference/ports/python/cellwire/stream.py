"""What the modules of all links share: items of a stream, the shape of a decoder, refusals of an encoder.

A message is the JSON object that reference/<link>.md describes, and so is an error.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Protocol

Json = dict[str, Any]


@dataclass(frozen=True)
class Item:
    """A message or an error, and the bytes of the stream that belong to it."""

    offset: int
    length: int
    message: Json | None = None
    error: Json | None = None


class Refused(Exception):
    """An encoder cannot write this message; the text says why."""


class Incomplete(Exception):
    """More bytes are needed, or the end of the bytes."""


def error(kind: str, **fields: Any) -> Json:
    """An error object."""
    return {"kind": kind, **fields}


class Decoder(Protocol):
    """What the decoders of all links can do."""

    def push(self, data: bytes) -> None:
        """Takes bytes, however the stream was divided."""

    def end(self) -> None:
        """No byte follows for now."""

    def next(self) -> Item | None:
        """The next message or error; None: more bytes are needed."""


class StreamDecoder(ABC):
    """Bytes in, items out. A link overrides `take`.

    Call `push` with what was read, then `next` until it is None. `end` says that the stream has ended, or that the line is
    silent: what is held is complete; then `next` until None as well. Items cover the stream without gaps.
    """

    def __init__(self) -> None:
        self.held = bytearray()
        self.dropped = 0  # bytes of the item that are no longer held
        self.position = 0
        self.ended = False

    def push(self, data: bytes) -> None:
        """Takes bytes, however the stream was divided."""
        self.held += data

    def end(self) -> None:
        """No byte follows for now."""
        self.ended = True

    def next(self) -> Item | None:
        """The next message or error; None: more bytes are needed."""
        try:
            if not self.held and self.dropped == 0:
                raise Incomplete
            length, message, fault = self.take()
        except Incomplete:
            self.ended = False
            return None
        item = Item(self.position, length, message, fault)
        self.position += length
        del self.held[: length - self.dropped]
        self.dropped = 0
        return item

    @abstractmethod
    def take(self) -> tuple[int, Json | None, Json | None]:
        """Length, message, and error (one of them is None) at the beginning of `held`; raises Incomplete."""


def fields(value: Json, names: set[str]) -> None:
    """Raises Refused, unless these are the fields of the value."""
    if value.keys() != names:
        raise Refused(f"the fields are {', '.join(sorted(names))}, not {', '.join(sorted(value)) or 'none'}")


def integer(value: Any, low: int, high: int, name: str) -> int:
    """The value, if it is an integer in low..=high."""
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise Refused(f"{name} must be an integer in {low}..={high}, not {value!r}")
    return value


def integers(values: Any, low: int, high: int, count: range, name: str) -> list[int]:
    """The values, if they are a list of as many integers in low..=high."""
    if not isinstance(values, list) or len(values) not in count:
        raise Refused(f"{name} must be a list of {count.start}..={count.stop - 1} integers")
    return [integer(value, low, high, name) for value in values]


def one_of(value: Any, names: set[str], name: str) -> str:
    """The value, if it is one of the names."""
    if not isinstance(value, str) or value not in names:
        raise Refused(f"{name} must not be {value!r}")
    return value


def boolean(value: Any, name: str) -> bool:
    """The value, if it is true or false."""
    if not isinstance(value, bool):
        raise Refused(f"{name} must be true or false, not {value!r}")
    return value
