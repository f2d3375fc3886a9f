"""The device of mmacell-proto (section 8 of reference/mmacell-proto.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

from ..session import NotTaken, Session
from ..stream import Json, Refused
from . import codec
from .pose import Pose, added, axes, counts

HELD = 512  # MM-50
FULL = 100  # the override of the beginning
# Places for events that wait for the owner, and those that a line, or a connection, needs (MM-50); only outcomes fill one.
PLACES, NEEDED = 8, 2
OUTCOMES = frozenset({"asked", "closed"})


class Link(Enum):
    """MM-72."""

    DOWN = auto()
    IDLE = auto()
    ASKED = auto()
    ANSWERING = auto()
    LEAVING = auto()
    ENDED = auto()


class Axes(Enum):
    """MM-74."""

    OFF = "Off"
    STILL = "Still"
    MOVING = "Moving"
    STOPPING = "Stopping"
    FAULT = "Fault"


RUNNING = (Axes.MOVING, Axes.STOPPING)
ORDERS = {"STP": "stop", "RST": "home", "CLO": "close", "SRV": "servo", "OVR": "override", "ACQ": "acquire", "HND": "grip"}


@dataclass
class DeviceConfig:
    """MM-75."""

    accepts: Json = field(default_factory=dict)
    writes: Json = field(default_factory=dict)
    refusal: int = 1

    def __post_init__(self) -> None:
        try:
            codec.encode({"reply": "error", "error": self.refusal}, "robot", self.writes)
        except Refused as refused:
            raise ValueError(f"refusal: {refused}") from refused  # MM-59


class Device(Session):
    """One connection of a `robot` or a `platform`; its owner moves the axes.

    Each order is an event `asked`: `accept` or `refuse` it, and say with `set_pose`, `arrived` and `fail` what became of it.
    """

    CLOSES = frozenset({"closed"})

    def __init__(self, config: DeviceConfig | None = None, device: str = "platform") -> None:
        super().__init__()
        self.config = config or DeviceConfig()
        self.device = device
        self.link = Link.DOWN
        self.axes = Axes.OFF
        self.error = 0  # of the fault
        self.pose: Pose | None = None
        self.override = FULL
        self.order: Json = {}  # that is asked
        self.answer: Json = {}  # that is to be sent
        self.lines = self.new_decoder()

    def new_decoder(self) -> codec.Decoder:
        return codec.Decoder("central", self.config.accepts, self.device)

    # What the owner says

    def accept(self, order: Json) -> None:
        """Obeys the order that is asked; raises NotTaken (MM-54)."""
        self.check(order)
        if not self.is_possible(order):
            self.reject({"not_now": {"state": self.axes.value}})
            raise NotTaken("not_possible")
        self.obey(order)
        self.answer = {"reply": "ok"}
        self.link = Link.LEAVING if order["order"] == "close" else Link.ANSWERING

    def refuse(self, order: Json, error: int) -> None:
        """Refuses the order that is asked, with any number but 0; raises NotTaken (MM-54)."""
        self.check(order)
        answer = {"reply": "error", "error": error}
        try:
            codec.encode(answer, self.device, self.config.writes)
        except Refused as refused:
            raise NotTaken(str(refused)) from refused
        self.answer, self.link = answer, Link.ANSWERING

    def check(self, order: Json) -> None:
        if self.link is not Link.ASKED or order != self.order:
            raise NotTaken("not_pending")

    def set_pose(self, pose: Sequence[float]) -> None:
        """Where the axes are: millimetres and radians. What does not fit its fields is not known (MM-52)."""
        try:
            codec.encode_axes(pose, self.device)
            self.pose = counts(pose)
        except Refused:
            self.pose = None

    def arrived(self) -> None:
        """The axes are at rest."""
        if self.axes in RUNNING:
            self.axes = Axes.STILL

    def fail(self, error: int) -> None:
        """The motion has stopped, and the servo is off (MM-57)."""
        try:
            codec.encode({"reply": "error", "error": error}, self.device, self.config.writes)
        except Refused:
            error = 1
        self.axes, self.error = Axes.FAULT, error

    # Orders

    def is_possible(self, order: Json) -> bool:
        """MM-74."""
        if order["order"] == "move":
            return self.axes is Axes.STILL
        return self.axes is not Axes.FAULT or order != {"order": "servo", "on": True}

    def obey(self, order: Json) -> None:
        """MM-74."""
        name = order["order"]
        if name == "servo" and order["on"]:
            self.axes = Axes.STILL if self.axes is Axes.OFF else self.axes
        elif name == "servo":
            self.axes = self.axes if self.axes is Axes.FAULT else Axes.OFF
        elif name in ("move", "home"):
            self.axes = Axes.MOVING
        elif name == "stop" and self.axes is Axes.MOVING:
            self.axes = Axes.STOPPING
        elif name == "override":
            self.override = order["percent"]

    def reject(self, reason: str | Json) -> None:
        """The line is answered ER, and changes nothing."""
        self.report("rejected", reason=reason)
        self.answer, self.link = {"reply": "error", "error": self.config.refusal}, Link.ANSWERING

    def command(self, command: Json) -> None:
        """MM-52, MM-53."""
        name = command["command"]
        if name == "STA":
            self.status()
            return
        if name == "MOV":
            target: Pose | None = counts(command["axes"])
            if command["mode"] == "relative":
                if self.pose is None:
                    self.reject("no_pose")
                    return
                target = added(self.pose, counts(command["axes"]))
            if target is None:
                self.reject("out_of_range")
                return
            order: Json = {"order": "move", "target": axes(target)}
        else:
            order = {"order": ORDERS[name]} | {field: value for field, value in command.items() if field != "command"}
        if self.is_possible(order):
            self.report("asked", order=order)
            self.order, self.link = order, Link.ASKED
        else:
            self.reject({"not_now": {"state": self.axes.value}})

    def status(self) -> None:
        """MM-52."""
        if self.pose is None:
            self.reject("no_pose")
            return
        self.link = Link.ANSWERING
        self.answer = {
            "reply": "status",
            "moving": self.axes in RUNNING,
            "axes": axes(self.pose),
            "servo": self.axes in (Axes.STILL, *RUNNING),
            "override": self.override,
            "error": self.error if self.axes is Axes.FAULT else 0,
        }

    # Inputs

    def connected(self, now: int) -> None:
        """MM-50, MM-56."""
        self.link = Link.IDLE if self.has_room() else Link.DOWN
        self.lines = self.new_decoder()

    def disconnected(self, now: int) -> None:
        self.link = Link.DOWN
        self.lines = self.new_decoder()

    def input(self, now: int, data: bytes) -> None:
        """MM-50."""
        while data and self.link is not Link.ENDED:
            room = HELD - len(self.lines.held)
            if room == 0:
                self.end("overrun")
            self.lines.push(data[:room])
            data = data[room:]
            self.read(now)

    def wants_input(self) -> bool:
        """MM-50."""
        return self.link is Link.ENDED or self.reads()

    def has_room(self) -> bool:
        """MM-50."""
        return self.waiting(OUTCOMES) + NEEDED <= PLACES

    def reads(self) -> bool:
        """MM-50."""
        return self.link is Link.DOWN or self.link is Link.IDLE and self.has_room()

    def read(self, now: int) -> None:
        """The next line, if the one before was answered."""
        while self.reads() and (item := self.lines.next()) is not None:
            if self.link is Link.DOWN:
                self.unexpected("Down", "Line")
            elif item.message is None:
                self.reject({"malformed": item.error})  # MM-51
            else:
                self.command(item.message)
        if self.reads():
            # Of a line that is too long nothing but its end matters.
            del self.lines.held[codec.MAX_LINE : -1]

    def end(self, reason: str) -> None:
        self.report("closed", reason=reason)
        self.link = Link.ENDED

    def timeout(self, now: int) -> None:
        """A device has no deadlines."""

    def transmit(self, now: int) -> bytes | None:
        self.read(now)  # what has waited for room
        if self.link not in (Link.ANSWERING, Link.LEAVING):
            return None
        line = codec.encode(self.answer, self.device, self.config.writes)
        if self.link is Link.LEAVING:
            self.end("agreed")
        else:
            self.link = Link.IDLE
            self.read(now)
        return line

    def deadline(self) -> int | None:
        return None
