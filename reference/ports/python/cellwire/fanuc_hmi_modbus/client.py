"""The client of fanuc-hmi-modbus (section 7 of reference/fanuc-hmi-modbus.md)."""

from dataclasses import dataclass
from enum import Enum, auto

from ..echo import Echo
from ..session import MS, SECOND, NotTaken, Session, after
from ..stream import Item, Json, Refused
from . import codec, timing
from .replies import asked_bytes, begins_reply, is_mirrored

MAX_PLACES = 16
PROBE: Json = {"function": 3, "address": 0, "quantity": 1}
REPEATED = {5: ("address", "value"), 6: ("address", "value"), 21: ("records",), 22: ("address", "and", "or"), 43: ("category",)}


@dataclass
class ClientConfig:
    """FM-77. Times are in nanoseconds; None: the default, which depends on the framing."""

    framing: str = "tcp"
    baud: int = 19200
    silence: int | None = None
    stall: int | None = None
    timeout: int | None = None
    in_flight: int = 1
    any_unit: bool = False
    broadcast: bool | None = None
    turnaround: int | None = None
    settle: int | None = None
    pause: int = 0
    echo: bool = False  # the line returns what is sent
    places: int = 8

    def __post_init__(self) -> None:
        if self.timeout == 0 or 0 in (self.silence, self.stall):
            raise ValueError("a timeout, a silence or a stall of 0")  # FM-56
        if self.echo and self.framing == "tcp":
            raise ValueError("an echo over TCP")  # FM-56
        most = self.places if self.framing == "tcp" else 1
        if not 1 <= self.places <= MAX_PLACES or not 1 <= self.in_flight <= most:
            raise ValueError("places are 1 to 16, and requests in flight as many, or one without transactions")


class Stage(Enum):
    """FM-75; what has ended, and was taken by the caller, is known by its event."""

    QUEUED = auto()
    PROBING = auto()
    IN_FLIGHT = auto()
    ENDED = auto()


@dataclass
class Request:
    """A request in its place."""

    ticket: int
    message: Json
    is_broadcast: bool
    stage: Stage = Stage.QUEUED
    deadline: int = 0
    sent: bytes = b""
    transaction: int | None = None
    is_probed: bool = False  # the probe before it has ended
    is_returned: bool = False  # a frame that equals it has come while the line was not proven (FM-95)
    outcome: Json | None = None
    is_late: bool = False  # it timed out, and its reply may still come
    ended: int = 0  # how many ended before

    def asked(self) -> Json:
        """What was sent for it: the request, or the probe before it (FM-93)."""
        return PROBE | {"unit": self.message["unit"]} if self.stage is Stage.PROBING else self.message


class Client(Session):
    """Asks a controller: each request has one outcome, `replied`, `announced` or `failed`."""

    CLOSES = frozenset({"out_of_step"})  # FM-29

    def __init__(self, config: ClientConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or ClientConfig()
        self.is_tcp, is_rtu = config.framing == "tcp", config.framing == "rtu"
        self.is_line = is_rtu
        self.gap = timing.gap(config.framing, config.baud, config.silence, config.stall)
        longest = timing.longest(config.baud) if is_rtu else 0

        def default(value: int | None, otherwise: int) -> int:
            return otherwise if value is None else value

        self.time_limit = default(config.timeout, SECOND + 2 * longest)
        self.turnaround = default(config.turnaround, 100 * MS + longest)
        self.settle = default(config.settle, 10 * SECOND if config.framing == "rtu_over_tcp" else SECOND)
        self.has_broadcast = not self.is_tcp if config.broadcast is None else config.broadcast
        self.options = {"framing": "tcp" if self.is_tcp else "rtu"}
        self.is_up = False
        self.silent_at: int | None = None  # None: the line is silent
        self.is_partial = False  # until then the rest of the reply is waited for (FM-86)
        self.is_cut = False  # the last end of the input was that of such a wait
        self.quiet_until: int | None = None
        self.places: list[Request | None] = [None] * config.places
        self.tickets = self.ends = self.last_transaction = 0
        self.doubtful: tuple[bytes, Item] | None = None  # an exception after which nothing has come yet (FM-84)
        self.has_failed = False  # the decoder, since the last request was sent (FM-84)
        self.was_within = False  # corruption, when the read before ended (FM-81)
        self.replies = self.new_decoder()

    def new_decoder(self) -> codec.Decoder:
        return codec.Decoder("server", self.options)

    # Requests

    def request(self, message: Json) -> int:
        """A request object without a transaction: its ticket. Raises NotTaken (FM-39)."""
        is_broadcast = self.has_broadcast and message.get("unit") == 0
        try:
            self.encode(message, 0 if self.is_tcp else None)
        except (Refused, KeyError, TypeError) as refused:
            raise NotTaken(f"message: {refused}") from refused
        if is_broadcast and (message["function"] in codec.ASKING or "category" in message):
            raise NotTaken("broadcast_read")
        place = self.free_place()
        self.tickets += 1
        self.places[place] = Request(self.tickets, message, is_broadcast)
        return self.tickets

    def free_place(self) -> int:
        """FM-39"""
        self.forget()
        expired = []
        for place, request in enumerate(self.places):
            if request is None:
                return place
            if self.is_taken(request):
                expired.append((request.ended, place))
        if not expired:
            raise NotTaken("full")
        return min(expired)[1]

    def is_taken(self, request: Request) -> bool:
        """The caller has its outcome."""
        return request.stage is Stage.ENDED and not any(event is request.outcome for event in self.events)

    def forget(self) -> None:
        """What has ended, was taken, and expects nothing more, has no place."""
        for place, request in enumerate(self.places):
            if request is not None and self.is_taken(request) and not request.is_late:
                self.places[place] = None

    def all_in(self, *stages: Stage) -> list[Request]:
        """The requests in these stages, in the order of their places."""
        return [request for request in self.places if request is not None and request.stage in stages]

    def flying(self) -> list[Request]:
        """The requests in flight, or whose probe is."""
        return self.all_in(Stage.PROBING, Stage.IN_FLIGHT)

    def finish(self, request: Request, event: str, **fields: object) -> None:
        self.report(event, ticket=request.ticket, **fields)
        request.stage, request.outcome = Stage.ENDED, self.events[-1]
        self.ends += 1
        request.ended = self.ends

    # Connections

    def connected(self, now: int) -> None:
        """FM-53"""
        self.lose()
        self.is_up = True
        self.is_proven = self.is_tcp  # FM-93
        self.echo = Echo(self.config.echo)
        self.quiet_until = after(now, after(self.time_limit, self.settle)) if self.is_line else None

    def disconnected(self, now: int) -> None:
        self.lose()
        self.is_up = False

    def lose(self) -> None:
        """FM-54"""
        if not self.is_up:
            return
        for request in self.all_in(Stage.IN_FLIGHT):
            self.finish(request, "failed", reason="disconnected")
        for request in self.all_in(Stage.QUEUED, Stage.PROBING):
            self.finish(request, "failed", reason="not_sent")
        for request in self.all_in(Stage.ENDED):
            request.is_late = False
        self.silent_at = self.quiet_until = None
        self.was_within = self.is_partial = False
        self.empty()

    # Input

    def empty(self) -> None:
        self.replies, self.doubtful = self.new_decoder(), None

    def input(self, now: int, data: bytes) -> None:
        """FM-49"""
        if not self.is_up:
            self.unexpected("Disconnected", "Received")
            return
        if not (data := self.without_echo(data)):
            return
        if self.silent_at is not None and now >= self.silent_at and not self.is_partial:
            self.end_input(now)
        self.replies.push(data)
        self.decide(now)
        self.read(now)
        if self.gap is not None:
            self.silent_at, self.is_partial = after(now, self.gap), False
            self.wait_for_rest()
        is_within = self.replies.corruption is not None
        if self.is_tcp and is_within and not self.was_within:
            self.report("out_of_step", error=self.replies.corruption)
        self.was_within = is_within

    def wait_for_rest(self) -> None:
        """FM-86"""
        held = bytes(self.replies.held)
        for request in self.flying():
            if begins_reply(held, request.asked(), self.config.any_unit):
                self.silent_at, self.is_partial = max(self.silent_at or 0, request.deadline), True

    def end_input(self, now: int) -> None:
        self.is_cut, self.is_partial = self.is_partial, False
        self.replies.end()
        self.decide(now)
        self.read(now)

    def decide(self, now: int) -> None:
        """FM-84: more bytes have come after the exception that is in doubt, or the input has ended."""
        if self.doubtful is not None:
            (frame, item), self.doubtful = self.doubtful, None
            self.on_frame(now, frame, item)

    def read(self, now: int) -> None:
        while (item := self.replies.next()) is not None:
            if self.replies.frame:
                self.on_frame(now, self.replies.frame, item)
            else:
                self.has_failed = True
                if item.error is not None and item.error["kind"] != "noise":  # FM-81
                    self.report("corrupt", error=item.error)

    def on_frame(self, now: int, frame: bytes, item: Item) -> None:
        """Section 7.3."""
        header, pdu = codec.split(frame, self.is_tcp)
        transaction = header.get("transaction")
        stray = header | {"function": pdu[0] % codec.EXCEPTION}
        flight = [request for request in self.flying() if request.transaction == transaction]
        if not flight:
            self.take_late(stray, transaction)
            return
        request = flight[0]
        mismatch = self.mismatch(request.asked(), header["unit"], item.message)
        is_last = self.replies.ended and not self.replies.held and not self.is_cut
        is_doubtful = pdu[0] > codec.EXCEPTION and self.has_failed and not is_last  # FM-84
        if is_doubtful and not self.is_tcp and not mismatch and item.message and not self.replies.ended and not self.replies.held:
            self.doubtful = frame, item
            return
        if not self.is_tcp and (item.message is None or mismatch or is_doubtful):
            self.report("stray", **stray, **({"mismatch": mismatch} if mismatch else {}))
            return
        is_equal = request.stage is Stage.IN_FLIGHT and frame == request.sent
        if is_equal and not self.is_proven:
            request.is_returned = True  # FM-95
            return
        self.is_proven = self.is_proven or not is_equal
        self.be_quiet(now, self.config.pause)  # FM-94
        if request.stage is Stage.PROBING:
            request.stage, request.is_probed = Stage.QUEUED, True
        elif mismatch:
            self.finish(request, "failed", reason={"mismatch": mismatch})
        elif item.message is None:
            self.finish(request, "failed", reason={"malformed": item.error})
        else:
            self.finish(request, "replied", message=reply_of(request.message, item.message))

    def be_quiet(self, now: int, time: int) -> None:
        if time > 0:
            self.quiet_until = after(now, time)

    def take_late(self, stray: Json, transaction: int | None) -> None:
        """FM-48"""
        late = [r for r in self.places if r is not None and r.is_late and r.transaction == transaction]
        if not late:
            self.report("stray", **stray)
            return
        newest = max(late, key=lambda request: request.ended)
        newest.is_late = False
        self.report("stray", **stray, late=newest.ticket)

    def mismatch(self, request: Json, unit: int, reply: Json | None) -> Json | None:
        """Why a reply is none to this request (FM-44); None: it fits, or cannot be read."""
        if unit != request["unit"] and not self.config.any_unit:
            return {"kind": "unit", "expected": request["unit"], "found": unit}
        if reply is None:
            return None
        function = request["function"]
        if reply["function"] != function:
            return {"kind": "function", "expected": function, "found": reply["function"]}
        if "exception" in reply or function in (*codec.BARE, 24):
            return None
        if "data" in reply or "data" in request:
            return None if "data" in reply and "data" in request else {"kind": "echo"}
        if function in codec.READING:
            expected = asked_bytes(request)
            found = len(reply["bits"]) // 8 if function in codec.BITS else 2 * len(reply["registers"])
            return None if found == expected else {"kind": "quantity", "expected": expected, "found": found}
        if function == 20:
            is_echo = [len(values) for values in reply["contents"]] == [run["quantity"] for run in request["ranges"]]
        elif function == 8:
            is_echo = reply["subfunction"] == request["subfunction"] and (
                reply["subfunction"] > 0 or reply["values"] == request["values"]
            )
        elif function in REPEATED:
            is_echo = all(reply[name] == request[name] for name in REPEATED[function])
        else:
            is_echo = (reply["address"], reply["quantity"]) == (request["address"], len(request["values"]))
        return None if is_echo else {"kind": "echo"}

    # Times

    def timeout(self, now: int) -> None:
        """FM-50"""
        while True:
            if self.silent_at is not None and now >= self.silent_at:
                self.silent_at = None
                self.end_input(now)
            elif self.quiet_until is not None and now >= self.quiet_until:
                self.quiet_until = None
            else:
                due = [request for request in self.flying() if now >= request.deadline]
                if not due:
                    return
                for request in due:
                    if request.stage is Stage.PROBING:
                        request.stage, request.is_probed = Stage.QUEUED, True
                    else:
                        self.finish(request, "failed", reason="returned" if request.is_returned else "timed_out")
                        request.is_late = True
                self.be_quiet(now, max(self.config.pause, 0 if self.is_tcp else self.settle))

    def transmit(self, now: int) -> bytes | None:
        """Section 7.2."""
        queued = self.all_in(Stage.QUEUED)
        waits_for_silence = self.is_line or self.config.echo
        is_busy = self.quiet_until is not None or waits_for_silence and self.silent_at is not None
        if not self.is_up or is_busy or not queued or len(self.flying()) >= self.config.in_flight:
            return None
        request = min(queued, key=lambda request: request.ticket)
        self.has_failed = False
        needs_probe = not self.is_proven and not request.is_probed and is_mirrored(request.message)  # FM-93
        if request.is_broadcast:
            self.quiet_until = after(now, self.turnaround)
            self.finish(request, "announced")
        else:
            request.stage = Stage.PROBING if needs_probe else Stage.IN_FLIGHT
            request.deadline = after(now, self.time_limit)
        if self.is_tcp:
            return self.encode(request.message, self.transaction_of(request))
        frame = request.sent = self.encode(request.asked())
        self.echo.sent(frame, needs_probe or request.is_broadcast or not is_mirrored(request.message))
        return frame

    def encode(self, message: Json, transaction: int | None = None) -> bytes:
        header = {} if transaction is None else {"transaction": transaction}
        return codec.encode(message | header, "client", self.options)

    def transaction_of(self, request: Request) -> int:
        """FM-41; of a broadcast it is 0 (FM-43)."""
        if request.is_broadcast:
            return 0
        request.transaction = self.last_transaction = self.next_transaction()
        return request.transaction

    def next_transaction(self) -> int:
        """FM-41"""
        used = {r.transaction for r in self.places if r is not None and (r.stage is Stage.IN_FLIGHT or r.is_late)}
        number = self.last_transaction
        while (number := (number + 1) % 0x10000) in used:
            pass
        return number

    def deadline(self) -> int | None:
        """FM-55; without a connection there is none of these times."""
        deadlines = [request.deadline for request in self.flying()]
        times = [time for time in (self.silent_at, self.quiet_until, *deadlines) if time is not None]
        return min(times, default=None)


def reply_of(request: Json, reply: Json) -> Json:
    """The reply as it is given to the caller: without a transaction, with as many bits as were asked for (FM-35)."""
    message = {name: value for name, value in reply.items() if name != "transaction"}
    if "bits" in message:
        message["bits"] = message["bits"][: request["quantity"]]
    return message
