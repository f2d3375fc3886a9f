"""kawasaki-msg: messages of a robot and a PC. Clauses KM-… are those of reference/kawasaki-msg.md.

This is the envelope of sections 3, 5.1 and 6; what a message means (section 5.2) is the sessions'.
"""

import re
from typing import Any

from ..stream import Incomplete, Json, Refused, StreamDecoder, error

MAX_LEN = 4096  # KM-14
MARKS = "<>$#"
NUMBER = re.compile(rb"[ \t\n\f\r]*(-?[0-9]+)[ \t\n\f\r]*")  # KM-17
I32 = range(-(2**31), 2**31)


class Wrong(Exception):
    """What is wrong with a message; offsets count from its first byte."""

    def __init__(self, kind: str, **fields: int) -> None:
        super().__init__(kind)
        self.error = error(kind, **fields)


def number(text: bytes) -> int | None:
    """A number as AS prints it (KM-17)."""
    match = NUMBER.fullmatch(text)
    return int(match[1]) if match and int(match[1]) in I32 else None


class Decoder(StreamDecoder):
    """Section 5.1."""

    def __init__(self, sender: str | None = None, options: Json | None = None) -> None:
        super().__init__()
        self.is_ascii = (options or {}).get("charset", "ascii") == "ascii"
        self.pending: Json | None = None  # an error whose last byte is not known yet

    def take(self) -> tuple[int, Json | None, Json | None]:
        if self.pending is None:
            try:
                if not self.held.startswith(b"<"):
                    raise Wrong("garbage", offset=0)
                length, message = self.read(bytes(self.held[:MAX_LEN]))
                return length, message, None
            except Wrong as wrong:
                self.pending = wrong.error | {"offset": wrong.error["offset"] + self.position}
        fault = self.pending
        length = self.extent()
        self.pending = None
        if fault["kind"] == "garbage":
            fault["length"] = length
        return length, None, fault

    def extent(self) -> int:
        """How many bytes the pending error covers (KM-31). Only their number is kept."""
        begin = self.held.find(b"<", 0 if self.dropped else 1)
        if begin >= 0:
            return self.dropped + begin
        if not self.ended:
            self.dropped += len(self.held)
            self.held.clear()
            raise Incomplete
        return self.dropped + len(self.held)

    def read(self, m: bytes) -> tuple[int, Json]:
        """The message at the beginning of `m`, and its length."""
        p = self.find_mark(m, 1)
        header = m[1:p]
        before, dollar, length_text = header.rpartition(b"$")
        if not dollar:
            raise Wrong("no_length", offset=p)
        length = number(length_text)
        if length is None or length < 0:
            raise Wrong("no_length", offset=p - len(length_text))
        if header.startswith(b"$"):
            raise Wrong("no_name", offset=1)
        if p + 1 + length + 2 > MAX_LEN:
            raise Wrong("too_long", offset=1, limit=MAX_LEN)
        q = self.find_mark(m, p + 1)
        found = q - (p + 1)
        if found != length:
            raise Wrong("length", offset=p + 1, expected=length, found=found)
        if len(m) == q + 1:
            raise self.more(m)
        if m[q + 1 : q + 2] == b"<":
            raise Wrong("mark", offset=q + 1, found=m[q + 1])
        if m[q + 1 : q + 2] != b">":
            raise Wrong("no_end_mark", offset=q + 1, found=m[q + 1])
        name, *values = before.decode("latin-1").split("$")
        fields = m[p + 1 : q].decode("latin-1")
        return q + 2, {"name": name, "header": values, "fields": fields.split("$") if fields else []}

    def find_mark(self, m: bytes, start: int) -> int:
        """Where the next `#` is; another mark, or what is no character, is an error."""
        for at in range(start, len(m)):
            if m[at] == ord("#"):
                return at
            if m[at] in b"<>":
                raise Wrong("mark", offset=at, found=m[at])
            if self.is_ascii and m[at] > 0x7F:
                raise Wrong("not_ascii", offset=at, found=m[at])
        raise self.more(m)

    def more(self, m: bytes) -> Exception:
        if len(m) == MAX_LEN:
            return Wrong("too_long", offset=0, limit=MAX_LEN)
        return Wrong("incomplete", offset=0, found=len(m)) if self.ended else Incomplete()


def encode(message: Json, sender: str | None = None, options: Json | None = None) -> bytes:
    """Section 6."""
    charset = {"ascii": "ascii", "latin1": "latin-1"}[(options or {}).get("charset", "ascii")]
    name, header, fields = message["name"], message["header"], message["fields"]
    if not isinstance(name, str) or not name or not is_strings(header) or not is_strings(fields):
        raise Refused("a message has a name, and lists of strings")
    if any(mark in text for text in [name, *header, *fields] for mark in MARKS):
        raise Refused(f"nothing escapes a mark ({MARKS})")
    data = "$".join(fields)
    text = f"<{'$'.join([name, *header])}${len(data)}#{data}#>"
    if len(text) > MAX_LEN:
        raise Refused(f"a message has up to {MAX_LEN} bytes, not {len(text)}")
    try:
        return text.encode(charset)
    except UnicodeEncodeError as wrong:
        raise Refused(str(wrong)) from wrong


def is_strings(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(value, str) for value in values)
