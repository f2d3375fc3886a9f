"""The host of laser-eb90 (section 7 of reference/laser-eb90.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any

from ..echo import Echo
from ..session import MS, SECOND, NotTaken, Session, after, span
from ..stream import Item, Json, Refused
from . import codec
from .words import Words, item_of, word_of

ANSWER_LEN = 13  # LE-70
REFERENCE_BAUD = 9600
MAX_BATCH = 255
OUTCOMES = frozenset({"done", "answer", "refused", "unknown"})  # LE-44


class State(Enum):
    """LE-105"""

    DISCONNECTED = auto()
    DISCONNECTED_HELD = auto()
    IDLE = auto()
    AWAITING = auto()
    RESENDING = auto()
    AWAITING_REST = auto()
    HELD = auto()


@dataclass
class HostConfig:
    """LE-107. Times are in nanoseconds; None: the default, which depends on the baud rate (LE-70)."""

    profile: Json = field(default_factory=dict)
    words: Json = field(default_factory=dict)
    baud: int = REFERENCE_BAUD
    batch: int = 7
    resends: int = 3
    resend_on_silence: bool = False
    answer_timeout: int | None = None
    execution_timeout: int | None = None
    settle: int | None = None
    max_pause: int = 300 * MS
    reply_time: int | None = None
    longest_frame: int = 1032
    earlier_execution: int = 0
    controller_drops_partial: bool = False
    backoff: int = 100 * MS
    full_timeout: int = 60 * SECOND
    echo: bool = False  # the line returns what is sent

    def time(self, value: int | None, default: int) -> int:
        """A time, or its default."""
        longer = max(0, span(ANSWER_LEN, self.baud) - span(ANSWER_LEN, REFERENCE_BAUD))
        return default + longer if value is None else value


@dataclass
class Batch:
    """A frame of instructions, and its tries."""

    first: int
    words: list[int]
    items: list[Json]
    resends: int = 0
    unanswered: int = 0
    full_until: int | None = None

    @property
    def word(self) -> int:
        """The word that its echo has."""
        return self.words[0]


class Host(Session):
    """One serial line to a controller."""

    def __init__(self, config: HostConfig | None = None) -> None:
        super().__init__()
        self.config = config or HostConfig()
        if self.config.baud == 0 or not 1 <= self.config.batch <= MAX_BATCH:
            raise ValueError("a baud rate or a batch of 0")
        self.words = Words(self.config.words)
        time = self.config.time
        self.answer_timeout = time(self.config.answer_timeout, 250 * MS)
        self.execution_timeout = time(self.config.execution_timeout, 30 * SECOND)
        self.settle = time(self.config.settle, 100 * MS)
        self.reply_time = time(self.config.reply_time, 40 * MS)
        self.empty()
        self.echo = Echo(self.config.echo)
        self.state = State.DISCONNECTED
        self.quiet_until = 0
        self.filling: Batch | None = None  # `next`
        self.submitted = 0
        self.batch: Batch | None = None
        self.received_by = self.final_from = self.executed_by = self.until = 0
        self.was_corrupt = False

    def new_decoder(self) -> codec.Decoder:
        return codec.Decoder("controller", self.config.profile)

    def empty(self) -> None:
        self.decoder = self.new_decoder()

    def is_interpreted(self, batch: Batch) -> bool:
        return self.words.class_of(batch.word) == "interpreted"

    def execution(self, batch: Batch) -> int:
        """How long the controller executes before it answers (LE-48)."""
        return 0 if self.is_interpreted(batch) else self.execution_timeout

    def answer_time(self, batch: Batch) -> int:
        return self.answer_timeout if self.is_interpreted(batch) else self.execution_timeout

    def settled(self, now: int) -> int:
        return after(max(now, self.received_by), self.settle)

    def settled_if_taken(self, now: int) -> int:
        return after(max(now, self.executed_by), self.settle)

    def finish(self, event: str, quiet_until: int, **fields: Any) -> None:
        """The frame in flight has its outcome; it was not Done, so that the caller has to resume."""
        if self.batch is not None:
            self.report(event, first=self.batch.first, count=len(self.batch.words), **fields)
        self.batch = None
        self.state = State.HELD
        self.quiet_until = quiet_until

    def connected(self, now: int) -> None:
        self.lose(now)
        self.empty()
        self.echo = Echo(self.config.echo)
        self.state = State.HELD if self.state is State.DISCONNECTED_HELD else State.IDLE
        drain = after(span(self.config.longest_frame, self.config.baud), self.config.max_pause)
        drain = after(after(drain, self.config.earlier_execution), self.settle)
        self.quiet_until = max(self.quiet_until, after(now, drain))  # LE-64

    def disconnected(self, now: int) -> None:
        self.lose(now)

    def lose(self, now: int) -> None:
        """LE-63"""
        quiet_until = {
            State.AWAITING: self.settled_if_taken(now),
            State.RESENDING: self.until,
            State.AWAITING_REST: self.until,
        }.get(self.state, self.quiet_until)
        if self.batch is not None:
            self.finish("unknown", quiet_until, reason="disconnected")
        is_held = self.state in (State.HELD, State.DISCONNECTED_HELD)
        self.state = State.DISCONNECTED_HELD if is_held else State.DISCONNECTED

    def input(self, now: int, data: bytes) -> None:
        if not (data := self.without_echo(data)):
            return
        if self.state in (State.DISCONNECTED, State.DISCONNECTED_HELD):
            self.ignored("Input")
            return
        self.decoder.push(data)
        self.read(now)

    def on_message(self, now: int, message: Json) -> None:
        if self.is_own(message):
            return
        (first, *rest) = message["items"]
        word = word_of(first)
        if word is not None:
            self.take_answer(now, word, rest)
        else:
            self.on_error(now, Item(0, 0, error={"kind": "no_word"}))

    def is_own(self, message: Json) -> bool:
        """LE-115: the frame in flight, which the line has returned."""
        if self.batch is None or len(self.batch.items) < 2:
            return False
        sent = codec.encode({"items": self.batch.items}, options=self.config.profile)
        if codec.encode(message, options=self.config.profile) != sent:
            return False
        if not self.echo.returns:
            self.report("echo", error={"kind": "not_set", "length": len(sent)})
        self.echo = Echo(True)
        return True

    def on_error(self, now: int, item: Item) -> None:
        """LE-57"""
        self.was_corrupt = True
        super().on_error(now, item)

    def take_answer(self, now: int, word: int, items: list[Json]) -> None:
        """Section 7.4."""
        batch = self.batch
        if batch is None:
            self.report("unasked", word=word)
            return
        if word == batch.word:
            self.take_echo(now, batch, items)
        elif (code := self.words.error_of(word)) is None:
            quiet_until = self.settled_if_taken(now)
            if self.state is not State.AWAITING:
                quiet_until = max(self.until, after(now, self.settle))
            reason = {"other_word": {"expected": batch.word, "found": word}}
            self.finish("unknown", quiet_until, reason=reason)
        elif self.state is State.AWAITING:
            self.take_code(now, batch, code)

    def take_echo(self, now: int, batch: Batch, items: list[Json]) -> None:
        """LE-50"""
        if self.words.class_of(batch.word) == "query":
            self.report("answer", ticket=batch.first, items=items)
        else:
            tries = {"resends": batch.resends, "unanswered": batch.unanswered}
            self.report("done", first=batch.first, count=len(batch.words), **tries)
        self.batch = None
        self.state = State.IDLE
        self.quiet_until = now

    def take_code(self, now: int, batch: Batch, code: str) -> None:
        """LE-52 to LE-56, LE-69"""
        if code == "bad_frame" and now < self.final_from and not self.config.controller_drops_partial:
            self.state = State.AWAITING_REST
            self.until = self.settled_if_taken(now)
            return
        if code in ("bad_checksum", "bad_frame") and batch.resends < self.config.resends:
            batch.resends += 1
            self.resend(self.settled(now))
            return
        if code == "queue_full":
            if batch.full_until is None:
                batch.full_until = after(now, self.config.full_timeout)
            if now < batch.full_until:
                self.resend(after(now, self.config.backoff))
                return
        if batch.unanswered > 0:
            self.finish("unknown", self.settled(now), reason="silence")
        elif code == "bad_parameters" and self.words.class_of(batch.word) == "immediate":
            self.finish("unknown", self.settled(now), reason="execution_failed")
        else:
            self.finish("refused", self.settled(now), refusal=code)

    def resend(self, not_before: int) -> None:
        self.state = State.RESENDING
        self.until = not_before

    def timeout(self, now: int) -> None:
        if self.state is State.AWAITING_REST and now >= self.until:
            self.finish("unknown", self.until, reason="partial_frame")
        elif self.state is State.AWAITING and self.batch is not None and now >= self.until:
            self.decoder.end()
            self.read(now)
            batch = self.batch
            if self.config.resend_on_silence and batch.resends < self.config.resends:
                batch.resends += 1
                batch.unanswered += 1
                self.resend(self.settled_if_taken(now))
            else:
                reason = "corrupt" if self.was_corrupt else "silence"
                self.finish("unknown", self.settled_if_taken(now), reason=reason)

    def transmitted(self, now: int) -> None:
        """LE-49"""
        if self.state is State.AWAITING and self.batch is not None:
            self.received_by = now
            self.final_from = after(now, self.reply_time)
            self.executed_by = after(now, self.execution(self.batch))
            self.until = after(now, self.answer_time(self.batch))

    def take_back(self) -> None:
        """Empties the frame that is being filled (LE-42)."""
        self.filling = None

    def resume(self) -> None:
        """LE-62"""
        resumed = {State.HELD: State.IDLE, State.DISCONNECTED_HELD: State.DISCONNECTED}
        if self.state in resumed:
            self.state = resumed[self.state]
        else:
            self.ignored("Resume")

    def ignored(self, given: str) -> None:
        """LE-106"""
        self.unexpected(self.state.name.title().replace("_", ""), given)

    def submit(self, word: int, parameters: Sequence[Json] = ()) -> None:
        """An instruction for the next frame (LE-39 to LE-41); raises NotTaken."""
        kind = self.words.class_of(word)
        if kind is None:
            raise NotTaken("unknown_word")
        shorts = [short for item in parameters if (short := word_of(item)) is not None]
        if any(kind == "interpreted" or self.words.class_of(short) for short in shorts):
            raise NotTaken("lone_short")
        items = [item_of(word), *parameters]
        filling = self.filling
        try:
            codec.encode({"items": items}, options=self.config.profile)
        except Refused as refused:
            raise NotTaken(str(refused)) from refused
        if filling is None:
            self.filling = Batch(self.submitted, [word], items)
        else:
            if kind != "interpreted" or not self.is_interpreted(filling) or len(filling.words) >= self.config.batch:
                raise NotTaken("full")
            try:
                codec.encode({"items": filling.items + items}, options=self.config.profile)
            except Refused as refused:
                raise NotTaken("full") from refused
            filling.words.append(word)
            filling.items += items
        self.submitted += 1

    def transmit(self, now: int) -> bytes | None:
        """LE-44 to LE-48"""
        self.timeout(now)
        if self.waiting(OUTCOMES):
            return None
        if self.state is State.IDLE and self.filling is not None and now >= self.quiet_until:
            self.batch, self.filling = self.filling, None
        elif not (self.state is State.RESENDING and now >= self.until):
            return None
        batch = self.batch
        if batch is None:
            return None
        frame = codec.encode({"items": batch.items}, options=self.config.profile)
        left = after(now, span(len(frame), self.config.baud))
        self.received_by = after(left, self.config.max_pause)
        self.final_from = after(self.received_by, self.reply_time)
        self.executed_by = after(self.received_by, self.execution(batch))
        self.until = after(left, self.answer_time(batch))
        self.was_corrupt = False
        self.state = State.AWAITING
        self.empty()
        self.echo.sent(frame, len(batch.items) > 1)  # LE-114
        return frame

    def deadline(self) -> int | None:
        """LE-65"""
        if self.state is State.IDLE and self.filling is not None:
            return self.quiet_until
        return self.until if self.state in (State.AWAITING, State.RESENDING, State.AWAITING_REST) else None
