"""The controller of val2-alter (section 8 of reference/val2-alter.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

from ..session import MS, NotTaken, after, earliest, span
from ..stream import Item, Json, Refused
from . import codec
from .codec import AXES
from .line import CYCLE, Line, shortest_window, window

CODES = {"checksum": 1, "too_long": 3, "incomplete": 4, "start_mark": 5, "end_mark": 5}  # section 4.6
FIELDS, TOO_LONG, TIMEOUT = 2, 3, 6
TRANSFORM = 12
# The outcomes of an ALTER (its start, an exception, its end), and those from an exception on.
OUTCOMES, LAST_OUTCOMES = 3, 2


class Phase(Enum):
    """Section 8.2."""

    DISCONNECTED = auto()
    OFF = auto()
    STARTING = auto()
    RUNNING = auto()
    INTERRUPTED = auto()
    ENDING = auto()


ALTERING = (Phase.STARTING, Phase.RUNNING, Phase.INTERRUPTED, Phase.ENDING)


@dataclass
class ControllerConfig:
    """Section 8.1. Times are in nanoseconds; no gap: `NEVER`."""

    framing: Json = field(default_factory=dict)
    baud: int = 38400
    gap: int = 4 * MS
    mode: int = 23
    data: list[int] = field(default_factory=list)
    subroutine: bool = False
    attempts: int = 3
    unselected: str = "by_mode"

    def __post_init__(self) -> None:
        framing = codec.Framing(**self.framing)
        if self.mode > 31 or self.attempts == 0 or shortest_window(self.mode, framing, self.baud) < 0:
            raise ValueError("no mode, 0 attempts, or a window that does not hold a reply")  # AL-69
        try:
            codec.encode_controller({"kind": "start", "mode": self.mode, "data": self.data})
        except Refused as refused:
            raise ValueError(str(refused)) from None

    @property
    def is_cumulative(self) -> bool:
        return bool(self.mode & 1)


@dataclass
class Window:
    """The turn of the host: when an answer may come, and the first fault in it."""

    opens: int
    closes: int
    fault: int = 0


class Controller(Line):
    """Runs a program with ALTER: its owner starts it, and moves the arm by what the replies say."""

    def __init__(self, config: ControllerConfig | None = None) -> None:
        self.config = config or ControllerConfig()
        super().__init__("host", self.config.framing, self.config.gap)
        self.phase = Phase.DISCONNECTED
        self.attempts = self.slot = self.following = self.error = 0
        self.window: Window | None = None  # None: the controller's turn
        self.was_reported = self.has_returned = False
        self.segment = (2, 1, 0)
        self.transform = [0] * TRANSFORM
        self.words = [0] * AXES

    # What the owner says

    def start(self) -> None:
        """The program begins an ALTER; raises NotTaken (AL-71)."""
        if self.phase is Phase.DISCONNECTED:
            raise NotTaken("not_connected")
        if self.phase is not Phase.OFF:
            raise NotTaken("already_started")
        if not self.has_room(OUTCOMES):
            raise NotTaken("events_full")
        self.phase, self.window = Phase.STARTING, None
        self.slot, self.following = self.now, after(self.now, CYCLE)
        self.attempts = self.error = 0

    def finish(self) -> None:
        """The program ends its ALTER; raises NotTaken (AL-81)."""
        if self.phase not in ALTERING:
            raise NotTaken("not_running")
        if self.phase is Phase.STARTING:
            self.phase, self.window = Phase.OFF, None
            self.settle("ended", error=0)
        elif self.phase is not Phase.ENDING:
            self.end(0)

    def interrupt(self) -> None:
        """The program runs its subroutine; raises NotTaken (AL-90)."""
        if self.phase is not Phase.RUNNING or self.window is not None:
            raise NotTaken("not_running")
        self.begin_subroutine()

    def resume(self) -> None:
        """The subroutine returns; raises NotTaken."""
        if self.phase is not Phase.INTERRUPTED or self.has_returned:
            raise NotTaken("not_running")
        self.has_returned = True

    def set_segment(self, status: int, number: int, percent: int) -> None:
        """What the next messages say of the motion (section 4.2)."""
        self.segment = (status, number, percent)

    def set_transform(self, transform: Sequence[int]) -> None:
        """Where the arm is: twelve words (section 4.2)."""
        self.transform = list(transform)

    def begin_subroutine(self) -> None:
        self.phase = Phase.INTERRUPTED
        self.was_reported = self.has_returned = False

    def end(self, error: int) -> None:
        """An end message is to be sent."""
        self.phase, self.window, self.error = Phase.ENDING, None, error

    # Inputs

    def is_open(self) -> bool:
        return self.phase is not Phase.DISCONNECTED

    def connected(self, now: int) -> None:
        self.leave(Phase.OFF)

    def disconnected(self, now: int) -> None:
        self.leave(Phase.DISCONNECTED)

    def leave(self, phase: Phase) -> None:
        if self.phase in ALTERING:
            self.settle("ended", error=TIMEOUT)
        self.phase, self.window, self.gap_at = phase, None, None
        self.frames.clear()

    def awaited(self, now: int) -> Window | None:
        """The window, if it is open."""
        return self.window if self.window is not None and now >= self.window.opens else None

    def fault(self, now: int, code: int) -> None:
        """The first one counts."""
        found = self.awaited(now)
        if found is not None and found.fault == 0:
            found.fault = code

    def on_failure(self, now: int, kind: str) -> None:
        self.fault(now, CODES.get(kind, FIELDS))

    def on_error(self, now: int, item: Item) -> None:
        """Bytes of no frame; those of a corrupt one have counted before."""
        if item.error is not None and item.error["kind"] == "start_mark":
            self.fault(now, CODES["start_mark"])

    def on_frame(self, now: int, item: Item, message: Json) -> None:
        """AL-89"""
        if self.awaited(now) is None:
            self.report("stray", message=message)
        elif (self.phase is Phase.STARTING) != (message["kind"] == "start_reply"):
            self.fault(now, FIELDS)
        elif message["kind"] == "reply":
            self.take(now, message)
        elif message["reply"] == "repeat":
            self.try_again(0)
        else:
            is_accepted = message["reply"] == "accept"
            self.phase, self.window, self.error = Phase.RUNNING if is_accepted else Phase.OFF, None, 0
            self.words = [0] * AXES  # AL-70
            self.settle("started" if is_accepted else "refused")

    def take(self, now: int, message: Json) -> None:
        """AL-77, AL-78, AL-82"""
        exception = message["exception"]
        if exception and not self.has_room(LAST_OUTCOMES):
            self.fault(now, TOO_LONG)
            return
        self.window, self.error = None, 0
        moves = self.phase is Phase.RUNNING and self.config.mode & 16
        if moves:
            holds = {"hold": True, "zero": False}.get(self.config.unselected, not self.config.is_cumulative)
            kept = self.words if holds else [0] * AXES
            self.words = [old if new is None else new for old, new in zip(kept, message["values"])]
        is_at_rest = not moves and self.config.is_cumulative
        self.report("reply", message=message, values=[0] * AXES if is_at_rest else self.words)
        if exception and self.phase is Phase.RUNNING:
            if self.config.subroutine:
                self.begin_subroutine()
            else:
                self.end(0)
            self.settle("exception" if self.config.subroutine else "aborted", exception=exception)

    def try_again(self, error: int) -> None:
        """AL-75"""
        self.window = None
        if self.attempts >= self.config.attempts:
            self.phase = Phase.OFF
            self.settle("gave_up")
        else:
            self.error = error

    # Times

    def timeout(self, now: int) -> None:
        self.end_gap(now)
        closed = self.window
        if closed is None or now < closed.closes:
            return
        self.end_frame(now)  # AL-74: only errors come of it
        self.window = None
        error = closed.fault or TIMEOUT
        self.report("bad_reply", error=error)
        if self.phase is Phase.STARTING:
            self.try_again(error)
        elif closed.fault:
            self.error = error  # AL-76
        else:
            self.end(TIMEOUT)

    def transmit(self, now: int) -> bytes | None:
        self.timeout(now)
        if self.phase not in ALTERING or now < self.slot:  # a slot is never before its window has closed
            return None
        frame = codec.encode(self.next_message(), "robot", self.config.framing)
        self.frames.clear()
        self.gap_at = None
        if self.phase is Phase.ENDING:
            self.phase = Phase.OFF
            self.settle("ended", error=self.error)
            return frame
        length = span(len(frame), self.config.baud)
        opens = after(now, length)  # AL-72
        self.window = Window(opens, after(opens, min(window(self.config.mode), max(CYCLE - length, 0))))
        self.slot = max(self.following, self.window.closes)  # AL-73
        self.following = after(self.slot, CYCLE)
        return frame

    def next_message(self) -> Json:
        if self.phase is Phase.STARTING:
            self.attempts += 1
            return {"kind": "start", "mode": self.config.mode, "data": self.config.data, "error": self.error}
        if self.phase is Phase.ENDING:
            return {"kind": "end", "error": self.error}
        if self.was_reported and self.has_returned:
            self.phase = Phase.RUNNING
        self.was_reported = self.phase is Phase.INTERRUPTED
        status, number, percent = self.segment
        return {
            "kind": "motion",
            "phase": "interrupted" if self.was_reported else "running",
            "error": self.error,
            "segment_status": status,
            "segment": number,
            "percent": percent,
            "transform": self.transform if self.config.mode & 4 else None,
        }

    def deadline(self) -> int | None:
        if self.phase not in ALTERING:
            return self.gap_at
        return earliest(self.gap_at, self.slot if self.window is None else self.window.closes)
