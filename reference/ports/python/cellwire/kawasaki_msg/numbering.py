"""The numbers of jobs, and their counts (section 7 of reference/kawasaki-msg.md)."""

from dataclasses import dataclass

LARGEST = 9999


@dataclass(frozen=True)
class Numbering:
    """Jobs are numbered from 1 to `largest`, again and again."""

    largest: int

    def number(self, count: int) -> int:
        """The number of the job of this count, from 1 (KM-42)."""
        return (count - 1) % self.largest + 1

    def or_empty(self, count: int) -> int | None:
        """The same; None: there is no such job."""
        return self.number(count) if count > 0 else None

    def ahead(self, count: int, number: int) -> int:
        """How far the job of a number is after the one of this count (KM-44)."""
        return (number - count) % self.largest

    def count(self, after: int, number: int) -> int:
        """The count of a number in the window that begins with `after` (KM-44)."""
        return after + self.ahead(after, number)
