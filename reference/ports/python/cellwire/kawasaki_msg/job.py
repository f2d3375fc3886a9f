"""A job's own fields (sections 4.2 and 5.2 of reference/kawasaki-msg.md)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..stream import Json
from .codec import I32, LATIN1, MARKS, number

MAX_OWN = 1022  # KM-36
LIMIT = 1024
LONGEST_OWN = 960  # KM-25
DECIMAL = re.compile(r"[ \t\n\f\r]*(-?)([0-9]*)(?:\.([0-9]*))?[ \t\n\f\r]*")


class Unfit(Exception):
    """A field that does not fit: its name, and its fault."""

    def __init__(self, name: str, kind: str, **fields: object) -> None:
        super().__init__(f"{name}: {kind}")
        self.error: Json = {"field": name, "fault": {"kind": kind, **fields}}


@dataclass(frozen=True)
class Field:
    """A field of a layout: a number, which is a count of the last of its `places`, or a text of `low` to `high` characters."""

    name: str
    low: int
    high: int
    places: int = 0
    is_text: bool = False

    def __post_init__(self) -> None:
        if self.low > self.high or self.is_text and self.low < 0:
            raise ValueError(f"{self.name} can have no value")  # KM-24

    @staticmethod
    def of(spec: Json) -> "Field":
        """A field in the words of a configuration."""
        if spec["kind"] == "text":
            low, high = spec["length"]
            return Field(spec["name"], low, high, is_text=True)
        places = spec.get("places", 0)
        if places not in (range(1, 10) if spec["kind"] == "decimal" else [0]):
            raise ValueError("a decimal has 1 to 9 decimals, and a whole number none")  # KM-24
        low, high = (to_count(str(end), places) for end in spec["range"])
        return Field(spec["name"], low, high, places)

    def shown(self, value: int) -> int | str:
        """A number as errors and messages have it."""
        if not self.places:
            return value
        digits = f"{abs(value):0{self.places + 1}}"
        return f"{'-' if value < 0 else ''}{digits[: -self.places]}.{digits[-self.places :]}"

    def check(self, value: int) -> int:
        """The number, if it is within the range."""
        if not self.low <= value <= self.high:
            raise Unfit(self.name, "out_of_range", found=self.shown(value), **self.ends())
        return value

    def ends(self) -> Json:
        return {"min": self.shown(self.low), "max": self.shown(self.high)}

    def read(self, text: str) -> int | str:
        """The value of a field on the wire; raises Unfit (KM-36)."""
        if self.is_text:
            return self.read_text(text)
        if not self.places:
            found = number(text.encode(LATIN1))
            if found is None:
                raise Unfit(self.name, "not_a_number", **self.ends())
            return self.check(found)
        match = DECIMAL.fullmatch(text)
        if match is None or not (match[2] or match[3]):
            raise Unfit(self.name, "not_a_number", **self.ends())
        digits = match[3] or ""
        if digits[self.places :].strip("0"):
            raise Unfit(self.name, "too_precise", places=self.places)
        value = int(match[1] + (match[2] + digits[: self.places].ljust(self.places, "0")))
        if value not in I32:
            raise Unfit(self.name, "not_a_number", **self.ends())
        return self.check(value)

    def read_text(self, text: str) -> str:
        if not self.low <= len(text) <= self.high:
            raise Unfit(self.name, "length", found=len(text), min=self.low, max=self.high)
        return text

    def write(self, value: Any, is_ascii: bool) -> str:
        """The field on the wire; raises Unfit (KM-40)."""
        if value is None:
            raise Unfit(self.name, "missing")
        if not self.is_text:
            return str(self.shown(self.check(value)))
        for character in value:
            if character in MARKS:
                raise Unfit(self.name, "reserved", found=ord(character))
            if ord(character) > (0x7F if is_ascii else 0xFF):
                raise Unfit(self.name, "character", found=character)
        return self.read_text(value)

    def longest(self) -> int:
        """How many bytes it has at most."""
        return self.high if self.is_text else max(len(str(self.shown(end))) for end in (self.low, self.high))


def to_count(text: str, places: int) -> int:
    """A decimal as a count of its last digit."""
    whole, _, digits = text.partition(".")
    return int(whole + digits.ljust(places, "0")[:places])


COORDINATE = 9_999_999
# KM-23
LINES = [Field("kind", 1, 2), *(Field(name, -COORDINATE, COORDINATE) for name in ("x1", "y1", "x2", "y2"))]


class Layout:
    """The own fields of an application's jobs."""

    def __init__(self, fields: Sequence[Field] = LINES) -> None:
        self.fields = list(fields)
        if not fields or len({field.name for field in fields}) < len(fields):
            raise ValueError("a layout without a field, or with a name twice")  # KM-24
        if self.longest() > LONGEST_OWN:
            raise ValueError(f"the own fields of a job have up to {LONGEST_OWN} bytes")  # KM-25

    def longest(self) -> int:
        return sum(field.longest() + 1 for field in self.fields)

    def read(self, texts: Sequence[str], fixed: int) -> Json:
        """The job; `fixed` fields of its message are not its own. Raises Unfit, or Wrong by its error object."""
        size = sum(len(text) + 1 for text in texts)
        if size > MAX_OWN:
            raise Wrong({"kind": "job_too_long", "found": size + 2, "limit": LIMIT})
        job: Json = {}
        for at, field in enumerate(self.fields):
            if at >= len(texts):
                raise Unfit(field.name, "missing")
            job[field.name] = field.read(texts[at])
        if len(texts) > len(self.fields):
            raise Wrong({"kind": "field_count", "expected": fixed + len(self.fields), "found": fixed + len(texts)})
        return job

    def write(self, job: Json, is_ascii: bool) -> list[str]:
        return [field.write(job.get(field.name), is_ascii) for field in self.fields]


class Wrong(Exception):
    """A message means nothing (KM-35): its error object."""

    def __init__(self, error: Json) -> None:
        super().__init__(error["kind"])
        self.error = error
