"""The host of val2-alter (section 7 of reference/val2-alter.md)."""

from dataclasses import dataclass, field
from enum import Enum, auto

from ..session import MS, NotTaken, after, earliest, span
from ..stream import Item, Json
from . import codec
from .codec import AXES
from .limiter import HIGHEST, Limiter
from .line import CYCLE, Line, shortest_window, window

# The outcomes of an ALTER: its end, and that of a stop.
OUTCOMES = 2
VELOCITY = [90, 90, 90, 150, 150, 150]
ACCELERATION = [9, 9, 9, 15, 15, 15]


class Phase(Enum):
    """Section 7.2."""

    DISCONNECTED = auto()
    IDLE = auto()
    REPEATING = auto()
    STARTING = auto()
    ACCEPTED = auto()
    RUNNING = auto()
    INTERRUPTED = auto()
    STOPPING = auto()
    SILENT = auto()


REPLYING = (Phase.RUNNING, Phase.INTERRUPTED, Phase.STOPPING)
TARGETED = (Phase.ACCEPTED, *REPLYING)
ALTERING = (*TARGETED, Phase.SILENT)


class Sent(Enum):
    """What became of an exception (section 7.6)."""

    UNSENT = auto()
    SENT = auto()
    UNREAD = auto()


@dataclass
class HostConfig:
    """Section 7.1. Times are in nanoseconds; no gap: `NEVER`."""

    framing: Json = field(default_factory=dict)
    baud: int = 38400
    mode: int = 23
    limits: Json = field(default_factory=lambda: {"velocity": VELOCITY, "acceleration": ACCELERATION})
    subroutine: bool = False
    policy: str = "accept"
    repeats: int = 2
    silence_cycles: int = 4
    gap: int = 4 * MS
    target_timeout: int = 200 * MS
    reserve: int = 1 * MS
    max_delay: int = 10 * MS

    def __post_init__(self) -> None:
        shortest = shortest_window(self.mode, codec.Framing(**self.framing), self.baud)
        if self.mode > 31 or self.silence_cycles < 2 or shortest < self.reserve:
            raise ValueError("no mode, silence_cycles below 2, or a window that does not hold a reply")  # AL-42

    @property
    def is_cumulative(self) -> bool:
        return bool(self.mode & 1)

    @property
    def window(self) -> int:
        return window(self.mode)

    @property
    def is_in_time(self) -> bool:
        """No reply comes in the window of another message."""
        return self.max_delay < CYCLE - self.window

    def span(self, length: int) -> int:
        return span(length, self.baud)


@dataclass
class Due:
    """An answer that is due: when the message came, by when the answer must have begun and ended, and what the message says."""

    arrival: int
    begin_by: int
    end_by: int
    is_interrupted: bool = False


class Host(Line):
    """One serial line to a controller."""

    def __init__(self, config: HostConfig | None = None) -> None:
        self.config = config or HostConfig()
        super().__init__("robot", self.config.framing, self.config.gap)
        self.policy, self.subroutine = self.config.policy, self.config.subroutine
        self.phase = Phase.DISCONNECTED
        self.due: Due | None = None
        self.asked = self.forget_at = 0
        self.names_mode = False
        self.lost_at = 0
        self.zeros_sent = False
        self.restart()

    def restart(self) -> None:
        """ALTER begins at rest (AL-51)."""
        self.limiter = Limiter(*([min(limit, HIGHEST) for limit in self.config.limits[name]] for name in ("velocity", "acceleration")))
        self.target = [0] * AXES
        self.fresh_until: int | None = None
        self.kept: set[int] = set()
        self.sent: set[int] = set()
        self.pending: tuple[int, Sent] | None = None
        self.follows_until = self.unread_until = 0
        self.settles_at = 0  # where replies may be late

    # What becomes of an exception (section 7.6)

    def settle_exception(self, outcome: str | Json) -> None:
        if self.pending is not None:
            self.settle("exception", exception=self.pending[0], outcome=outcome)
            self.pending = None

    def end_exception(self) -> None:
        """ALTER has ended, or the connection."""
        if self.pending is not None and self.pending[1] is Sent.UNSENT:
            self.settle_exception("not_done")
        else:
            self.settle_exception({"unknown": "ended"})

    def judge_exception(self, now: int, message: Json) -> None:
        """A standard message has come."""
        if self.pending is None or self.pending[1] is Sent.UNSENT:
            return
        code, sent = self.pending
        follows = now < (self.unread_until if sent is Sent.UNREAD else self.follows_until)
        if not self.config.is_in_time:
            self.settle_exception({"unknown": "out_of_sequence"})
        elif sent is Sent.SENT and message["error"] == 0:
            self.settle_exception("done")
        elif message["phase"] == "interrupted":
            self.settle_exception({"unknown": "unclear"})
        elif sent is Sent.SENT:
            self.pending = (code, Sent.UNREAD)
            self.unread_until = self.follows_from(now) if follows else 0
        elif not follows:
            self.settle_exception({"unknown": "out_of_sequence"})
        elif self.phase is Phase.STOPPING:
            self.settle_exception("not_done")
        else:
            self.pending = (code, Sent.UNSENT)

    def follows_from(self, arrival: int) -> int:
        """AL-68"""
        return after(arrival, 2 * CYCLE) - self.config.max_delay

    # Inputs

    def leave(self, reason: str, phase: Phase) -> None:
        """An ALTER is lost."""
        self.end_exception()
        if self.phase in ALTERING and not (self.phase is Phase.ACCEPTED and reason == "restart"):
            self.settle("lost", reason=reason)
        self.phase = phase
        self.due = None

    def connected(self, now: int) -> None:
        self.leave("disconnected", Phase.IDLE)
        self.frames.clear()
        self.gap_at = None

    def disconnected(self, now: int) -> None:
        self.leave("disconnected", Phase.DISCONNECTED)
        self.gap_at = None

    def is_open(self) -> bool:
        return self.phase is not Phase.DISCONNECTED

    def on_error(self, now: int, item: Item) -> None:
        if item.error is not None and item.error["kind"] == "start_mark":
            self.lose_sequence()
        super().on_error(now, item)

    def lose_sequence(self) -> None:
        """AL-68, AL-95: a message may have been among the bytes."""
        self.follows_until = self.unread_until = 0
        if not self.config.is_in_time:
            self.sent |= self.kept

    def on_failure(self, now: int, kind: str) -> None:
        """AL-47, AL-68"""
        self.lose_sequence()
        if self.phase not in (Phase.IDLE, Phase.REPEATING) or self.due is not None or self.policy != "accept":
            return
        self.asked = self.asked + 1 if self.phase is Phase.REPEATING else 1
        self.phase = Phase.REPEATING
        self.due = self.start_due(now)
        self.forget_at = after(now, CYCLE * self.config.silence_cycles)

    def on_frame(self, now: int, item: Item, message: Json) -> None:
        kind = message["kind"]
        if kind == "start":
            if self.due is not None:
                self.miss()
            self.leave("restart", Phase.STARTING)
            self.names_mode = message["mode"] == self.config.mode
            self.due = self.start_due(now)
        elif kind == "motion":
            self.take_motion(now, message, item.length)
        elif self.phase in ALTERING:
            self.end_exception()
            self.phase, self.due = Phase.IDLE, None
            self.settle(kind, message=message)
            return
        else:
            self.phase, self.due = Phase.IDLE, None
        self.report(kind, message=message)

    def start_due(self, now: int) -> Due:
        """AL-60: no rate of AL-42 makes an answer longer than its window."""
        end_by = after(now, self.config.window)
        return Due(now, end_by - self.config.span(self.framing.leading_dle + 5), end_by)

    def take_motion(self, now: int, message: Json, length: int) -> None:
        """Section 7.4"""
        if self.phase not in ALTERING:
            return
        lost_at = after(now, CYCLE * self.config.silence_cycles)
        is_early = after(lost_at, self.config.max_delay) < after(self.lost_at, CYCLE)
        self.lost_at = lost_at
        if self.phase is Phase.SILENT:
            return
        if self.due is not None:
            self.miss()
        if is_early and self.phase in REPLYING:
            self.report("delayed")  # AL-93
        code = message["error"]
        if code > 0:
            self.report("rejected", error=code)
            if self.config.is_in_time and now < self.follows_until:  # AL-94
                self.limiter.rejected()
            else:
                self.limiter.missed()
        if self.config.is_in_time:
            self.kept = self.kept | self.sent if code > 0 else set(self.sent)  # AL-64
            self.sent = set(self.kept)
        else:
            self.keep_late(now, message)
        self.judge_exception(now, message)
        if self.phase is Phase.STOPPING:
            if code == 0 and self.zeros_sent and not self.kept:
                self.settle("stopped")
                self.phase = Phase.SILENT
                return
            self.zeros_sent = False
        else:
            self.phase = Phase.RUNNING if message["phase"] == "running" else Phase.INTERRUPTED
        end_by = after(now, min(self.config.window, max(CYCLE - self.config.span(length), 0)))  # AL-61
        shortest = self.config.span(self.framing.leading_dle + 6 + 2 * len(self.kept))
        is_interrupted = message["phase"] == "interrupted"
        self.due = Due(now, max(end_by - shortest, now + 1), end_by, is_interrupted)

    def keep_late(self, now: int, message: Json) -> None:
        """AL-95"""
        self.kept |= self.sent
        if message["phase"] == "interrupted" or self.phase is Phase.INTERRUPTED:
            self.sent = set(self.kept)
        elif message["error"] == 0 and now >= self.settles_at:
            self.kept, self.sent = self.sent, set()
            self.settles_at = self.settles_from(now)

    def settles_from(self, now: int) -> int:
        """AL-95"""
        late = min(self.config.max_delay, CYCLE * self.config.silence_cycles)
        return after(now, 2 * (late + CYCLE))

    def miss(self) -> None:
        """An answer was not sent in time."""
        self.report("missed")
        self.due = None
        self.limiter.missed()

    def timeout(self, now: int) -> None:
        self.end_gap(now)
        if self.due is not None and now >= self.due.begin_by:
            self.miss()
            if self.phase is Phase.STARTING:
                self.phase = Phase.IDLE
        if self.phase in TARGETED and self.fresh_until is not None and now >= self.fresh_until:
            self.fresh_until = None
            self.report("target_stale")
        if self.phase is Phase.REPEATING and now >= self.forget_at:
            self.phase, self.due = Phase.IDLE, None
        if self.phase in ALTERING and now >= self.lost_at:
            self.leave("silence", Phase.IDLE)

    def set_target(self, target: list[int]) -> None:
        """How the arm is to move from now on, for `target_timeout`; the next ALTER forgets it (AL-51)."""
        self.target = target
        self.fresh_until = after(self.now, self.config.target_timeout)

    def clear_target(self) -> None:
        """There is no target any more: the arm brakes."""
        self.fresh_until = None

    def set_policy(self, policy: str) -> None:
        """What a start is answered with: `accept`, `refuse`, or `ignore`."""
        self.policy = policy

    def set_subroutine(self, installed: bool) -> None:
        """Whether the controller has a subroutine for exceptions."""
        self.subroutine = installed

    def exception(self, code: int) -> None:
        """The next reply has this exception (AL-66); raises NotTaken."""
        if not self.subroutine:
            raise NotTaken("no_subroutine")
        if self.phase is not Phase.RUNNING:
            raise NotTaken("not_running")
        if self.pending is not None:
            raise NotTaken("exception_pending")
        if not self.has_room(OUTCOMES + 1):
            raise NotTaken("events_full")
        self.pending = (code, Sent.UNSENT)

    def stop(self) -> None:
        self.policy = "ignore"
        if self.pending is not None and self.pending[1] is Sent.UNSENT:
            self.settle_exception("not_done")
        if self.phase in (Phase.REPEATING, Phase.STARTING):
            self.phase, self.due = Phase.IDLE, None
        elif self.phase is Phase.ACCEPTED:
            self.phase = Phase.SILENT
            self.settle("stopped")
        elif self.phase in (Phase.RUNNING, Phase.INTERRUPTED):
            self.phase = Phase.STOPPING
            self.zeros_sent = False

    # Answers

    def transmit(self, now: int) -> bytes | None:
        if self.due is None:
            return None
        due = self.due
        if self.phase in REPLYING:
            return self.transmit_reply(now, due)
        reply = self.start_reply()
        frame = self.encode({"kind": "start_reply", "reply": reply}) if reply else b""
        if frame and after(now, self.config.span(len(frame))) > due.end_by:  # AL-46
            due.begin_by = now
            return None
        self.due = None
        if reply == "accept":
            self.phase = Phase.ACCEPTED
            self.lost_at = after(now, CYCLE * self.config.silence_cycles)
            self.restart()
            self.settles_at = self.settles_from(now)
        elif reply != "repeat":
            self.phase = Phase.IDLE
        return frame or None

    def start_reply(self) -> str | None:
        """AL-44, AL-45, AL-48"""
        if self.policy == "ignore":
            return None
        if self.phase is Phase.REPEATING:
            return "repeat" if self.asked <= self.config.repeats and self.policy == "accept" else "refuse"
        if self.policy == "refuse" or not self.names_mode:
            return "refuse"
        return "accept" if self.has_room(OUTCOMES) else None

    def encode(self, message: Json) -> bytes:
        return codec.encode(message, "host", self.config.framing)

    def transmit_reply(self, now: int, due: Due) -> bytes | None:
        """AL-63 to AL-65"""
        limiter = self.limiter.copy()
        values = self.next_values(now, limiter)  # those of `limiter` change only if the reply is sent
        code = 0
        if self.pending is not None and self.pending[1] is Sent.UNSENT and self.phase is Phase.RUNNING:
            code = self.pending[0]

        def frame(axes: set[int]) -> bytes:
            chosen = [values[axis] if axis in axes else None for axis in range(AXES)]
            return self.encode({"kind": "reply", "exception": code, "values": chosen})

        def fits(axes: set[int], reserve: int) -> bool:
            return after(now, self.config.span(len(frame(axes))) + reserve) <= due.end_by

        axes = set(range(AXES))
        if not fits(axes, self.config.reserve):
            axes = set(self.kept)
            if not fits(axes, 0):
                due.begin_by = now
                return None
            for axis in range(AXES):
                if values[axis] != 0 and fits(axes | {axis}, self.config.reserve):
                    axes.add(axis)
            for axis in set(range(AXES)) - axes:
                limiter.hold(axis)
        self.limiter = limiter
        moved = {axis for axis in axes if values[axis] != 0}
        is_unread = self.pending is not None and self.pending[1] is Sent.UNREAD
        if due.is_interrupted or is_unread:
            self.kept |= moved
            moved = self.kept
        self.sent = set(moved) if self.config.is_in_time else self.sent | moved
        self.follows_until = self.follows_from(due.arrival)
        if code:
            self.pending = (code, Sent.SENT)
        self.due = None
        self.zeros_sent = not any(values[axis] for axis in axes) and limiter.is_at_rest()
        return frame(axes)

    def next_values(self, now: int, limiter: Limiter) -> list[int]:
        """AL-86"""
        if self.phase is Phase.INTERRUPTED:
            limiter.missed()
        is_fresh = self.phase is Phase.RUNNING and self.fresh_until is not None and now < self.fresh_until
        if self.config.is_cumulative:
            return limiter.speeds(self.target if is_fresh else [0] * AXES)
        if self.phase is Phase.STOPPING:
            return limiter.positions([0] * AXES)
        return limiter.positions(self.target if is_fresh else None)

    def deadline(self) -> int | None:
        times = [self.gap_at]
        if self.due is not None:
            times.append(self.due.begin_by)
        if self.phase is Phase.REPEATING:
            times.append(self.forget_at)
        if self.phase in ALTERING:
            times.append(self.lost_at)
        if self.phase in TARGETED:
            times.append(self.fresh_until)
        return earliest(*times)
