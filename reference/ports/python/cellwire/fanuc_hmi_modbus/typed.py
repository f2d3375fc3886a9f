"""Values wider than a register, and what the registers are assigned to (section 4.3 of reference/fanuc-hmi-modbus.md)."""

import math
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from ..stream import Refused

LOW_FIRST, HIGH_FIRST = "low_first", "high_first"
LARGEST_ADDRESS, MAX_SLOTS = 16384, 80
NAME = r"[ -&(-~]{1,37}"  # printable, without the quote
TEXT, REAL = -1, 0  # of a slot's `multiply`
SMALLEST_FACTOR, LARGEST_FACTOR = 0.0001, 10000


def join(words: Sequence[int], order: str = LOW_FIRST) -> int:
    """Two registers as 32 bits (FM-19)."""
    low, high = words if order == LOW_FIRST else reversed(words)
    return low | high << 16


def split(bits: int, order: str = LOW_FIRST) -> list[int]:
    """32 bits as two registers."""
    words = [bits & 0xFFFF, bits >> 16 & 0xFFFF]
    return words if order == LOW_FIRST else words[::-1]


def rounded(value: float) -> int:
    """To the nearest, halves away from zero."""
    if not math.isfinite(value):
        raise Refused(f"{value} is no number")
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def signed(bits: int, width: int) -> int:
    return bits - (bits >> width - 1 << width)


@dataclass(frozen=True)
class Number:
    """How a number is in registers: `int16` or `int32` times `multiply`, or `float32`."""

    kind: str
    multiply: float = 1.0
    order: str = LOW_FIRST

    def read(self, registers: Sequence[int]) -> float:
        """The value of its registers."""
        if self.kind == "float32":
            (value,) = struct.unpack("<f", struct.pack("<I", join(registers, self.order)))
            return float(value)
        bits = signed(registers[0], 16) if self.kind == "int16" else signed(join(registers, self.order), 32)
        return bits / self.multiply

    def write(self, value: float) -> list[int]:
        """The registers of a value; raises Refused."""
        if self.kind == "float32":
            try:
                return split(int.from_bytes(struct.pack("<f", value), "little"), self.order)
            except OverflowError as wrong:
                raise Refused(f"{value} is no real of 32 bits") from wrong
        count, width = rounded(value * self.multiply), 16 if self.kind == "int16" else 32
        if not -(2 ** (width - 1)) <= count < 2 ** (width - 1):
            raise Refused(f"{value} does not fit {width} bits")
        return [count & 0xFFFF] if width == 16 else split(count & 0xFFFFFFFF, self.order)


def read_text(registers: Sequence[int]) -> str:
    """Characters up to a NUL, the first in the high byte."""
    return struct.pack(f">{len(registers)}H", *registers).split(b"\0")[0].decode()


def write_text(text: str, registers: int) -> list[int]:
    """Characters in so many registers; raises Refused."""
    data = text.encode()
    if len(data) > 2 * registers or 0 in data:
        raise Refused(f"a text of up to {2 * registers} bytes without a NUL")
    return list(struct.unpack(f">{registers}H", data.ljust(2 * registers, b"\0")))


@dataclass(frozen=True)
class Slot:
    """A slot of `$SNPX_ASG`: its address counts from 1."""

    address: int
    size: int
    var_name: str
    multiply: float


def assign(slots: Sequence[Slot]) -> list[tuple[int, int]]:
    """The first and the last PDU address of each slot; raises Refused (FM-20)."""
    if len(slots) > MAX_SLOTS:
        raise Refused(f"there are {MAX_SLOTS} slots")
    ranges: list[tuple[int, int]] = []
    for slot in slots:
        first, last = slot.address - 1, slot.address + slot.size - 2
        if not 0 <= first <= last < LARGEST_ADDRESS:
            raise Refused(f"{slot.var_name}: registers that are not there")
        if not re.fullmatch(NAME, slot.var_name):
            raise Refused(f"{slot.var_name}: no name of a variable")
        if slot.multiply not in (TEXT, REAL) and not SMALLEST_FACTOR <= slot.multiply <= LARGEST_FACTOR:
            raise Refused(f"{slot.var_name}: a factor of {slot.multiply}")
        if any(first <= end and begin <= last for begin, end in ranges):
            raise Refused(f"{slot.var_name}: registers of another slot")
        ranges.append((first, last))
    return ranges
