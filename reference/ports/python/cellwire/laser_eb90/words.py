"""Command words and error codes of laser-eb90 (section 4.2 of reference/laser-eb90.md)."""

from itertools import combinations
from typing import Any

from ..stream import Json

MAX_RANGES = 32  # LE-20
COMMANDS: list[Json] = [  # LE-102
    {"first": 0x0100, "last": 0x01FF, "class": "interpreted"},
    {"first": 0x0200, "last": 0x02FF, "class": "immediate"},
    {"first": 0x0300, "last": 0x03FF, "class": "query"},
]
ERRORS = {  # LE-103
    "bad_checksum": 0xE001,
    "bad_frame": 0xE002,
    "unknown_command": 0xE003,
    "bad_batch": 0xE004,
    "bad_parameters": 0xE005,
    "queue_full": 0xE006,
}


class Words:
    """The words of a plant; what `options` leaves out is the default."""

    def __init__(self, options: Json) -> None:
        self.commands: list[Json] = options.get("commands", COMMANDS)
        self.errors: dict[str, int] = ERRORS | options.get("errors", {})
        codes = set(self.errors.values())
        is_double = any(one["first"] <= other["last"] and other["first"] <= one["last"] for one, other in combinations(self.commands, 2))
        if is_double or len(self.commands) > MAX_RANGES:
            raise ValueError("a command word has one class, and there are up to 32 ranges of them")
        numbers = codes.union(*((words["first"], words["last"]) for words in self.commands))
        if not all(0 <= number <= 0xFFFF for number in numbers):
            raise ValueError("a word has two bytes")
        if len(codes) < len(self.errors) or any(self.class_of(code) for code in codes):
            raise ValueError("an error code must not be a command word or another error code")

    def class_of(self, word: int | None) -> str | None:
        """`interpreted`, `immediate` or `query`; None: it is not a command word."""
        if word is None:
            return None
        return next((words["class"] for words in self.commands if words["first"] <= word <= words["last"]), None)

    def error_of(self, word: int | None) -> str | None:
        """The name of an error code; None: it is none."""
        return next((name for name, code in self.errors.items() if code == word), None)


def word_of(item: Json) -> int | None:
    """The word that an item is (LE-18); None: it is none."""
    shorts: list[Any] = item.get("i16", [])
    return int(shorts[0]) & 0xFFFF if len(shorts) == 1 else None


def item_of(word: int) -> Json:
    """The item that is this word."""
    return {"i16": [word if word < 0x8000 else word - 0x10000]}
