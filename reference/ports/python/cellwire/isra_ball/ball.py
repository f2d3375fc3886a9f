"""The ball of isra-ball (section 8 of reference/isra-ball.md)."""

from dataclasses import dataclass
from enum import Enum, auto

from ..echo import Echo
from ..session import Session
from ..stream import Json
from .codec import POLL, encode


class Link(Enum):
    """Section 8."""

    DISCONNECTED = auto()
    READY = auto()
    REPLYING = auto()


@dataclass
class BallConfig:
    """Section 8."""

    sensor_type: int = 0
    sensor: int = 0
    echo: bool = False  # the line returns what is sent

    def __post_init__(self) -> None:
        if not (0 <= self.sensor_type <= 7 and 0 <= self.sensor <= 7):
            raise ValueError("a sensor type and a number are 0 to 7")  # IB-32


class Ball(Session):
    """Answers polls with what it has measured last."""

    def __init__(self, config: BallConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or BallConfig()
        self.echo = Echo(config.echo)
        self.link = Link.DISCONNECTED
        self.is_new = False
        self.packet: Json = {"sensor_type": config.sensor_type, "sensor": config.sensor, "status": "old"}
        self.packet |= {"force": [0, 0, 0], "moment": [0, 0, 0], "keys": 0}

    def measure(self, force: list[int], moment: list[int], keys: int) -> None:
        """The sensor has measured; bit k - 1 of `keys` is key k."""
        packet = self.packet | {"force": list(force), "moment": list(moment), "keys": keys}
        encode(packet)  # refuses what does not fit
        self.packet = packet
        self.is_new = True

    def connected(self, now: int) -> None:
        self.link = Link.READY
        self.echo = Echo(self.config.echo)

    def disconnected(self, now: int) -> None:
        self.link = Link.DISCONNECTED

    def input(self, now: int, data: bytes) -> None:
        for byte in self.without_echo(data):
            if byte != POLL:
                self.report("unknown", byte=byte)
            elif self.link is Link.DISCONNECTED:
                self.unexpected(self.link.name, "Enquiry")
            elif self.link is Link.REPLYING:
                self.report("ignored")
            else:
                self.link = Link.REPLYING

    def timeout(self, now: int) -> None:
        """The ball has no deadlines."""

    def transmit(self, now: int) -> bytes | None:
        if self.link is not Link.REPLYING:
            return None
        self.link = Link.READY
        message = self.packet | {"status": "fresh" if self.is_new else "old"}
        self.is_new = False
        self.report("reply", message=message)
        packet = encode(message)
        self.echo.sent(packet, True)
        return packet

    def deadline(self) -> int | None:
        return None
