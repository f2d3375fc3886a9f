"""Words of ALTER as lengths and angles (AL-23, AL-41 of reference/val2-alter.md)."""

import math

from ..stream import Refused
from .codec import WORD

PER_MM, PER_DEGREE = 32.0, 65536 / 360


def units(value: float, scale: float) -> int | None:
    """In units of a word, halves away from zero; None: it is no number."""
    if math.isnan(value):
        return None
    scaled = abs(value * scale)
    return int(math.copysign(2**31 if math.isinf(scaled) else math.floor(scaled + 0.5), value))


def word(value: float, scale: float) -> int:
    """The word of a length (`PER_MM`) or an angle (`PER_DEGREE`); raises Refused."""
    found = units(value, scale)
    if found is None or not WORD[0] <= found <= WORD[1]:
        raise Refused(f"{value} does not fit a word")
    return found


def nearest_word(value: float, scale: float) -> int:
    """The same, or the nearest limit; 0 for what is no number."""
    return max(WORD[0], min(WORD[1], units(value, scale) or 0))
