"""fanuc-ls: the words of an LS file. Clauses LS-… are those of reference/fanuc-ls.md.

Places are indices of characters; `Place` makes lines, columns and bytes of them.
"""

import math
import re

from ..stream import Json, error

WHITE = "\t\n\v\f\r \x85\xa0\u1680\u2000\u2001\u2002\u2003\u2004\u2005\u2006\u2007\u2008\u2009\u200a\u2028\u2029\u202f\u205f\u3000"  # LS-55
BLANKS = " \t"
DECIMAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)")  # LS-31
LARGEST = 2**32 - 1  # of the numbers of statements (LS-53)


class Fault(Exception):
    """What is wrong, and at which character."""

    def __init__(self, at: int, kind: str) -> None:
        super().__init__(kind)
        self.at = at
        self.kind = kind


def is_letter(c: str) -> bool:
    """LS-55."""
    return c.isalpha() if c.isascii() else c not in WHITE


def is_word(c: str) -> bool:
    """Letters, digits and `_`."""
    return c == "_" or is_letter(c) or c.isdigit()


def is_control(c: str) -> bool:
    """LS-55."""
    return c <= "\x1f" or "\x7f" <= c <= "\x9f"


def leading_digits(text: str) -> str:
    """The digits that a text begins with."""
    return text[: len(text) - len(text.lstrip("0123456789"))]


def number(digits: str, largest: int = LARGEST) -> int | None:
    """The number, if it is one within 0..=largest."""
    return int(digits) if digits.isascii() and digits.isdigit() and int(digits) <= largest else None


def join_lines(text: str) -> str:
    """An instruction's text without the marks that continue it (LS-24)."""
    first, *rest = [line.strip(" \t\r") for line in text.strip(" \t\r\n").split("\n")]
    return "\n".join([first, *(line.removeprefix(":").lstrip(BLANKS) for line in rest)])


def lines_of(text: str, begin: int, end: int) -> list[tuple[int, str]]:
    """The lines of a part of a text without their LF, and where they begin."""
    lines = []
    while begin < end:
        stop = text.find("\n", begin, end)
        stop = end if stop < 0 else stop
        lines.append((begin, text[begin:stop]))
        begin = stop + 1
    return lines


class Cursor:
    """A part of a text that is being read; `base` is where it begins."""

    def __init__(self, text: str, base: int) -> None:
        self.text = text
        self.base = base
        self.at = 0

    def fault(self, kind: str, at: int | None = None) -> Fault:
        return Fault(self.base + (self.at if at is None else at), kind)

    def rest(self) -> str:
        return self.text[self.at :]

    def here(self) -> str:
        """The next character; nothing at the end."""
        return self.text[self.at : self.at + 1]

    def skip(self, characters: str) -> None:
        while self.at < len(self.text) and self.text[self.at] in characters:
            self.at += 1

    def space(self) -> None:
        self.skip(" \t\r\n")

    def joint(self) -> None:
        """Moves over blanks, and over line ends with the `:` that continues an instruction."""
        self.skip(BLANKS)
        while match := JOINT.match(self.text, self.at):
            self.at = match.end()

    def take(self, word: str) -> bool:
        found = self.text.startswith(word, self.at)
        self.at += len(word) if found else 0
        return found

    def expect(self, word: str, kind: str) -> None:
        if not self.take(word):
            raise self.fault(kind)

    def spaced(self, word: str, kind: str) -> None:
        self.space()
        self.expect(word, kind)

    def whole(self, largest: int, kind: str) -> int:
        """A number without a sign."""
        digits = leading_digits(self.rest())
        value = number(digits, largest)
        if value is None:
            raise self.fault(kind)
        self.at += len(digits)
        return value

    def decimal(self, kind: str) -> float:
        match = DECIMAL.match(self.text, self.at)
        text = match[0] if match else "inf"
        value = float(text)
        if math.isinf(value):
            raise self.fault(kind)
        self.at += len(text)
        return value

    def word(self) -> str:
        """Letters, digits and `_`."""
        begin = self.at
        while is_word(self.here()):
            self.at += 1
        return self.text[begin : self.at]

    def reference(self, kind: str) -> tuple[str, str]:
        """Letters and what is in their brackets (LS-18)."""
        begin = self.at
        while self.here().isascii() and self.here().isalpha():
            self.at += 1
        letters = self.text[begin : self.at]
        if not letters:
            raise self.fault(kind)
        self.expect("[", kind)
        inner, depth = self.at, 0
        for at in range(inner, len(self.text)):
            c = self.text[at]
            if c == "]" and depth == 0:
                self.at = at + 1
                return letters, self.text[inner:at]
            if c in "\r\n":
                break
            depth += (c == "[") - (c == "]")
        raise self.fault("bracket")


JOINT = re.compile(r"\r*\n[ \t]*:[ \t]*")


class Place:
    """Lines, columns and bytes of a text (LS-34)."""

    def __init__(self, text: str) -> None:
        self.text = text

    def bytes(self, at: int) -> int:
        return len(self.text[:at].encode())

    def of(self, at: int) -> Json:
        begin = self.text.rfind("\n", 0, at) + 1
        return {"line": self.text.count("\n", 0, at) + 1, "column": at - begin + 1, "offset": self.bytes(at)}

    def error(self, fault: Fault, **fields: int) -> Json:
        return error(fault.kind, **fields, **self.of(fault.at))
