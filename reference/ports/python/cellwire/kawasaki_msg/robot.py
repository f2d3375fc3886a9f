"""The robot of kawasaki-msg (section 8 of reference/kawasaki-msg.md): connection, cycle, packets."""

from dataclasses import dataclass
from enum import Enum, auto

from ..session import MS, NEVER, SECOND, NotTaken, after
from ..stream import Item, Json
from .config import INDIVIDUAL, RobotConfig
from .dialect import Packet, phase_name
from .end import End
from .job import Wrong
from .order import Acks, Flow, Gap, Order, Stage
from .queue import Queue

READ_ON = 2 * MS  # KM-50
LATEST_DATAGRAM = SECOND  # KM-9
ENDED_ORDERS = 16
ROOM_TO_CLEAR, ROOM_TO_START, ROOM_FOR_COMMAND = 5, 10, 11  # outcomes (KM-81)


class Link(Enum):
    """KM-46."""

    DISCONNECTED = auto()
    CONNECTING = auto()
    READY = auto()
    WAITING = auto()


@dataclass
class Replies:
    """What the next packet has to hold."""

    status: bool = False
    pause: bool = False
    start: int | None = None
    end: tuple[int, int | None] | None = None  # the order that ended, and the number of its last executed job


class Robot(End):
    """Asks a PC for jobs, queues them for its motion program, and tells what became of them."""

    CONNECTS = True
    OUTCOMES = frozenset({"order_started", "order_ending", "order_interrupted", "order_over", "alarm", "command"})

    def __init__(self, config: RobotConfig | None = None) -> None:
        self.config = config = config or RobotConfig()
        super().__init__(config.dialect, config.max_number, config.datagrams)
        self.queue = Queue(config.slots)
        self.low_water = config.slots // 2 if config.low_water is None else config.low_water
        self.link = Link.DISCONNECTED
        self.connect_at = self.at = self.overdue_at = self.not_before = self.status_at = 0
        self.answered = self.synced = False
        self.silent = self.unanswered = 0
        self.order = Order(self.numbering, Acks(None if config.acks == INDIVIDUAL else int(config.acks)))
        self.ended: tuple[int, int | None] | None = None
        self.ended_orders: list[int] = []
        self.replies = Replies()
        self.ignored_until = NEVER
        self.was_drained = False
        self.was_changed = False  # the queue, by the motion program, since it was looked at

    # The motion program

    def take(self, number: int | None = None) -> Json:
        """The oldest job, or the one of this number: `order`, `number` and `job`. Raises NotTaken."""
        job = self.queue.take(number)
        return {"order": job.order, "number": job.number, "job": job.job}

    def job_done(self, number: int) -> None:
        """A job was executed; raises NotTaken (KM-69)."""
        if not self.order.job_done(number):
            raise NotTaken("not_queued")

    def complete(self) -> None:
        """The slot of the job that was taken is free; raises NotTaken."""
        self.queue.complete()
        self.was_changed = True

    def clear_queue(self) -> None:
        """Clears the list; raises NotTaken (KM-71)."""
        if not self.has_room(ROOM_TO_CLEAR):
            raise NotTaken("too_many_events")
        if self.order.stage not in (Stage.INTAKE, Stage.ALARM):
            raise NotTaken("no_order")
        self.replies.status |= self.order.stage is Stage.ALARM
        self.clear_list(0)

    def reset_order(self) -> None:
        """Forgets the order; raises NotTaken (KM-71)."""
        if self.order.stage in (Stage.IDLE, Stage.INTERRUPTED):
            raise NotTaken("no_order")
        self.interrupt()

    def abandon(self) -> None:
        """The motion program is gone."""
        self.queue.is_abandoned = True
        self.was_changed = True

    # Connections

    def is_connected(self) -> bool:
        return self.link in (Link.READY, Link.WAITING)

    def connected(self, now: int) -> None:
        """KM-49"""
        self.clear()
        self.forget("connect", "disconnect")
        self.link, self.at, self.overdue_at = Link.READY, now, now
        self.silent, self.unanswered, self.synced = 0, 0, False
        self.replies.status, self.replies.start = True, None
        order = self.order
        order.acks.connected(order.executed)
        if order.flow is Flow.HELD and now >= order.held_until:
            order.flow = Flow.ASKING
        order.gap = Gap.REST
        if self.ignored_until == NEVER:
            self.ignored_until = after(now, LATEST_DATAGRAM)

    def disconnected(self, now: int) -> None:
        """KM-48, KM-74"""
        if self.link is Link.DISCONNECTED:
            return
        was_connected = self.is_connected()
        self.forget("connect", "disconnect")
        self.link, self.connect_at = Link.DISCONNECTED, after(now, self.config.reconnect_delay)
        if was_connected and self.order.stage is Stage.INTAKE and self.order.is_done():
            self.recover(now)

    def all_read(self, now: int, is_half: bool) -> None:
        """KM-50"""
        soon = after(now, READ_ON)
        if self.link is Link.WAITING and self.answered and not is_half:
            self.link = Link.READY
            self.at = max(self.not_before, min(soon, max(now, self.overdue_at)))
            self.silent, self.synced = 0, True
        elif not is_half:
            self.at = max(self.at, min(soon, self.overdue_at))
        elif self.link is Link.READY and now < self.overdue_at:
            self.link, self.not_before = Link.WAITING, self.at

    # Messages

    def on_any(self, now: int) -> None:
        self.answered = True

    def on_error(self, now: int, item: Item) -> None:
        self.answered = True
        self.fail()
        super().on_error(now, item)

    def on_wrong(self, now: int, error: Json) -> None:
        was_resting = self.order.stage is Stage.INTAKE and self.order.gap is Gap.REST
        self.fail()
        if not was_resting:
            self.report("rejected", error=error)

    def fail(self) -> None:
        """KM-65"""
        self.order.gap = Gap.REST

    def on_message(self, now: int, found: Json) -> None:
        role, order = found["role"], self.order
        entry = self.dialect.entries[role]
        named = found.get("order", order.number)
        if entry.sender == "robot":
            self.not_expected(role)
        elif role == "order_start":
            self.start(now, named, found.get("number", 1))
        elif role in ("order_end", "order_interrupt"):
            if order.stage is Stage.IDLE or named != order.number:
                self.answer_end(named)
            elif role == "order_end":
                self.end()
            elif order.stage is not Stage.INTERRUPTED:
                self.interrupt()
        elif role == "job":
            self.job(named, found)
        elif role == "status":
            self.status(named, found)
        elif role != "filler" and not self.has_room(ROOM_FOR_COMMAND):
            self.not_expected(role)
        elif role != "filler":
            command = int(role.removeprefix("command_"))
            self.report("command", id=command, value=found.get("value"))

    def status(self, named: int, found: Json) -> None:
        """KM-62"""
        phase = phase_name(found.get("phase", 0))
        self.report("peer_status", order=named, phase=phase, sent=found["queued"], executed=found["executed"])
        order = self.order
        is_foreign = named != order.number and order.stage not in (Stage.IDLE, Stage.INTERRUPTED)
        if self.config.end_foreign_order and is_foreign:
            self.interrupt()

    def start(self, now: int, named: int, number: int) -> None:
        """KM-56, KM-57, KM-63"""
        if self.config.datagrams:
            if now < self.ignored_until:
                return
            if not self.was_drained:
                self.was_drained, self.ignored_until = True, after(now, self.config.exchange)
                return
        self.replies.status = True
        order = self.order
        if order.stage is not Stage.IDLE:
            is_repeated = named == order.number
            if is_repeated and order.queued == 0 and number == 1:
                self.replies.start = named
                return
            self.replies.start = 0 if is_repeated and self.config.refuse_repeated_start else order.number
            self.report("order_refused", order=named, active=order.number)
        elif named and number != 1:
            self.replies.start = 0
            place = self.dialect.place("order_start", "number")
            self.reject("out_of_range", field=place, found=number, min=1, max=1)
        elif not named or not self.can_execute() or self.config.datagrams and named in self.ended_orders:
            self.replies.start = 0
            self.report("order_refused", order=named, active=0)
        else:
            order.begin(named)
            self.replies.start = named
            self.report("order_started", order=named)

    def can_execute(self) -> bool:
        return not self.queue.is_abandoned and self.has_room(ROOM_TO_START)

    def answer_end(self, named: int) -> None:
        """KM-60"""
        if self.ended is not None and named == self.ended[0]:
            self.replies.end = self.ended
        else:
            self.replies.status = True

    def end(self) -> None:
        """KM-58, KM-66"""
        order = self.order
        is_missing = order.stage is Stage.INTAKE and order.gap in (Gap.ASKED, Gap.END_ONCE)
        if order.stage is Stage.CLEARING or is_missing:
            if is_missing and self.unanswered:
                self.unanswered -= 1
            else:
                order.gap = Gap.END_ONCE
            self.reject("jobs_missing", order=order.number, expected=order.next_number())
        elif order.stage is Stage.ALARM or order.stage is Stage.INTAKE and order.gap is not Gap.REST:
            order.stage = Stage.ENDING
            self.replies.status = True
            self.report("order_ending", order=order.number)

    def interrupt(self) -> None:
        """KM-59"""
        self.replies.status = True
        self.queue.clear()
        self.order.stage, self.order.reported_at = Stage.INTERRUPTED, None
        self.report("order_interrupted", order=self.order.number)

    def job(self, named: int, found: Json) -> None:
        """KM-64"""
        order, number = self.order, found["number"]
        if order.stage is Stage.INTAKE and order.gap is Gap.REST:
            return
        if named != order.number:
            self.fail()
            self.reject("wrong_order", active=order.number, found=named)
            return
        if order.stage is not Stage.INTAKE:
            self.not_expected("job")
            return
        try:
            job = self.dialect.read_job(found)
        except Wrong as wrong:
            self.fail()
            self.report("rejected", error=wrong.error)
            return
        expected = order.next_number()
        ahead = self.numbering.ahead(order.queued, number)
        if number > self.numbering.largest:
            self.fail()
            place = self.dialect.place("job", "number")
            self.reject("out_of_range", field=place, found=number, min=1, max=self.numbering.largest)
        elif number == expected and order.acks.is_ahead(number):
            order.queue_job()
        elif number == expected and self.queue.is_full():
            self.fail()
            self.reject("queue_full", number=number)
            order.flow, self.replies.pause = Flow.FULL, True
            self.report("queue_full", last=self.numbering.or_empty(order.queued))
        elif number == expected:
            order.queue_job()
            self.queue.add(named, number, job)
        elif 2 <= ahead <= self.numbering.largest // 2:
            self.fail()
            self.reject("out_of_order", expected=expected, found=number)
        else:
            self.reject("repeated", expected=expected, found=number)

    # Times

    def wants_timeout(self) -> bool:
        """KM-72"""
        return self.was_changed

    def timeout(self, now: int) -> None:
        """KM-80"""
        self.was_changed = False
        order = self.order
        if self.link is Link.DISCONNECTED and now >= self.connect_at:
            self.link = Link.CONNECTING
            self.report("connect")
        if order.flow is Flow.HELD and now >= order.held_until:
            order.flow = Flow.ASKING
        if order.stage is Stage.INTAKE and order.waits_until is not None and now >= order.waits_until:
            self.recover(now)
        if self.link is Link.WAITING and now >= self.overdue_at:
            self.link, self.at, self.overdue_at = Link.READY, now, now
            self.silent += 1
            self.unanswered = min(self.unanswered + 1, self.config.silent_cycles or 65535)
            self.report("no_reply")
            if self.config.silent_cycles and self.silent >= self.config.silent_cycles:
                self.report("disconnect")
        self.look(now)

    def recover(self, now: int) -> None:
        """KM-73, KM-74"""
        order = self.order
        order.failures += 1
        order.waits_until = None
        step = self.config.recovery.step(order.failures)
        following = order.next_executed()
        if step == "alarm":
            self.replies.status = True
            order.stage = Stage.ALARM
            self.report("alarm", order=order.number, next=following)
            return
        if step == "pause":
            order.flow, order.held_until = Flow.HELD, after(now, self.config.pause)
            self.replies.pause = True
        elif step == "clear":
            self.clear_list(order.failures)
        self.report("recovery", step=step, next=following)

    def clear_list(self, failures: int) -> None:
        """The list is cleared."""
        self.queue.clear()
        self.order.stage, self.order.failures, self.order.reported_at = Stage.CLEARING, failures, None

    def look(self, now: int) -> None:
        """KM-70, KM-72"""
        order = self.order
        if order.stage in (Stage.CLEARING, Stage.INTERRUPTED) and self.queue.has_settled():
            if order.reported_at is None:
                order.reported_at = after(now, READ_ON)
            elif now >= order.reported_at:
                if order.stage is Stage.INTERRUPTED:
                    self.over()
                else:
                    order.cleared()
                    self.report("queue_cleared", next=order.next_executed())
        elif order.stage is Stage.ENDING and order.is_done():
            self.over()
        elif order.stage is Stage.INTAKE and order.flow is Flow.FULL and len(self.queue) <= self.low_water:
            order.flow = Flow.ASKING
            self.report("queue_drained", next=order.next_number())

    def over(self) -> None:
        """KM-61"""
        order = self.order
        order.stage = Stage.IDLE
        order.queued = order.executed
        order.acks.until = order.executed  # the end says how far
        self.ended = (order.number, self.numbering.or_empty(order.executed))
        self.ended_orders = [*self.ended_orders, order.number][-ENDED_ORDERS:]
        self.replies.status, self.replies.end, self.replies.pause = True, self.ended, False
        self.report("order_over", order=order.number, executed=order.executed)
        order.number = 0

    # Packets

    def transmit(self, now: int) -> bytes | None:
        """KM-52"""
        if self.link is not Link.READY or now < self.at:
            return None
        order, replies = self.order, self.replies
        packet = Packet(self.dialect, self.config.limits.packet)
        asks = order.stage is Stage.INTAKE and order.flow is Flow.ASKING
        status_is_due = replies.status or now >= self.status_at
        is_alone = not (status_is_due or replies.pause or replies.start is not None or asks and self.synced)
        acknowledged = order.number or (self.ended[0] if self.ended else None)
        for number in order.acks.due(order, is_alone):
            if not packet.add("job_ack", order=acknowledged, number=number):
                break
            order.acks.sent(number)
        if replies.start is not None and packet.add("order_ack", order=replies.start):
            replies.start = None
        is_told = order.acks.are_sent()
        queued, executed = (self.numbering.or_empty(count) for count in (order.queued, order.executed))
        if replies.end and is_told:
            ended, last = replies.end
            if packet.add("end_ack", ended=ended, order=order.number, executed=last):
                replies.end = None
        if status_is_due and is_told:
            values = {"phase": order.phase(), "queued": queued, "executed": executed}
            ended_order = self.ended[0] if self.ended else None
            if packet.add("status", order=order.number, **values, ended=ended_order):
                replies.status, self.status_at = False, after(now, self.config.status_period)
        if replies.pause and packet.add("pause", order=order.number, queued=queued):
            replies.pause = False
        if asks and self.synced and packet.add("job_request", order=order.number, number=order.next_number()):
            order.gap = {Gap.REST: Gap.ASKED, Gap.END_ONCE: Gap.ASKED_AGAIN}.get(order.gap, order.gap)
        if asks and order.waits_until is None and order.is_done():
            order.waits_until = after(now, self.config.patience)  # KM-53
        self.link, self.answered = Link.WAITING, False
        self.not_before = after(now, self.config.exchange)
        self.overdue_at = after(now, self.config.reply_timeout)
        return packet.finish()

    def deadline(self) -> int | None:
        """KM-80"""
        order = self.order
        times = [order.reported_at if order.stage in (Stage.CLEARING, Stage.INTERRUPTED) else None]
        if self.link is Link.DISCONNECTED:
            times.append(self.connect_at)
        elif self.link is Link.READY:
            times.append(self.at)
        elif self.link is Link.WAITING:
            times.append(self.overdue_at)
        if self.is_connected() and order.stage is Stage.INTAKE:
            times += [order.waits_until, order.held_until if order.flow is Flow.HELD else None]
        return min((time for time in times if time is not None), default=None)
