"""val2-viewer: lines with a pose. Clauses VV-… are those of reference/val2-viewer.md."""

from functools import reduce
from operator import xor

from ..stream import Incomplete, Json, StreamDecoder, error, fields, integer, integers

HEAD = b"$POSE,"
MAX_LEN = 100  # VV-7
WORDS = 12
LF = 0x0A


class Wrong(Exception):
    """What is wrong with a line, as an error object."""

    def __init__(self, kind: str, **fields: int) -> None:
        super().__init__(kind)
        self.error = error(kind, **fields)


class Decoder(StreamDecoder):
    """Section 5."""

    def __init__(self, sender: str | None = None, options: Json | None = None) -> None:
        super().__init__()

    def take(self) -> tuple[int, Json | None, Json | None]:
        window = bytes(self.held[:MAX_LEN])
        stop = next((at for at, byte in enumerate(window) if byte == LF or (byte == HEAD[0] and at > 0)), None)
        begins = window[0] == HEAD[0]
        if stop is not None and window[stop] == LF:
            try:
                return stop + 1, decode_line(window[: stop + 1]), None
            except Wrong as wrong:
                return stop + 1, None, wrong.error
        if stop is None and len(window) == MAX_LEN and begins:
            return MAX_LEN, None, error("too_long", limit=MAX_LEN)
        if stop is None and len(window) < MAX_LEN and not self.ended:
            raise Incomplete
        length = len(window) if stop is None else stop
        return length, None, error("incomplete" if begins else "noise", length=length)


class Line:
    """A line that is read from left to right (VV-12): nothing is read past its LF."""

    def __init__(self, line: bytes) -> None:
        self.line = line
        self.at = 0

    def expect(self, expected: bytes) -> None:
        """Exactly these bytes."""
        for byte in expected:
            if self.line[self.at] != byte:
                raise Wrong("format", offset=self.at)
            self.at += 1

    def number(self, low: int, high: int) -> int:
        """A number in its one form (VV-5)."""
        begin = self.at
        if self.line[self.at] == ord("-"):
            self.at += 1
        digits = self.at
        while chr(self.line[self.at]) in "0123456789":
            self.at += 1
        text = self.line[begin : self.at].decode()
        if not 1 <= self.at - digits <= 5 or str(int(text)) != text or not low <= int(text) <= high:
            raise Wrong("number", offset=begin)
        return int(text)

    def hex_digits(self) -> int:
        """Two hex digits in upper case (VV-6)."""
        begin = self.at
        for _ in range(2):
            if chr(self.line[self.at]) not in "0123456789ABCDEF":
                raise Wrong("format", offset=self.at)
            self.at += 1
        return int(self.line[begin : self.at], 16)


def decode_line(line: bytes) -> Json:
    """A line with its LF."""
    rest = Line(line)
    rest.expect(HEAD)
    count = rest.number(0, 0xFFFF)
    pose = []
    for _ in range(WORDS):
        rest.expect(b",")
        pose.append(rest.number(-0x8000, 0x7FFF))
    expected = reduce(xor, line[1 : rest.at])
    rest.expect(b"*")
    found = rest.hex_digits()
    if found != expected:
        raise Wrong("checksum", expected=expected, found=found)
    rest.expect(b"\r\n")
    return {"count": count, "pose": pose}


def encode(message: Json, sender: str | None = None, options: Json | None = None) -> bytes:
    """Section 6."""
    fields(message, {"count", "pose"})
    count = integer(message["count"], 0, 0xFFFF, "count")
    pose = integers(message["pose"], -0x8000, 0x7FFF, range(WORDS, WORDS + 1), "pose")
    line = HEAD + ",".join(map(str, [count, *pose])).encode()
    return line + b"*%02X\r\n" % reduce(xor, line[1:])
