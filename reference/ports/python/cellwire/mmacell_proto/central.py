"""The central controller of mmacell-proto (section 7 of reference/mmacell-proto.md)."""

from dataclasses import dataclass, field
from enum import Enum, auto

from ..session import MS, SECOND, NotTaken, Session, after
from ..stream import Json, Refused
from . import codec
from .pose import Pose, added, counts


OUTCOMES = frozenset({"done", "refused", "status", "aborted", "closed"})
# Places for events that wait for the owner, and those that a connection needs (MM-40).
PLACES, NEEDED = 4, 2


class Link(Enum):
    """Section 7.1."""

    DOWN = auto()
    IDLE = auto()
    SENDING = auto()
    AWAITING = auto()
    ENDED = auto()


class Motion(Enum):
    """Section 7.1."""

    STARTING = auto()
    MOVING = auto()
    STOPPING = auto()
    REST = auto()


class Target(Enum):
    """A target that is no pose."""

    NONE = auto()
    UNKNOWN = auto()


@dataclass
class CentralConfig:
    """MM-71. Times are in nanoseconds."""

    accepts: Json = field(default_factory=dict)
    writes: Json = field(default_factory=dict)
    timeout: int = SECOND
    settle: int = 100 * MS
    tolerance: int = 10


class Central(Session):
    """One connection to a device: a `robot` or a `platform`."""

    CLOSES = frozenset({"closed"})

    def __init__(self, config: CentralConfig | None = None, device: str = "platform") -> None:
        super().__init__()
        self.config = config or CentralConfig()
        if self.config.timeout == 0:
            raise ValueError("a timeout of 0")
        self.device = device
        self.link = Link.DOWN
        self.command: Json = {}
        self.until = 0
        self.decoder = self.new_decoder()
        self.motion = Motion.REST
        self.target: Pose | Target = Target.NONE
        self.believed_from = 0
        self.pose: Pose | None = None

    def new_decoder(self) -> codec.Decoder:
        return codec.Decoder(self.device, self.config.accepts)

    def close(self, reason: str | Json, link: Link) -> None:
        """The connection ends; a command that was not finished is reported with it (MM-36)."""
        name = {Link.SENDING: "not_sent", Link.AWAITING: "unknown"}.get(self.link)
        self.report("closed", reason=reason, unfinished={name: self.command} if name else "nothing")
        self.link = link

    def report(self, event: str, **fields: object) -> None:
        """Of too many events the oldest notice is dropped."""
        super().report(event, **fields)
        notices = [at for at, each in enumerate(self.events) if each["event"] not in OUTCOMES]
        if len(self.events) > PLACES and notices:
            del self.events[notices[0]]

    def connected(self, now: int) -> None:
        if self.waiting(OUTCOMES) + NEEDED > PLACES:
            self.disconnected(now)
            return
        if self.link not in (Link.DOWN, Link.ENDED):
            self.close("disconnected", Link.DOWN)
        self.link = Link.IDLE
        self.decoder = self.new_decoder()
        self.motion, self.target, self.pose = Motion.REST, Target.NONE, None  # MM-39
        self.report("connected")

    def disconnected(self, now: int) -> None:
        if self.link not in (Link.DOWN, Link.ENDED):
            self.close("disconnected", Link.DOWN)
        self.link = Link.DOWN
        self.decoder = self.new_decoder()

    def input(self, now: int, data: bytes) -> None:
        self.decoder.push(data)
        while (item := self.decoder.next()) is not None:
            if self.link is Link.ENDED:  # MM-38
                continue
            if self.link is Link.DOWN:
                self.unexpected("Down", "Reply")
            elif item.error is not None:
                self.close({"malformed": item.error}, Link.ENDED)
            elif item.message is not None:
                self.reply(now, item.message)

    def reply(self, now: int, message: Json) -> None:
        """MM-33, MM-34."""
        kind, name = message["reply"], self.command.get("command")
        if self.link is not Link.AWAITING or (kind == "status") != (name == "STA") and kind != "error":
            self.close("mismatch", Link.ENDED)
            return
        if kind == "ok" and name == "CLO":
            self.link = Link.IDLE  # its command is finished
            self.close("agreed", Link.ENDED)
            return
        self.link = Link.IDLE
        if kind == "error":
            self.report("refused", command=self.command, error=message["error"])
        elif kind == "ok":
            self.done(now)
            self.report("done", command=self.command)
        else:
            motion = self.status(message)
            status = {name: value for name, value in message.items() if name != "reply"}
            self.report("status", status=status, motion=motion)

    def done(self, now: int) -> None:
        """What `OK` to the command means for the motion (MM-42 to MM-44)."""
        name = self.command["command"]
        if name == "MOV":
            self.target = self.goal(counts(self.command["axes"]))
        elif name == "RST":
            self.target = Target.UNKNOWN
        if name in ("MOV", "RST"):
            self.motion, self.believed_from = Motion.STARTING, after(now, self.config.settle)
        elif name == "STP" or (name == "SRV" and not self.command["on"]):
            if self.motion is Motion.REST:
                self.target = Target.NONE
            else:
                self.motion = Motion.STOPPING

    def goal(self, axes: Pose) -> Pose | Target:
        """Where a move ends."""
        if self.command["mode"] == "absolute":
            return axes
        if self.motion is not Motion.REST or self.pose is None:
            return Target.UNKNOWN
        return added(self.pose, axes) or Target.UNKNOWN

    def status(self, message: Json) -> str | Json:
        """What a status means for the motion (MM-70)."""
        pose, servo = counts(message["axes"]), message["servo"]
        if message["moving"]:
            if self.motion is Motion.STOPPING:
                return "stopping"
            self.motion = Motion.MOVING
            return "moving"
        if self.motion is Motion.STOPPING or self.target is Target.NONE:
            self.motion, self.target, self.pose = Motion.REST, Target.NONE, pose
            return "still"
        is_there = isinstance(self.target, tuple) and all(
            abs(here - there) <= self.config.tolerance for here, there in zip(pose, self.target)
        )
        if self.motion is Motion.STARTING and not (is_there and servo):
            return "starting"
        self.motion, self.pose = Motion.REST, pose
        if not servo:
            return {"missed": "servo_off"}
        if self.target is Target.UNKNOWN:
            return "still"
        return "arrived" if is_there else {"missed": "elsewhere"}

    def timeout(self, now: int) -> None:
        if self.link is Link.AWAITING and now >= self.until:
            self.close("timeout", Link.ENDED)

    def abort(self) -> None:
        """MM-37."""
        if self.link is Link.SENDING:
            self.link = Link.IDLE
            self.report("aborted", command=self.command)
        elif self.link is Link.AWAITING:
            self.close("aborted", Link.ENDED)

    def request(self, command: Json) -> None:
        """The next command (MM-30); raises NotTaken."""
        if self.link in (Link.DOWN, Link.ENDED):
            raise NotTaken("not_connected")
        if self.link is not Link.IDLE or self.waiting(OUTCOMES):
            raise NotTaken("busy")
        try:
            frame = codec.encode(command, "central", self.config.writes)
        except Refused as refused:
            raise NotTaken(str(refused)) from refused
        reader = codec.Decoder("central", self.config.writes)
        reader.push(frame)
        item = reader.next()
        # With its coordinates as they are written (MM-11).
        self.command = command if item is None or item.message is None else item.message
        self.link = Link.SENDING

    def transmit(self, now: int) -> bytes | None:
        if self.link is not Link.SENDING:
            return None
        if self.command["command"] == "STA" and self.motion is Motion.STARTING and now >= self.believed_from:
            self.motion = Motion.MOVING  # MM-45
        self.link = Link.AWAITING
        self.until = after(now, self.config.timeout)
        return codec.encode(self.command, "central", self.config.writes)

    def deadline(self) -> int | None:
        return self.until if self.link is Link.AWAITING else None
