"""The server of fanuc-hmi-modbus (section 8 of reference/fanuc-hmi-modbus.md)."""

from dataclasses import dataclass

from ..echo import Echo
from ..session import Session, after
from ..stream import Json, Refused
from . import codec, timing
from .registers import (
    DEVICE_FAILURE,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    Refusal,
    Registers,
)
from .requests import Found, fault_of, find, lengths_of

MAX_PLACES = 255
HELD = 504  # FM-62
LONGEST_STRETCH, LEFT = 1024, 256  # FM-63
BROADCAST = 0
ANY = "any"
READ_REQUEST = 8  # bytes of RTU


@dataclass
class ServerConfig:
    """FM-79. Times are in nanoseconds; None: the default, which depends on the framing. The unit `any` is every one."""

    framing: str = "tcp"
    unit: int | str | None = None
    broadcast: bool | None = None
    baud: int = 19200
    silence: int | None = None
    stall: int | None = None
    frame_timeout: int | None = None
    echo: bool = False  # the line returns what is sent
    places: int = 8

    def __post_init__(self) -> None:
        if self.broadcast is None:
            self.broadcast = self.framing != "tcp"
        if self.unit is None:
            self.unit = ANY if self.framing == "tcp" else 1
        if self.unit == BROADCAST and self.broadcast:
            raise ValueError("a unit of 0, which is a broadcast")  # FM-67
        if self.echo and self.framing == "tcp":
            raise ValueError("an echo over TCP")  # FM-67
        if 0 in (self.silence, self.stall) or not 1 <= self.places <= MAX_PLACES:
            raise ValueError("a silence or a stall of 0, or no place")


class Server(Session):
    """Carries requests out on its registers, and answers them in their order."""

    CLOSES = frozenset({"out_of_step"})  # FM-29

    def __init__(self, config: ServerConfig | None = None, registers: Registers | None = None) -> None:
        super().__init__()
        self.config = config = config or ServerConfig()
        self.registers = registers or Registers()
        self.is_tcp, self.is_line = config.framing == "tcp", config.framing == "rtu"
        self.gap = timing.gap(config.framing, config.baud, config.silence, config.stall)
        default = timing.piece(config.baud) if self.is_line else timing.PIECE
        self.frame_timeout = default if config.frame_timeout is None else config.frame_timeout
        self.begin(False)

    def begin(self, is_up: bool) -> None:
        """FM-65"""
        self.is_up = is_up
        self.silent_at: int | None = None  # None: the line is silent
        self.is_partial = False  # until then the rest of a request is waited for (FM-87)
        self.replies: list[bytes] = []
        self.was_within = False  # corruption, when the read before ended (FM-81)
        self.requests = codec.Decoder("client")
        self.echo = Echo(self.config.echo)
        self.empty()

    def empty(self) -> None:
        self.held = bytearray()  # of RTU
        self.silences: list[int] = []  # within what is held
        self.is_dropping = False  # up to the next silence: no frame is behind corrupt bytes
        self.fault: Json | None = None  # of bytes that were dropped before the silence

    def connected(self, now: int) -> None:
        self.begin(True)

    def disconnected(self, now: int) -> None:
        self.begin(False)

    def is_full(self) -> bool:
        return len(self.replies) >= self.config.places

    def wants_input(self) -> bool:
        """FM-62"""
        return self.is_line or not self.is_full()

    # Input

    def input(self, now: int, data: bytes) -> None:
        if not self.is_up:
            self.unexpected("Disconnected", "Received")
            return
        if not (data := self.without_echo(data)):
            return
        if self.gap is not None:
            self.silent_at, self.is_partial = after(now, self.gap), False
        if self.is_tcp:
            self.requests.push(data if self.wants_input() else data[: max(HELD - len(self.requests.held), 0)])
            self.read_tcp()
            self.report_out_of_step()
        elif self.is_line:
            self.push_line(data)
        else:
            self.held += data if self.wants_input() else data[: max(HELD - len(self.held), 0)]
            self.read_stream(False)

    def read_tcp(self) -> None:
        while not self.is_full() and (item := self.requests.next()) is not None:
            if self.requests.frame:
                self.carry_out(self.requests.frame)
            elif item.error is not None and item.error["kind"] != "noise":
                self.report("corrupt", error=item.error)

    def report_out_of_step(self) -> None:
        """FM-81"""
        is_within = self.requests.corruption is not None
        if is_within and not self.was_within:
            self.report("out_of_step", error=self.requests.corruption)
        self.was_within = is_within

    def read_stream(self, ended: bool) -> None:
        """RTU over TCP (FM-82)."""
        while self.held and not self.is_dropping and not self.is_full():
            found = self.find(bytes(self.held), ended)
            if found.waits:
                return
            if found.size == 0:
                self.drop()
                return
            frame = bytes(self.held[: found.size])
            del self.held[: found.size]
            self.carry_out(frame)
        if self.is_dropping:
            self.held.clear()

    def find(self, held: bytes, ended: bool) -> Found:
        return find(held, held[0] == BROADCAST or self.is_own(held[0]), ended, not self.is_line)

    def drop(self) -> None:
        """What is held is no frame."""
        self.fault = fault_of(bytes(self.held))
        self.held.clear()
        self.is_dropping = True

    def push_line(self, data: bytes) -> None:
        """Takes what a serial line has brought."""
        while data and self.fault is None:
            if len(self.held) == LONGEST_STRETCH:
                self.drop_long()
                continue
            room = LONGEST_STRETCH - len(self.held)
            self.held += data[:room]
            data = data[room:]

    def drop_long(self) -> None:
        """FM-63"""
        while len(self.held) > LEFT:
            found = self.find(bytes(self.held), False)
            if found.size == 0:
                self.fault = fault_of(bytes(self.held))
                self.forget(len(self.held))
                return
            unit, function = self.held[:2]
            if unit == BROADCAST or self.is_own(unit):
                self.report("refused", unit=unit, function=function)
            self.forget(found.size)

    def forget(self, size: int) -> None:
        """Takes so many of the first bytes away."""
        del self.held[:size]
        self.silences = [at - size for at in self.silences if at > size]

    def read_line(self, now: int) -> None:
        """A serial line, at a silence, or when the rest of a request has not come (FM-82, FM-87)."""
        is_pause, self.is_partial = not self.is_partial, False
        while self.held:
            held = bytes(self.held)
            frames, rest = self.divide(held)
            if not rest:
                self.forget(len(held))
                for at, frame in enumerate(frames, 1):
                    self.take(frame, at < len(frames))
            elif is_pause and self.may_go_on(held):
                self.silences.append(len(held))
                while self.held and (size := self.find(bytes(self.held), False).size):
                    frame = bytes(self.held[:size])
                    self.forget(size)
                    self.take(frame, True)
                self.is_partial, self.silent_at = True, after(now, self.frame_timeout)
                return
            else:
                piece = held[: next((at for at in self.silences if at < len(held)), len(held))]
                self.report("corrupt", error=fault_of(self.divide(piece)[1] or rest))
                self.forget(len(piece))

    def divide(self, held: bytes) -> tuple[list[bytes], bytes]:
        """The frames at the beginning of a message that has ended, and the bytes behind them."""
        frames = []
        while held and (size := self.find(held, True).size):
            frames.append(held[:size])
            held = held[size:]
        return frames, held

    def may_go_on(self, held: bytes) -> bool:
        """FM-87"""
        rest = held
        while rest and (size := self.find(rest, False).size):
            rest = rest[size:]
        if rest and not self.find(rest, False).waits:
            return False
        lengths = lengths_of(rest, bool(rest) and (rest[0] == BROADCAST or self.is_own(rest[0])))
        if any(size is not None and len(rest) < size <= codec.MAX_RTU for size in lengths):
            return True
        return None in lengths and all(self.divide(held[at:])[1] for at in self.silences if at < len(held))

    def take(self, frame: bytes, is_followed: bool) -> None:
        """A frame of a serial line (FM-62)."""
        unit, function = frame[:2]
        if not self.is_broadcast(unit) and self.is_own(unit) and (is_followed or self.is_full()):
            self.report("refused", unit=unit, function=function)
        else:
            self.carry_out(frame)

    # Requests

    def is_broadcast(self, unit: int) -> bool:
        return bool(self.config.broadcast) and unit == BROADCAST

    def is_own(self, unit: int) -> bool:
        return self.config.unit in (ANY, unit)

    def carry_out(self, frame: bytes) -> None:
        """FM-61"""
        header, pdu = codec.split(frame, self.is_tcp)
        is_broadcast = self.is_broadcast(header["unit"])
        if not is_broadcast and not self.is_own(header["unit"]):
            return
        try:
            reply, exception = self.reply_to(pdu), {}
        except Refusal as refusal:
            reply, exception = bytes([pdu[0] | codec.EXCEPTION, refusal.code]), {"exception": refusal.code}
        self.report("served", **header, function=pdu[0], **exception)
        if not is_broadcast:
            self.replies.append(codec.wrap(reply, header["unit"], header.get("transaction")))

    def reply_to(self, pdu: bytes) -> bytes:
        """The PDU of the reply; raises Refusal (FM-64)."""
        if pdu[0] == 0 or pdu[0] >= codec.EXCEPTION:
            raise Refusal(ILLEGAL_FUNCTION)
        try:
            request = codec.decode_request(pdu)
        except codec.Wrong as wrong:
            is_reference = wrong.error["kind"] == "reference_type"
            raise Refusal(ILLEGAL_ADDRESS if is_reference else ILLEGAL_VALUE) from wrong
        try:
            return codec.encode_reply(self.registers.serve(request))
        except Refused as refused:
            raise Refusal(DEVICE_FAILURE) from refused

    # Times

    def timeout(self, now: int) -> None:
        if self.silent_at is None or now < self.silent_at or not self.is_line and self.is_full():
            return
        self.silent_at = None
        if self.is_line and self.fault is None:
            self.read_line(now)
        elif not self.is_line:
            self.read_stream(True)
        if self.fault is not None:
            self.report("corrupt", error=self.fault)
        self.is_dropping, self.fault = False, None

    def transmit(self, now: int) -> bytes | None:
        """FM-60"""
        if not self.replies or self.is_line and self.silent_at is not None and not self.is_partial:
            return None
        was_full = self.is_full()
        reply = self.replies.pop(0)
        if self.is_tcp:
            self.read_tcp()
        elif was_full and not self.is_line:
            if self.silent_at is not None and self.gap is not None:
                self.silent_at = after(now, self.gap)  # FM-66
            self.read_stream(False)
        if not self.is_tcp:
            self.echo.sent(reply, reply[1] in codec.ASKING and len(reply) > READ_REQUEST)  # FM-92
        return reply

    def deadline(self) -> int | None:
        """FM-66"""
        return None if not self.is_line and self.is_full() else self.silent_at
