"""The times of a line (FM-4, FM-5, FM-77 of reference/fanuc-hmi-modbus.md), in nanoseconds."""

from ..session import MS, SECOND

STALL = 500 * MS
PIECE = 50 * MS
FAST = 19200  # above it the silence is fixed
FAST_SILENCE = 1_750_000
FRAMINGS = ("tcp", "rtu", "rtu_over_tcp")


def silence(baud: int) -> int:
    """3.5 characters, in whole microseconds (FM-4)."""
    if baud == 0 or baud > FAST:
        return FAST_SILENCE
    return 385 * 100_000 // baud * 1000


def longest(baud: int) -> int:
    """256 characters (FM-77)."""
    return 2816 * SECOND // max(baud, 1)


def piece(baud: int) -> int:
    """32 characters and 20 ms (FM-79)."""
    return 352 * SECOND // max(baud, 1) + 20 * MS


def gap(framing: str, baud: int, of_line: int | None, stall: int | None) -> int | None:
    """After how long without a byte what is held has ended; None: over TCP it never has."""
    if framing not in FRAMINGS:
        raise ValueError(f"framing is one of {', '.join(FRAMINGS)}")
    if framing == "tcp":
        return None
    if framing == "rtu":
        return silence(baud) if of_line is None else of_line
    return STALL if stall is None else stall
