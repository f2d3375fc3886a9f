"""The host of val2-viewer (section 7 of reference/val2-viewer.md)."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

from ..echo import Echo
from ..session import MS, SECOND, Session, after, earliest
from ..stream import Json
from .codec import encode
from .flow import ENQ, XOFF, XON, Flow


class Link(Enum):
    """Section 7."""

    DISCONNECTED = auto()
    READY = auto()
    ASKED = auto()


@dataclass
class HostConfig:
    """Section 7. Times are in nanoseconds; `NEVER` is never."""

    interval: int = 150 * MS
    max_age: int = 200 * MS
    max_hold: int = 5 * SECOND
    echo: bool = False  # the line returns what is sent
    format: Callable[[Json], bytes] = encode

    def __post_init__(self) -> None:
        if 0 in (self.interval, self.max_age, self.max_hold):
            raise ValueError("an interval, a max_age or a max_hold of 0")  # VV-18, VV-39


class Host(Session):
    """Answers each request with the newest pose, at most once in an interval."""

    def __init__(self, config: HostConfig | None = None) -> None:
        super().__init__()
        self.config = config or HostConfig()
        self.link = Link.DISCONNECTED
        self.begin = 0  # from when on a packet may be sent
        self.pose: list[int] | None = None
        self.pose_until = 0
        self.count = 0
        self.flow = Flow(self.config.max_hold)
        self.echo = Echo(self.config.echo)

    def set_pose(self, pose: list[int]) -> None:
        """Where the arm is now: the words of a transformation."""
        encode({"count": 0, "pose": pose})  # refuses what does not fit
        self.timeout(self.now)
        self.pose = list(pose)
        self.pose_until = after(self.now, self.config.max_age)

    def connected(self, now: int) -> None:
        self.timeout(now)
        self.link = Link.READY
        self.begin = after(now, self.config.interval)
        self.flow.hold = None
        self.echo = Echo(self.config.echo)

    def disconnected(self, now: int) -> None:
        self.timeout(now)
        self.link = Link.DISCONNECTED
        self.flow.hold = None

    def input(self, now: int, data: bytes) -> None:
        self.timeout(now)
        for byte in self.without_echo(data):
            if byte not in (ENQ, XON, XOFF):
                self.report("unknown", byte=byte)
            elif self.link is Link.DISCONNECTED:
                self.unexpected(self.link.name, f"{byte:02X}")
            elif byte != ENQ:
                self.flow.take(now, byte)
            elif self.link is Link.ASKED:
                self.report("ignored")
            else:
                self.link = Link.ASKED
                self.report("asked")

    def timeout(self, now: int) -> None:
        if self.pose is not None and now >= self.pose_until:
            self.pose = None
            self.report("stale")
        if self.flow.ends(now):
            self.report("hold_ended")

    def transmit(self, now: int) -> bytes | None:
        self.timeout(now)
        if self.link is not Link.ASKED or now < self.begin or self.pose is None or self.flow.hold is not None:
            return None
        self.link = Link.READY
        self.begin = after(now, self.config.interval)
        message: Json = {"count": self.count, "pose": self.pose}
        packet = self.config.format(message)
        if XON in packet or XOFF in packet:  # VV-2
            self.report("unsendable")
            return None
        self.count = (self.count + 1) % 0x10000
        self.report("sent", message=message)
        self.echo.sent(packet, True)
        return packet

    def deadline(self) -> int | None:
        is_due = self.link is Link.ASKED and self.pose is not None and self.flow.hold is None
        until = None if self.pose is None else self.pose_until
        return earliest(until, self.begin if is_due else None, self.flow.hold)
