"""The workstation of val2-viewer (section 8 of reference/val2-viewer.md)."""

import re
from dataclasses import dataclass
from enum import Enum, auto

from ..echo import Echo
from ..session import MS, NEVER, SECOND, Session, after, earliest
from ..stream import Item, Json
from .codec import Decoder
from .flow import ENQ, Flow

DISPLAY_CYCLE = 200 * MS
HANDSHAKE = re.compile(rb"([\x11\x13])")
# Errors that are no whole line (VV-26).
NO_LINE = ("incomplete", "noise")
# Events that may wait for the owner, and those that a request may need (VV-28).
PLACES, NEEDED = 8, 3
OUTCOMES = frozenset({"pose", "missed", "stale"})


class Link(Enum):
    """The link, and its request (section 8)."""

    DISCONNECTED = auto()
    ALLOWED = auto()
    DUE = auto()
    WAITING = auto()
    OVERDUE = auto()


@dataclass
class WorkstationConfig:
    """Section 8. Times are in nanoseconds; `NEVER` is never."""

    pause: int = 2 * SECOND
    stale_after: int = 1500 * MS
    max_hold: int = 5 * SECOND
    echo: bool = False  # the line returns what is sent

    def __post_init__(self) -> None:
        if self.pause <= DISPLAY_CYCLE or self.stale_after <= DISPLAY_CYCLE or self.max_hold == 0:
            raise ValueError("a pause or a stale_after of a display cycle, or a max_hold of 0")  # VV-24, VV-39


class Workstation(Session):
    """Asks for a pose in each display cycle, with a credit of one."""

    def __init__(self, config: WorkstationConfig | None = None) -> None:
        super().__init__()
        self.config = config or WorkstationConfig()
        self.link = Link.DISCONNECTED
        self.again_from = self.missed_from = 0
        self.live_until: int | None = None  # None: stale
        self.flow = Flow(self.config.max_hold)
        self.echo = Echo(self.config.echo)
        self.empty()

    def empty(self) -> None:
        self.decoder = Decoder()

    def draw(self) -> None:
        """A display cycle."""
        now = self.now
        self.timeout(now)
        if self.link is Link.ALLOWED:
            self.link = Link.DUE
        elif self.link in (Link.WAITING, Link.OVERDUE):
            if now < self.again_from:
                self.again_from = after(now, self.config.pause)  # VV-27
                return
            if self.link is Link.WAITING:
                self.report("missed")
            self.link = Link.DUE

    def close(self, link: Link) -> None:
        """A connection ends."""
        if self.link is Link.WAITING:
            self.report("missed")
        if self.live_until is not None:
            self.report("stale")
        self.live_until = self.flow.hold = None
        self.empty()
        self.link = link

    def connected(self, now: int) -> None:
        self.timeout(now)
        self.close(Link.ALLOWED)
        self.echo = Echo(self.config.echo)

    def disconnected(self, now: int) -> None:
        self.timeout(now)
        self.close(Link.DISCONNECTED)

    def input(self, now: int, data: bytes) -> None:
        self.timeout(now)
        for part in HANDSHAKE.split(self.without_echo(data)):  # VV-37
            if not HANDSHAKE.fullmatch(part):
                self.decoder.push(part)
                self.read(now)
            elif self.link is Link.DISCONNECTED:
                self.unexpected(self.link.name, "Xon or Xoff")
            else:
                self.flow.take(now, part[0])

    def on_message(self, now: int, message: Json) -> None:
        if self.link is Link.DISCONNECTED:
            self.unexpected(self.link.name, "Pose")
        elif self.link is Link.WAITING:
            self.link = Link.ALLOWED
            self.live_until = after(now, self.config.stale_after)
            live = {} if self.live_until >= NEVER else {"live_until": self.live_until}
            self.report("pose", message=message, **live)
        else:
            if self.link is Link.OVERDUE:  # VV-41
                self.link = Link.ALLOWED
            self.report("unasked", message=message)

    def on_error(self, now: int, item: Item) -> None:
        """VV-26"""
        super().on_error(now, item)
        if self.link is Link.DISCONNECTED:
            self.unexpected(self.link.name, "Corrupt")
        elif item.error is not None and item.error["kind"] not in NO_LINE:
            if self.link is Link.WAITING:
                self.report("missed")
            if self.link in (Link.WAITING, Link.OVERDUE):
                self.link = Link.ALLOWED

    def timeout(self, now: int) -> None:
        if self.live_until is not None and now >= self.live_until:
            self.live_until = None
            self.report("stale")
        if self.link is Link.WAITING and now >= self.missed_from:  # VV-40
            self.link = Link.OVERDUE
            self.report("missed")
        if self.flow.ends(now):
            self.report("hold_ended")

    def transmit(self, now: int) -> bytes | None:
        self.timeout(now)
        if self.link is not Link.DUE or self.flow.hold is not None or self.waiting(OUTCOMES) + NEEDED > PLACES:
            return None
        self.link = Link.WAITING
        self.again_from = after(now, self.config.pause)
        self.missed_from = after(now, self.config.stale_after)
        request = bytes([ENQ])
        self.echo.sent(request, False)
        return request

    def deadline(self) -> int | None:
        missed_from = self.missed_from if self.link is Link.WAITING else None
        return earliest(self.live_until, missed_from, self.flow.hold)
