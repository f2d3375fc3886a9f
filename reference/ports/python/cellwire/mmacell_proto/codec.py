"""mmacell-proto: lines of the MM&A cell. Clauses MM-… are those of reference/mmacell-proto.md."""

import math
from dataclasses import dataclass
from typing import Any

from ..stream import (
    Incomplete,
    Json,
    Refused,
    StreamDecoder,
    boolean,
    error,
    fields,
    integer,
    one_of,
)

MAX_LINE = 64  # MM-7
LENGTH_DECIMALS, ANGLE_DECIMALS = 3, 4
ROBOT = (LENGTH_DECIMALS, LENGTH_DECIMALS, LENGTH_DECIMALS, ANGLE_DECIMALS)
PLATFORM = (ANGLE_DECIMALS, ANGLE_DECIMALS)
AXES = {"robot": ROBOT, "platform": PLATFORM}
ROBOT_CHARACTERS = 32  # MM-27
MAX_COORDINATE = 999_999
BARE_COMMANDS = ("STA", "STP", "RST", "CLO")
# What an object has beside the name of its command, and beside that of its reply.
COMMANDS: dict[str, set[str]] = {
    **dict.fromkeys(BARE_COMMANDS, set()),
    "SRV": {"on"},
    "OVR": {"percent"},
    "MOV": {"mode", "axes"},
    "ACQ": {"camera"},
    "HND": {"gripper", "open"},
}
REPLIES: dict[str, set[str]] = {"ok": set(), "error": {"error"}, "status": {"moving", "axes", "servo", "override", "error"}}
MODES = {"A": "absolute", "R": "relative"}


@dataclass(frozen=True)
class Dialect:
    """Section 11: other readings than the strict one."""

    itr: bool = False
    ovrd: bool = False
    clos: bool = False
    off: bool = False
    lone_lf: bool = False
    blank: bool = False
    wide_integers: bool = False

    @property
    def integer_range(self) -> tuple[int, int]:
        """MM-12."""
        return (-99_999, 99_999) if self.wide_integers else (-0x8000, 0x7FFF)


class Wrong(Exception):
    """What is wrong with a line, as an error object."""

    def __init__(self, kind: str, **fields: Any) -> None:
        super().__init__(kind)
        self.error = error(kind, **fields)


class Decoder(StreamDecoder):
    """Section 5. `sender` is `central`, `robot` or `platform`; `device` is the one that `central` commands, if it is known (MM-27)."""

    def __init__(self, sender: str = "central", options: Json | None = None, device: str = "") -> None:
        super().__init__()
        self.sender = sender
        self.device = device
        self.dialect = Dialect(**(options or {}))

    def take(self) -> tuple[int, Json | None, Json | None]:
        held = bytes(self.held)
        ends = [at for at in [held.find(b"\r\n") + 2] if at >= 2]
        if self.dialect.lone_lf:
            ends += [at for at in [held.find(b"\n") + 1] if at >= 1]
        if not ends:
            if not self.ended:
                raise Incomplete
            fault = error("too_long", limit=MAX_LINE) if len(held) >= MAX_LINE else error("incomplete")
            return len(held), None, fault
        size = min(ends)
        if size > MAX_LINE:
            return size, None, error("too_long", limit=MAX_LINE)
        content = held[: size - 2] if held[:size].endswith(b"\r\n") else held[: size - 1]
        try:
            line = Line(content, self.dialect)
            message = line.command(self.device) if self.sender == "central" else line.reply(self.sender)
            if line.at < len(content):
                raise Wrong("trailing", offset=line.at)
            return size, message, None
        except Wrong as wrong:
            return size, None, wrong.error


class Line:
    """The content of a line, read from left to right (MM-25)."""

    def __init__(self, content: bytes, dialect: Dialect) -> None:
        self.content = content
        self.dialect = dialect
        self.at = 0

    def command(self, device: str) -> Json:
        """A line from the central controller."""
        name = self.take(3, "command").decode("latin-1")
        if name in BARE_COMMANDS:
            return {"command": name}
        if name == "ITR" and self.dialect.itr:
            return {"command": "STP"}
        if name == "SRV":
            words = ["ON", "OF"] + ["OFF"] * self.dialect.off
            return {"command": name, "on": self.word(words, "on_or_off") == "ON"}
        if name == "OVR":
            if self.dialect.ovrd and self.content[self.at : self.at + 1] == b"D":
                self.at += 1
            return {"command": name, "percent": self.percent()}
        if name == "MOV":
            mode = MODES[self.character("AR", "absolute_or_relative")]
            return {"command": name, "mode": mode, "axes": self.coordinates(AXES.get(device) or self.guess_axes())}
        if name == "ACQ":
            return {"command": name, "camera": self.integer()}
        if name == "HND":
            gripper = self.integer()
            words = ["OPEN", "CLOSE"] + ["CLOS"] * self.dialect.clos
            return {"command": name, "gripper": gripper, "open": self.word(words, "open_or_close") == "OPEN"}
        raise Wrong("unknown_command", found=list(self.content[:3]))

    def reply(self, sender: str) -> Json:
        """A line from a device."""
        name = self.take(2, "reply")
        if name == b"OK":
            if self.at == len(self.content):
                return {"reply": "ok"}
            moving = self.flag()
            axes = self.coordinates(AXES[sender])
            servo, override, number = self.flag(), self.percent(), self.integer()
            return {
                "reply": "status",
                "moving": moving,
                "axes": axes,
                "servo": servo,
                "override": override,
                "error": number,
            }
        if name == b"ER":
            number = self.integer()
            if number == 0:
                raise Wrong("error_zero")
            return {"reply": "error", "error": number}
        raise Wrong("unknown_reply", found=list(name))

    def take(self, count: int, expected: str) -> bytes:
        """The next characters."""
        if len(self.content) < self.at + count:
            raise Wrong("short", offset=len(self.content), expected=expected)
        self.at += count
        return self.content[self.at - count : self.at]

    def character(self, allowed: str, expected: str) -> str:
        """One of the allowed characters."""
        found = self.take(1, expected)
        if found.decode("latin-1") not in allowed:
            raise Wrong("unexpected", offset=self.at - 1, found=found[0], expected=expected)
        return found.decode()

    def digits(self, count: int) -> str:
        return "".join(self.character("0123456789", "digit") for _ in range(count))

    def flag(self) -> bool:
        return self.character("TF", "true_or_false") == "T"

    def integer(self) -> int:
        begin = self.at
        sign = self.character("+-", "sign")
        if self.dialect.blank and self.content[self.at : self.at + 1] == b" ":
            self.at += 1
        value = int(sign + self.digits(5))
        low, high = self.dialect.integer_range
        if not low <= value <= high:
            raise Wrong("integer_range", offset=begin, found=value)
        return value

    def percent(self) -> int:
        begin = self.at
        value = self.integer()
        if not 0 <= value <= 100:
            raise Wrong("percent", offset=begin, found=value)
        return value

    def guess_axes(self) -> tuple[int, ...]:
        """Whose coordinates these are, for a listener that does not know (MM-27)."""
        return ROBOT if len(self.content) - self.at >= ROBOT_CHARACTERS else PLATFORM

    def coordinates(self, axes: tuple[int, ...]) -> list[float]:
        return [self.coordinate(decimals) for decimals in axes]

    def coordinate(self, decimals: int) -> float:
        sign = self.character("+-", "sign")
        whole = self.digits(6 - decimals)
        self.character(".", "point")
        return int(sign + whole + self.digits(decimals)) / float(10**decimals)

    def word(self, words: list[str], expected: str) -> str:
        """The rest of the line, as one of the words."""
        rest = self.content[self.at :].decode("latin-1")
        if rest in words:
            self.at = len(self.content)
            return rest
        begun = next((word for word in words if rest.startswith(word)), None)
        if begun is not None:
            raise Wrong("trailing", offset=self.at + len(begun))
        if any(word.startswith(rest) for word in words):
            raise Wrong("short", offset=len(self.content), expected=expected)
        raise Wrong("unexpected", offset=self.at, found=ord(rest[0]), expected=expected)


def encode(message: Json, sender: str = "central", options: Json | None = None) -> bytes:
    """Section 6."""
    dialect = Dialect(**(options or {}))
    text = encode_command(message, dialect) if sender == "central" else encode_reply(message, sender, dialect)
    return text.encode() + (b"\n" if dialect.lone_lf else b"\r\n")


def encode_command(message: Json, dialect: Dialect) -> str:
    """A line of the central controller, without its end."""
    name = one_of(message["command"], set(COMMANDS), "command")
    fields(message, {"command"} | COMMANDS[name])
    if name == "STP" and dialect.itr:
        return "ITR"
    if name == "SRV":
        return name + ("ON" if boolean(message["on"], "on") else "OFF" if dialect.off else "OF")
    if name == "OVR":
        return ("OVRD" if dialect.ovrd else name) + encode_percent(message["percent"], dialect)
    if name == "MOV":
        mode = next((key for key, value in MODES.items() if value == message["mode"]), None)
        if mode is None:
            raise Refused("a mode is absolute or relative")
        return name + mode + encode_axes(message["axes"], "central")
    if name == "ACQ":
        return name + encode_integer(message["camera"], dialect)
    if name == "HND":
        word = "OPEN" if boolean(message["open"], "open") else "CLOS" if dialect.clos else "CLOSE"
        return name + encode_integer(message["gripper"], dialect) + word
    return name


def encode_reply(message: Json, sender: str, dialect: Dialect) -> str:
    """A line of a device, without its end."""
    name = one_of(message["reply"], set(REPLIES), "reply")
    fields(message, {"reply"} | REPLIES[name])
    if name == "ok":
        return "OK"
    number = encode_integer(message["error"], dialect)
    if name == "error":
        if message["error"] == 0:
            raise Refused("ER has a number other than 0")
        return "ER" + number
    moving, servo = ("FT"[boolean(message[name], name)] for name in ("moving", "servo"))
    return (
        "OK"
        + moving
        + encode_axes(message["axes"], sender)
        + servo
        + encode_percent(message["override"], dialect)
        + number
    )


def encode_integer(value: Any, dialect: Dialect) -> str:
    value = integer(value, *dialect.integer_range, "an integer")
    return f"{'-' if value < 0 else '+'}{' ' * dialect.blank}{abs(value):05}"


def encode_percent(value: Any, dialect: Dialect) -> str:
    return encode_integer(integer(value, 0, 100, "an override"), dialect)


def encode_axes(axes: Any, sender: str) -> str:
    """Coordinates, rounded to their last digits (MM-11). A central controller moves either device."""
    allowed: list[tuple[int, ...]] = [ROBOT] * (sender != "platform") + [PLATFORM] * (sender != "robot")
    decimals = next((decimals for decimals in allowed if len(decimals) == len(axes)), None)
    if decimals is None:
        raise Refused("a robot has four axes, a platform two")
    return "".join(encode_coordinate(value, digits) for value, digits in zip(axes, decimals))


def encode_coordinate(value: Any, decimals: int) -> str:
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise Refused("a coordinate is a number")
    scaled = abs(value) * 10**decimals
    count = math.floor(scaled) + (scaled - math.floor(scaled) >= 0.5)
    if count > MAX_COORDINATE:
        raise Refused(f"a coordinate of {value} does not fit")
    digits = f"{int(math.copysign(count, value)):+07}"
    return digits[:-decimals] + "." + digits[-decimals:]
