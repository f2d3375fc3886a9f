"""The PC of kawasaki-msg (section 9 of reference/kawasaki-msg.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from ..session import SECOND, NotTaken, after
from ..stream import Item, Json
from .config import NEVER, TAKEOVERS, PcConfig
from .dialect import COMMAND, Packet, phase_name
from .end import End
from .job import Unfit

COMMANDS = 4  # in flight and waiting
ROOM = 6  # outcomes (KM-120)
LATEST_DATAGRAM = SECOND  # KM-9
CANCELLED = 2 * SECOND  # KM-93
ACTIVE = 2  # a phase other than this is begun (KM-107)


class Stage(Enum):
    """Section 9.1: Unsent to Foreign are an order that starts, Active to Interrupted one that runs."""

    IDLE = auto()
    UNSENT = auto()
    LOST = auto()
    SENT = auto()
    FOREIGN = auto()
    ACTIVE = auto()
    ENDING = auto()
    INTERRUPTED = auto()


STARTING = (Stage.UNSENT, Stage.LOST, Stage.SENT, Stage.FOREIGN)
RUNNING = (Stage.ACTIVE, Stage.ENDING, Stage.INTERRUPTED)
PHASES = {Stage.IDLE: 0, Stage.ACTIVE: ACTIVE, Stage.ENDING: 3, Stage.INTERRUPTED: 4}


@dataclass
class Command:
    """A command that waits, or is in flight."""

    ident: int
    value: int
    is_in_flight: bool = False


class Pc(End):
    """Gives a robot the jobs of an order, one order after the other."""

    OUTCOMES = frozenset({"order_over", "outcome_unknown", "job_unfit", "command"})  # and an order that is given up

    def __init__(self, config: PcConfig | None = None) -> None:
        self.config = config = config or PcConfig()
        super().__init__(config.dialect, config.max_number, config.datagrams)
        window = self.numbering.largest // 2 if config.datagrams else self.numbering.largest - 1
        self.window = window if config.cumulative_acks else min(window, 1024)  # KM-95
        self.is_up = False
        self.silent_at: int
        self.reply_at: int | None = None  # Due
        self.is_receiving: bool
        self.asks_status: bool
        self.jobs_from: int | None
        self.robot: int | None = None  # the order that it said it is in
        self.commands: list[Command] = []
        self.number = 0
        self.stage = Stage.IDLE
        self.begin([], False)

    def begin(self, jobs: Sequence[Json], is_open: bool) -> None:
        """The counts of a new order."""
        self.forget("progress")
        self.jobs, self.is_open = list(jobs), is_open
        self.executed = self.queued = self.sent = 0
        self.total: int | None = None
        self.ahead: set[int] = set()  # numbers
        self.is_unsure = self.is_cancelled = False
        self.refusals = self.foreign = 0
        self.answer_by: int | None
        self.left_at: int | None = None

    # What the owner asks

    def start(self, order: int, jobs: Sequence[Json], open: bool = False) -> None:
        """An order of these jobs; `open`: more may come. Raises NotTaken (KM-112)."""
        self.check_start(order)
        self.begin(jobs, open)
        self.number, self.foreign = order, order
        self.stage = Stage.FOREIGN if self.robot == order else Stage.UNSENT

    def resume(
        self, order: int, jobs: Sequence[Json], executed: int, sent: int, ahead: Sequence[int] = (), open: bool = False
    ) -> None:
        """Goes on with an order of before; `ahead` are places, counted from 0. Raises NotTaken (KM-128)."""
        self.check_start(order)
        if not 0 <= sent - executed <= self.window:
            raise NotTaken("not_in_flight")
        if len(jobs) < sent and not open:
            raise NotTaken("fewer_jobs")
        self.begin(jobs, open)
        self.number, self.stage = order, Stage.ACTIVE
        self.executed = self.queued = executed
        self.sent = sent
        self.total = sent if len(jobs) <= sent and not open else None
        if not self.config.cumulative_acks:
            self.ahead = {self.numbering.number(place + 1) for place in ahead if executed <= place < sent}
        self.is_unsure = True

    def check_start(self, order: int) -> None:
        if order == 0:
            raise NotTaken("order_zero")
        if not self.has_room(ROOM):
            raise NotTaken("too_many_events")
        if self.stage is not Stage.IDLE:
            raise NotTaken("order_active")

    def add(self, jobs: Sequence[Json]) -> None:
        """More jobs of an order that is open."""
        self.jobs += jobs

    def close(self) -> None:
        """No more jobs come."""
        self.is_open = False

    def end(self) -> None:
        """No job is sent any more; raises NotTaken (KM-113)."""
        if self.stage is not Stage.ACTIVE:
            raise NotTaken("no_order")
        self.stage = Stage.ENDING

    def interrupt(self) -> None:
        """The order is broken off; raises NotTaken (KM-114)."""
        if self.stage in (Stage.IDLE, Stage.INTERRUPTED) or self.is_cancelled:
            raise NotTaken("no_order")
        if "order_interrupt" not in self.dialect.entries:
            raise NotTaken("lacks")
        if self.stage in (Stage.UNSENT, Stage.FOREIGN):
            self.over()
        elif self.stage in STARTING:
            self.is_cancelled = True
        else:
            self.stage = Stage.INTERRUPTED

    def command(self, id: int, value: int) -> None:
        """A command of the application's own; raises NotTaken (KM-98)."""
        if f"{COMMAND}{id}" not in self.dialect.entries:
            raise NotTaken("unknown_command")
        if len(self.commands) >= COMMANDS or not self.has_room(ROOM):
            raise NotTaken("too_many_commands")
        self.commands.append(Command(id, value))

    # Connections

    def is_connected(self) -> bool:
        return self.is_up

    def connected(self, now: int) -> None:
        """KM-86"""
        self.lose()
        self.clear()
        self.is_up = True
        self.silent_at = after(now, self.config.silence)

    def disconnected(self, now: int) -> None:
        self.lose()

    def lose(self) -> None:
        self.forget("disconnect")
        self.is_up = self.is_receiving = self.asks_status = False
        self.reply_at = self.jobs_from = self.robot = None
        if self.stage is Stage.SENT:
            self.stage = Stage.LOST
        self.settle_commands("unknown")

    def settle_commands(self, outcome: str) -> None:
        """KM-98"""
        for command in [command for command in self.commands if command.is_in_flight]:
            self.commands.remove(command)
            self.report("command", id=command.ident, value=command.value, outcome=outcome)

    # What comes

    def all_read(self, now: int, is_half: bool) -> None:
        """KM-89"""
        if self.reply_at is None and not self.is_receiving:
            return
        self.is_receiving = is_half
        self.reply_at = None if is_half else after(now, self.config.reply_delay)

    def on_any(self, now: int) -> None:
        self.silent_at = after(now, self.config.silence)
        self.is_receiving, self.reply_at = True, None
        self.settle_commands("transmitted")

    def on_error(self, now: int, item: Item) -> None:
        super().on_error(now, item)
        self.doubt()

    def on_wrong(self, now: int, error: Json) -> None:
        self.report("rejected", error=error)
        self.doubt()

    def doubt(self) -> None:
        """KM-110"""
        self.is_unsure |= self.stage in RUNNING

    def on_message(self, now: int, found: Json) -> None:
        role = found["role"]
        if self.dialect.entries[role].sender == "pc":
            self.not_expected(role)
            return
        named = found.get("order", self.number)
        before = (self.executed, self.queued)
        if role == "status":
            self.status(now, named, found)
        elif role == "order_ack":
            self.order_ack(named)
        elif role == "end_ack":
            self.end_ack(found)
        elif role != "filler":
            self.of_order(role, named, found)
        if before != (self.executed, self.queued):
            self.report("progress", executed=self.executed, queued=self.queued)

    def of_order(self, role: str, named: int, found: Json) -> None:
        """Acknowledgements of jobs, pauses and requests (KM-117)."""
        is_start_request = role == "job_request" and self.stage in STARTING
        if is_start_request:
            return
        if self.stage not in RUNNING or named != self.number:
            self.reject("wrong_order", active=self.number, found=named)
            return
        self.left_at = None
        if role == "job_ack":
            self.job_ack(found["number"])
        elif role == "pause":
            self.pause(found)
        elif self.stage is Stage.ACTIVE:
            self.request(found["number"])

    def count_of(self, number: int) -> int | None:
        """The count of a number of the robot's; None: it means nothing (KM-99)."""
        count = self.numbering.count(self.executed, number)
        return count if number <= self.numbering.largest and count <= self.sent else None

    def means_nothing(self, number: int, count: int) -> None:
        """`count` is of the job before the one that is expected."""
        self.reject("out_of_order", expected=self.numbering.number(count + 1), found=number)

    def set_executed(self, count: int) -> None:
        """All up to this count are executed, and those that were ahead behind it."""
        while self.executed < count or self.numbering.number(self.executed + 1) in self.ahead:
            self.executed += 1
            self.ahead.discard(self.numbering.number(self.executed))
        self.queued = max(self.queued, self.executed)

    def job_ack(self, number: int) -> None:
        """KM-100"""
        count = self.count_of(number)
        if count is None:
            self.means_nothing(number, self.executed)
        elif self.config.cumulative_acks or count <= self.executed + 1:
            self.set_executed(count)
        elif number not in self.ahead:
            self.ahead.add(number)
            self.report("executed_ahead", index=count - 1)

    def request(self, number: int) -> None:
        """KM-101"""
        largest = self.numbering.largest
        begin = self.executed + (self.numbering.ahead(self.executed, number) - 1) % largest
        if number <= largest and begin <= self.sent:
            self.queued = self.jobs_from = begin
        elif self.sent == 0:
            self.refusals = 0
            self.refused(self.number)
        else:
            self.means_nothing(number, self.sent)

    def pause(self, found: Json) -> None:
        """KM-102"""
        self.queue(found.get("queued"))
        self.report("paused", queued=self.queued)

    def queue(self, number: int | None) -> None:
        """The number of the job that is queued last, if it means something; None: none is."""
        count = self.executed if number is None else self.count_of(number)
        self.queued = self.queued if count is None else count

    def order_ack(self, named: int) -> None:
        """KM-103"""
        if self.stage is not Stage.SENT:
            return
        if named == self.number:
            self.accepted()
        else:
            self.refused(named)

    def accepted(self) -> None:
        """KM-104"""
        self.stage = Stage.INTERRUPTED if self.is_cancelled else Stage.ACTIVE
        self.report("order_started", order=self.number)

    def refused(self, by: int) -> None:
        """KM-105"""
        if self.is_cancelled:
            self.over()
            return
        if by == 0:
            self.refusals += 1
            self.stage = Stage.UNSENT
            gives_up = self.refusals > self.config.start_retries
        else:
            self.stage, self.foreign = Stage.FOREIGN, by
            gives_up = self.config.takeover == NEVER
        number = self.number
        if gives_up:
            self.stage, self.number = Stage.IDLE, 0
        self.report("order_refused", order=number, active=by, given_up=gives_up)

    def end_ack(self, found: Json) -> None:
        """KM-106"""
        active = self.robot = found.get("order", 0)
        if self.stage is Stage.FOREIGN and active != self.foreign:
            self.stage = Stage.UNSENT
        elif self.stage in RUNNING and found["ended"] == self.number and active != self.number:
            if self.takes_executed(found["executed"]):
                self.over()

    def takes_executed(self, number: int | None) -> bool:
        """Whether the number of the job that is executed last means something; it counts then."""
        if number is None:
            return True
        count = self.count_of(number)
        if count is None:
            self.means_nothing(number, self.executed)
            return False
        self.set_executed(count)
        return True

    def status(self, now: int, named: int, found: Json) -> None:
        """KM-107 to KM-109"""
        self.robot, self.asks_status = named, True
        phase = found.get("phase", 0)
        shown = {"queued": found["queued"], "executed": found["executed"]}
        self.report("peer_status", order=named, phase=phase_name(phase), **shown)
        if self.stage in STARTING:
            is_begun = found["queued"] is not None or found["executed"] is not None or phase != ACTIVE
            self.status_of_start(named, is_begun)
        elif self.stage in RUNNING and named == self.number:
            self.left_at = None
            if self.takes_executed(found["executed"]):
                self.queue(found["queued"])
        elif self.stage in RUNNING:
            self.left(now, named, found)

    def status_of_start(self, named: int, is_begun: bool) -> None:
        """KM-107"""
        if self.stage is Stage.FOREIGN:
            if named != self.foreign:
                self.stage = Stage.UNSENT
            elif self.config.takeover == NEVER:
                self.refused(named)
        elif named == self.number and (is_begun or self.stage is Stage.UNSENT):
            self.refused(named)
        elif named == self.number:
            self.accepted()
        elif self.stage is Stage.LOST and self.is_cancelled:
            self.over()
        elif self.stage is Stage.LOST:
            self.stage = Stage.UNSENT

    def left(self, now: int, named: int, found: Json) -> None:
        """The robot has left our order (KM-109)."""
        if self.datagrams:
            if self.left_at is None:
                self.left_at = now
            if now < after(self.left_at, LATEST_DATAGRAM):
                return
        number = found["executed"]
        count = self.executed if number is None else self.count_of(number)
        if found.get("ended", 0) == self.number and named == 0 and count is not None:
            self.set_executed(count)
            self.over()
        elif self.executed == self.sent:
            self.over()
        else:
            self.lose_outcome()

    def over(self) -> None:
        """KM-110"""
        is_doubtful = not self.config.cumulative_acks and (self.is_unsure or self.datagrams)
        if is_doubtful and self.executed < self.sent:
            self.lose_outcome()
            return
        complete = self.stage in RUNNING and self.executed == self.total
        number, self.number, self.stage = self.number, 0, Stage.IDLE
        self.report("order_over", order=number, executed=self.executed, complete=complete)

    def lose_outcome(self) -> None:
        number, self.number, self.stage = self.number, 0, Stage.IDLE
        self.report("outcome_unknown", order=number, executed=self.executed, sent=self.sent)

    # Times

    def timeout(self, now: int) -> None:
        """KM-87, KM-88"""
        if not self.is_up:
            return
        if self.stage is Stage.SENT and self.answer_by is not None and now >= self.answer_by:
            self.answer_by = None
            if self.datagrams:
                self.stage = Stage.LOST
            else:
                self.report("disconnect")
        if now >= self.silent_at:
            self.silent_at = after(now, self.config.silence)
            self.report("disconnect")

    # Answers

    def transmit(self, now: int) -> bytes | None:
        """KM-92"""
        if self.reply_at is None or now < self.reply_at:
            return None
        is_done = self.executed == self.sent and not self.is_open and len(self.jobs) <= self.sent
        if self.stage is Stage.ACTIVE and self.config.end_when_done and is_done:  # KM-94
            self.stage, self.total = Stage.ENDING, self.sent
        packet = Packet(self.dialect, self.config.limits.packet)
        if self.asks_status:
            phase = 1 if self.stage in STARTING else PHASES[self.stage]
            sent, executed = (self.numbering.or_empty(count) for count in (self.sent, self.executed))
            packet.add("status", order=self.number, phase=phase, queued=sent, executed=executed, ended=None)
        self.add_order(now, packet)
        for command in self.commands:
            if not packet.add(f"{COMMAND}{command.ident}", order=self.number, value=command.value):
                break
            command.is_in_flight = True
        if self.stage is Stage.ACTIVE and self.jobs_from is not None:
            self.add_jobs(packet, max(self.jobs_from, self.executed))
        self.asks_status, self.jobs_from, self.reply_at = False, None, None
        return packet.finish()

    def add_order(self, now: int, packet: Packet) -> None:
        """KM-93"""
        if self.stage in (Stage.ENDING, Stage.INTERRUPTED):
            packet.add("order_end" if self.stage is Stage.ENDING else "order_interrupt", order=self.number)
        elif self.is_cancelled:
            if self.datagrams:
                limit = after(now, CANCELLED)
                self.answer_by = limit if self.answer_by is None else min(self.answer_by, limit)
        elif self.stage is Stage.FOREIGN:
            if self.config.takeover != NEVER:
                packet.add(TAKEOVERS[self.config.takeover], order=self.foreign)
        elif self.stage in STARTING and self.robot is not None and (self.stage is not Stage.SENT or self.datagrams):
            if packet.add("order_start", order=self.number, number=1):
                self.stage = Stage.SENT
                self.answer_by = None if self.datagrams else after(now, self.config.silence)

    def add_jobs(self, packet: Packet, begin: int) -> None:
        """KM-95, KM-97"""
        count = begin
        while count < self.executed + self.window:
            if count >= len(self.jobs):
                if not self.is_open:
                    self.total = len(self.jobs)
                break
            number = self.numbering.number(count + 1)
            try:
                if not packet.add("job", order=self.number, number=number, job=self.jobs[count]):
                    break
            except Unfit as unfit:
                self.report("job_unfit", order=self.number, index=count, error=unfit.error)
                self.stage = Stage.ENDING
                break
            count += 1
            self.sent = max(self.sent, count)

    def deadline(self) -> int | None:
        """KM-119"""
        if not self.is_up:
            return None
        answer_by = self.answer_by if self.stage is Stage.SENT else None
        return min(time for time in (self.silent_at, self.reply_at, answer_by) if time is not None)
