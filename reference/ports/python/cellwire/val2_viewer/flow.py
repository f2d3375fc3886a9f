"""XON and XOFF of val2-viewer, at both ends (section 2 of reference/val2-viewer.md)."""

from ..session import after

ENQ, XON, XOFF = 0x05, 0x11, 0x13


class Flow:
    """Whether the peer lets us send; `hold` is until when it does not, None: it does."""

    def __init__(self, max_hold: int) -> None:
        self.max_hold = max_hold
        self.hold: int | None = None

    def take(self, now: int, byte: int) -> None:
        """XON or XOFF has come."""
        self.hold = after(now, self.max_hold) if byte == XOFF else None

    def ends(self, now: int) -> bool:
        """Whether an XOFF has lasted too long; it holds no longer then."""
        if self.hold is None or now < self.hold:
            return False
        self.hold = None
        return True
