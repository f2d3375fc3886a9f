"""kawasaki-msg: messages of a robot and a PC. Clauses KM-… are those of reference/kawasaki-msg.md.

This is the envelope of sections 3, 5.1 and 6; what a message means (section 5.2) is the sessions'.
"""

import re
from typing import Any

from ..stream import Incomplete, Json, Refused, StreamDecoder, error

MAX_LEN = 4096  # KM-14
MARKS = "<>$#"
NUMBER = re.compile(rb"[ \t\n\f\r]*(-?[0-9]+)[ \t\n\f\r]*")  # KM-17
# What ends the text of a header or a data part: a mark, or no character (KM-16).
ENDS = {"ascii": re.compile(rb"[<>#\x80-\xFF]"), "latin1": re.compile(rb"[<>#]")}
I32 = range(-(2**31), 2**31)
LATIN1 = "iso-8859-1"


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
    """Section 5.1. What was looked at is not looked at again, however slowly the bytes of a message come."""

    def __init__(self, sender: str | None = None, options: Json | None = None) -> None:
        super().__init__()
        self.ends = ENDS[(options or {}).get("charset", "ascii")]
        self.pending: Json | None = None  # an error whose last byte is not known yet
        self.restart()

    def restart(self) -> None:
        """Nothing is known of the message that the held bytes begin with."""
        self.looked = 1  # how many bytes were looked at: after them the part ends
        self.data: tuple[int, int] | None = None  # where the data part begins, and its length

    def take(self) -> tuple[int, Json | None, Json | None]:
        if self.pending is None:
            try:
                if not self.held.startswith(b"<"):
                    raise Wrong("garbage", offset=0)
                length, message = self.read()
                self.restart()
                return length, message, None
            except Wrong as wrong:
                self.restart()
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

    def read(self) -> tuple[int, Json]:
        """The message at the beginning of what is held, and its length."""
        m = self.held
        if self.data is None:
            self.data = self.read_length(self.find_mark())
            self.looked = self.data[0]
        begin, length = self.data
        q = self.find_mark()
        if q - begin != length:
            raise Wrong("length", offset=begin, expected=length, found=q - begin)
        if len(m) == q + 1:
            raise self.more()
        if m[q + 1] != ord(">"):
            raise Wrong("mark" if m[q + 1] == ord("<") else "no_end_mark", offset=q + 1, found=m[q + 1])
        name, *values = m[1:begin].decode(LATIN1).split("$")[:-1]  # the last one is the length
        fields = m[begin:q].decode(LATIN1)
        return q + 2, {"name": name, "header": values, "fields": fields.split("$") if fields else []}

    def read_length(self, p: int) -> tuple[int, int]:
        """Where the data part begins, which is behind the `#` at `p`, and its length."""
        header = bytes(self.held[1:p])
        _, dollar, text = header.rpartition(b"$")
        if not dollar:
            raise Wrong("no_length", offset=p)
        length = number(text)
        if length is None or length < 0:
            raise Wrong("no_length", offset=p - len(text))
        if header.startswith(b"$"):
            raise Wrong("no_name", offset=1)
        if p + 1 + length + 2 > MAX_LEN:
            raise Wrong("too_long", offset=1, limit=MAX_LEN)
        return p + 1, length

    def find_mark(self) -> int:
        """Where the next `#` is; another mark, or what is no character, is an error."""
        match = self.ends.search(self.held, self.looked, MAX_LEN)
        self.looked = match.start() if match else len(self.held)
        if match is None:
            raise self.more()
        found = self.held[self.looked]
        if found != ord("#"):
            raise Wrong("mark" if found in b"<>" else "not_ascii", offset=self.looked, found=found)
        return self.looked

    def more(self) -> Exception:
        if len(self.held) >= MAX_LEN:
            return Wrong("too_long", offset=0, limit=MAX_LEN)
        return Wrong("incomplete", offset=0, found=len(self.held)) if self.ended else Incomplete()


def encode(message: Json, sender: str | None = None, options: Json | None = None) -> bytes:
    """Section 6."""
    charset = {"ascii": "ascii", "latin1": LATIN1}[(options or {}).get("charset", "ascii")]
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
