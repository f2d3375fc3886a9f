"""The controller of laser-eb90 (section 8 of reference/laser-eb90.md)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

from ..echo import Echo
from ..session import MS, NotTaken, Session, after, earliest
from ..stream import Item, Json, Refused
from . import codec
from .words import Words, item_of, word_of

MAX_BATCH = 255
HELD = 1032  # LE-80
SHORTEST = 8  # LE-85
QUEUE = 64


class Work(Enum):
    """LE-73."""

    LISTENING = auto()
    EXECUTING = auto()
    ANSWERING = auto()


class Line(Enum):
    """LE-73."""

    DISCONNECTED = auto()
    SILENT = auto()
    BYTES = auto()


@dataclass
class ControllerConfig:
    """LE-109, and how many instructions the queue holds. Times are in nanoseconds."""

    profile: Json = field(default_factory=dict)
    words: Json = field(default_factory=dict)
    batch: int = 7
    tick: int = 16 * MS
    silence: int = 50 * MS
    echo: bool = False  # the line returns what is sent
    queue: int = QUEUE

    def __post_init__(self) -> None:
        if not 1 <= self.batch <= MAX_BATCH or self.queue < 1:
            raise ValueError("a batch or a queue of 0")


@dataclass
class Fault:
    """Corrupt bytes of a stretch: the first refusal, how many, and whether they are answered."""

    refusal: str
    count: int = 0
    is_answered: bool = False

    @property
    def is_long(self) -> bool:
        """It may have been a frame."""
        return self.count >= SHORTEST


def takes_all(word: int, parameters: list[Json]) -> bool:
    """An owner that takes every instruction."""
    return True


class Controller(Session):
    """Answers the frames of a host, and queues their instructions for its owner, who takes them.

    `takes` says of an instruction of the queue whether its parameters are right. What is immediate, and a query, is an event `execute`:
    `answer` it, or `refuse` it.
    """

    def __init__(
        self, config: ControllerConfig | None = None, takes: Callable[[int, list[Json]], bool] = takes_all
    ) -> None:
        super().__init__()
        self.config = config or ControllerConfig()
        self.words = Words(self.config.words)
        self.takes = takes
        self.queue: list[Json] = []
        self.work, self.line = Work.LISTENING, Line.DISCONNECTED
        self.rests = False  # the last answer was an error code for corrupt bytes
        self.word = 0  # that is executed
        self.is_connected = False  # still, for what is executed
        self.answer_items: list[Json] = []
        self.due = self.silent_at = 0
        self.is_partial = False
        self.fault: Fault | None = None
        self.frames = self.new_decoder()
        self.echo = Echo(self.config.echo)

    def new_decoder(self) -> codec.Decoder:
        return codec.Decoder("host", self.config.profile)

    # What the owner says

    def take(self, count: int = 1) -> list[Json]:
        """The oldest instructions of the queue, each a `word` and its `parameters`."""
        taken = self.queue[:count]
        del self.queue[:count]
        return taken

    def answer(self, items: Sequence[Json] = ()) -> None:
        """The instruction was executed; these are a query's values. Raises NotTaken (LE-81, LE-83)."""
        self.check()
        reply = [item_of(self.word), *items]
        try:
            codec.encode({"items": reply}, "controller", self.config.profile)
        except Refused as refused:
            raise NotTaken(str(refused)) from refused
        is_query = self.words.class_of(self.word) == "query"
        self.executed(reply if is_query else reply[:1])

    def refuse(self, refusal: str) -> None:
        """The instruction was not executed; the name of an error code says why. Raises NotTaken (LE-81)."""
        self.check()
        if self.is_connected:
            self.report("refused", refusal=refusal)
        self.executed([item_of(self.words.errors[refusal])])

    def check(self) -> None:
        if self.work is not Work.EXECUTING:
            raise NotTaken("not_executing")

    def executed(self, reply: list[Json]) -> None:
        """LE-80, LE-81"""
        self.work, self.rests = Work.LISTENING, False
        if self.is_connected:
            self.set_answer(self.now, reply)
        self.read_all(self.now)

    def set_answer(self, now: int, reply: list[Json]) -> None:
        """LE-78"""
        tick = self.config.tick
        self.due = now if tick == 0 else -(-now // tick) * tick
        self.work, self.answer_items = Work.ANSWERING, reply

    def set_refusal(self, now: int, refusal: str) -> None:
        self.report("refused", refusal=refusal)
        self.set_answer(now, [item_of(self.words.errors[refusal])])

    # Inputs

    def connected(self, now: int) -> None:
        self.begin(Line.SILENT)
        self.echo = Echo(self.config.echo)

    def disconnected(self, now: int) -> None:
        self.begin(Line.DISCONNECTED)

    def begin(self, line: Line) -> None:
        """LE-87"""
        self.line = line
        self.frames = self.new_decoder()
        self.fault, self.is_partial, self.is_connected, self.rests = None, False, False, False
        if self.work is Work.ANSWERING:
            self.work = Work.LISTENING

    def input(self, now: int, data: bytes) -> None:
        """LE-74"""
        if not (data := self.without_echo(data)):
            return
        if self.line is Line.DISCONNECTED:
            self.unexpected(self.line.name, "Bytes")
            return
        self.line, self.silent_at = Line.BYTES, after(now, self.config.silence)
        if self.work is Work.EXECUTING:
            self.frames.push(data[: max(HELD - len(self.frames.held), 0)])
            return
        self.frames.push(data)
        self.read_all(now)

    def read_all(self, now: int) -> None:
        """Whole frames and errors, until an instruction is executed."""
        while self.work is not Work.EXECUTING:
            item = self.frames.next()
            if item is None:
                break
            if item.message is None:
                self.on_error(now, item)
            else:
                self.take_frame(now, item.message["items"])
        self.is_partial = len(self.frames.held) > 0
        if self.work is Work.ANSWERING and not self.is_partial:
            self.end_stretch(now)

    def end_stretch(self, now: int) -> None:
        """The line is silent, if it has been for long enough (LE-84)."""
        if now >= self.silent_at:
            self.line, self.fault = Line.SILENT, None

    def on_error(self, now: int, item: Item, has_head: bool = False) -> None:
        """LE-75, LE-76; `has_head` is of incomplete bytes."""
        super().on_error(now, item)
        fault, kind = item.error or {}, (item.error or {})["kind"]
        if self.fault is None:
            self.fault = Fault("bad_checksum" if kind == "checksum" else "bad_frame")
        self.fault.count += item.length
        if self.work is Work.ANSWERING:
            return
        if not self.rests:
            self.fault.is_answered = True
            return
        is_tail = kind in ("no_head", "flag") or kind == "tag" and fault["offset"] == 0
        if not is_tail and (kind != "incomplete" or has_head):
            self.rests = False
            self.fault.is_answered |= item.length >= SHORTEST

    def take_frame(self, now: int, items: list[Json]) -> None:
        """LE-77, LE-79, LE-112"""
        if self.fault is not None and self.fault.is_long:
            self.fault.is_answered = True
            self.work, self.rests = Work.LISTENING, False
            return
        self.fault = None
        word = word_of(items[0])
        refusal = self.judge(word, items)
        if refusal is not None:
            self.set_refusal(now, refusal)
        elif self.words.class_of(word) == "interpreted":
            instructions = instructions_of(items)
            self.queue += instructions
            self.report("queued", count=len(instructions))
            self.set_answer(now, [items[0]])
        elif word is not None:
            self.work, self.word, self.is_connected = Work.EXECUTING, word, True
            self.report("execute", **{"class": self.words.class_of(word)}, word=word, parameters=items[1:])

    def judge(self, word: int | None, items: list[Json]) -> str | None:
        """Section 8.6; None: the frame is taken."""
        if word is None:
            return "bad_frame"
        class_of = self.words.class_of
        if class_of(word) is None:
            return "unknown_command"
        if class_of(word) != "interpreted":
            if any(class_of(word_of(item)) for item in items[1:]):
                return "bad_batch"
            return None if is_finite(items) else "bad_parameters"
        instructions = instructions_of(items)
        for before, instruction in enumerate(instructions):
            kind = class_of(instruction["word"])
            if kind is None:
                return "unknown_command"
            if kind != "interpreted" or before >= self.config.batch:
                return "bad_batch"
            parameters = instruction["parameters"]
            if not is_finite(parameters) or not self.takes(instruction["word"], parameters):
                return "bad_parameters"
        return None if len(self.queue) + len(instructions) <= self.config.queue else "queue_full"

    def timeout(self, now: int) -> None:
        """LE-84"""
        is_listened = self.work is Work.LISTENING or self.work is Work.ANSWERING and self.is_partial
        if self.line is not Line.BYTES or now < self.silent_at or not is_listened:
            return
        has_head = self.frames.held.startswith(codec.HEAD)
        self.frames.end()
        while (item := self.frames.next()) is not None:
            self.on_error(now, item, has_head)
        self.line, self.is_partial = Line.SILENT, False
        fault, self.fault = self.fault, None
        if fault is not None and fault.is_long and fault.is_answered:
            self.set_refusal(now, fault.refusal)

    def transmit(self, now: int) -> bytes | None:
        """LE-82"""
        self.timeout(now)
        if self.work is not Work.ANSWERING or self.is_partial or now < self.due:
            return None
        self.work = Work.LISTENING
        code = self.words.error_of(word_of(self.answer_items[0]))
        self.rests = code in ("bad_checksum", "bad_frame") or self.fault is not None
        self.end_stretch(now)
        frame = codec.encode({"items": self.answer_items}, "controller", self.config.profile)
        self.echo.sent(frame, False)  # a host may send the same
        return frame

    def deadline(self) -> int | None:
        """LE-88"""
        if self.work is Work.EXECUTING:
            return None
        if self.work is Work.ANSWERING:
            return self.silent_at if self.is_partial else self.due
        return earliest(self.silent_at if self.line is Line.BYTES else None)


def instructions_of(items: list[Json]) -> list[Json]:
    """A frame of interpreted instructions: every word begins the next one (LE-23)."""
    instructions: list[Json] = []
    for item in items:
        word = word_of(item)
        if word is None:
            instructions[-1]["parameters"].append(item)
        else:
            instructions.append({"word": word, "parameters": []})
    return instructions


def is_finite(items: list[Json]) -> bool:
    """Whether no float is NaN or infinite (LE-35)."""
    return all(value is not None for item in items for value in item.get("f32", []))
