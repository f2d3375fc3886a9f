"""val2-alter: frames of ALTER. Clauses AL-… are those of reference/val2-alter.md."""

import struct
from dataclasses import dataclass

from ..stream import Item, Json, Refused, boolean, error, fields, integer, integers, one_of

DLE, STX, ETX = 0x10, 0x02, 0x03
CONTROLLER_LIMIT, HOST_LIMIT = 30, 14  # AL-9
REPLIES = {0x00: "accept", 0x01: "repeat", 0xFF: "refuse"}
WORD = (-0x8000, 0x7FFF)
AXES = 6


@dataclass(frozen=True)
class Framing:
    """Settings of the framing (section 3)."""

    leading_dle: int = 2
    negated_sum: bool = False
    stuffed_checksum: bool = False
    ignore_spare_select: bool = False

    def checksum(self, data: bytes) -> int:
        """AL-7."""
        return (-sum(data) if self.negated_sum else sum(data)) & 0xFF


class Wrong(Exception):
    """What is wrong with a frame, and how many of its bytes were read."""

    def __init__(self, fault: Json, extent: int) -> None:
        super().__init__(fault["kind"])
        self.error = fault
        self.extent = extent


class More(Exception):
    """The frame is not whole."""


class Decoder:
    """Section 5; the names are those of its pseudocode."""

    def __init__(self, sender: str = "robot", options: Json | None = None) -> None:
        self.sender = sender
        self.framing = Framing(**(options or {}))
        self.held = bytearray()
        self.position = 0
        self.ended = False
        self.read_before = 0
        self.spare = 0
        self.skipped = 0
        self.lent = False
        self.error: Json | None = None
        self.failures = 0  # how often `read` failed (AL-38)
        self.failure = ""  # the kind of the last one

    def push(self, data: bytes) -> None:
        """Takes bytes."""
        self.held += data

    def end(self) -> None:
        """The stream has ended, or the line was silent for longer than `gap`."""
        self.ended = True

    def pending(self) -> int:
        """How many bytes belong to no item yet (AL-52)."""
        return self.skipped + self.spare + len(self.held) - self.lent

    def clear(self) -> None:
        """Forgets what belongs to no item yet; offsets count on."""
        self.position += self.pending()
        self.held.clear()
        self.read_before = self.spare = self.skipped = 0
        self.ended = self.lent = False
        self.error = None

    def next(self) -> Item | None:
        """The next message or error."""
        while True:
            at_mark = self.seek()
            # A second reading is judged by the corrupt frame's own bytes alone.
            if self.is_wrong(bytes(self.held[: self.read_before])):
                self.skip(1)
                continue
            if (at_mark or self.ended) and self.skipped > 0:
                fault = self.error or error("start_mark", offset=self.position, length=self.skipped)
                self.error = None
                item = Item(self.position, self.skipped, error=fault)
                self.position += self.skipped
                self.skipped = 0
                return item
            if not at_mark:
                self.ended = False
                return None
            try:
                message, size, sum_found = self.read(bytes(self.held), self.ended)
            except More:
                return None
            except Wrong as wrong:
                self.failures += 1
                self.failure = wrong.error["kind"]
                first = self.position + self.spare - self.lent
                self.error = wrong.error | {"offset": first + wrong.error["offset"]}
                self.read_before = max(self.read_before, wrong.extent)
                self.skip(1)
                continue
            length = self.spare + size - self.lent
            self.spare = 0
            self.lent = False
            self.remove(size)
            if not self.framing.stuffed_checksum and sum_found == DLE:
                self.held.insert(0, DLE)
                self.lent = True
                self.read_before = max(self.read_before, 1)
            item = Item(self.position, length, message)
            self.position += length
            return item

    def seek(self) -> bool:
        """Removes what cannot belong to a start mark. True: `held` begins with one."""
        while True:
            start = self.held.find(DLE)
            self.skip(len(self.held) if start < 0 else start)
            run = len(self.held) - len(self.held.lstrip(bytes([DLE])))
            after = self.held[run] if run < len(self.held) else None
            superfluous = max(run - self.framing.leading_dle, 0)
            if after == STX and run >= self.framing.leading_dle:
                self.remove_spare(superfluous)
                return True
            if after is None and not self.ended:
                self.remove_spare(superfluous)
                return False
            self.skip(run)
            if after is None:
                return False

    def skip(self, count: int) -> None:
        """`count` bytes belong to no frame, nor do the spare DLEs before them."""
        if count > 0:
            self.skipped += self.spare + count - self.lent
            self.spare = 0
            self.lent = False
            self.remove(count)

    def remove_spare(self, count: int) -> None:
        """`count` DLEs at the beginning are more than a start mark needs."""
        if count > 0:
            self.spare += count - self.lent
            self.lent = False
            self.remove(count)

    def remove(self, count: int) -> None:
        del self.held[:count]
        self.read_before = max(self.read_before - count, 0)

    def is_wrong(self, data: bytes) -> bool:
        try:
            self.read(data, False)
        except Wrong:
            return True
        except More:
            pass
        return False

    def read(self, frame: bytes, ended: bool) -> tuple[Json, int, int]:
        """The message at the beginning, its size on the line, its checksum."""
        limit = CONTROLLER_LIMIT if self.sender == "robot" else HOST_LIMIT

        def byte(at: int) -> int:
            if at < len(frame):
                return frame[at]
            raise Wrong(error("incomplete", offset=0, length=len(frame)), len(frame)) if ended else More

        at = len(frame) - len(frame.lstrip(bytes([DLE]))) + 1  # behind STX
        unstuffed = bytearray()
        while True:
            if byte(at) == DLE:
                if byte(at + 1) == ETX:
                    at += 2
                    break
                if byte(at + 1) != DLE:
                    raise Wrong(error("end_mark", offset=at + 1, found=byte(at + 1)), at + 1)
            if len(unstuffed) == limit:
                raise Wrong(error("too_long", offset=0, limit=limit), limit)
            unstuffed.append(byte(at))
            at += 2 if byte(at) == DLE else 1
        data = bytes(unstuffed)
        found, expected = byte(at), self.framing.checksum(data)
        if found != expected:
            raise Wrong(error("checksum", offset=at, expected=expected, found=found), at)
        at += 1
        if self.framing.stuffed_checksum and found == DLE:
            if byte(at) != DLE:
                raise Wrong(error("end_mark", offset=at, found=byte(at)), at)
            at += 1
        try:
            message = decode_controller(data) if self.sender == "robot" else decode_host(data, self.framing)
        except Wrong as wrong:
            raise Wrong(wrong.error, at) from None
        if self.read_before > 0 and not is_named(message):
            raise Wrong(error("length", offset=0, found=len(data)), at)
        return message, at, found


def words(data: bytes) -> list[int]:
    """Signed words, low byte first (AL-10)."""
    return list(struct.unpack(f"<{len(data) // 2}h", data))


def decode_controller(data: bytes) -> Json:
    """The fields of a message from the controller (AL-29)."""
    length = Wrong(error("length", offset=0, found=len(data)), 0)
    if not data:
        raise length
    control, body = data[0], data[1:]
    marked, mm, code = control >> 7, control >> 5 & 3, control & 7
    if control & 0x18 or not (marked or mm == 1):
        raise Wrong(error("control", offset=0, found=control), 0)
    if mm == 1:
        if len(data) % 2:
            raise length
        start: Json = {"kind": "start", "mode": body[0], "data": words(body[1:])}
        return start | ({"error": code} if code else {}) | ({} if marked else {"marked": False})
    if mm == 3:
        if len(body) not in (0, 5, 29):
            raise length
        return {"kind": "end", "error": code}
    if len(body) not in (5, 29):
        raise length
    segment, percent = struct.unpack("<HH", body[1:5])
    return {
        "kind": "motion",
        "phase": "running" if mm == 0 else "interrupted",
        "error": code,
        "segment_status": body[0],
        "segment": segment,
        "percent": percent,
        "transform": words(body[5:]) or None,
    }


def decode_host(data: bytes, framing: Framing) -> Json:
    """The fields of a message from the host (AL-29)."""
    if not data:
        raise Wrong(error("length", offset=0, found=0), 0)
    if len(data) == 1:
        if data[0] not in REPLIES:
            raise Wrong(error("start_reply", offset=0, found=data[0]), 0)
        return {"kind": "start_reply", "reply": REPLIES[data[0]]}
    exception, select = data[0], data[1]
    if select & 0xC0 and not framing.ignore_spare_select:
        raise Wrong(error("select", offset=0, found=select), 0)
    selected = [bool(select >> axis & 1) for axis in range(AXES)]
    expected = 2 + 2 * sum(selected)
    if len(data) != expected:
        raise Wrong(error("reply_length", offset=0, expected=expected, found=len(data)), 0)
    values = iter(words(data[2:]))
    return {"kind": "reply", "exception": exception, "values": [next(values) if bit else None for bit in selected]}


def is_named(message: Json) -> bool:
    """Whether all codes are named (AL-25)."""
    return (
        message.get("error", 0) <= 6
        and message.get("segment_status", 1) in range(1, 14)
        and message.get("exception", 0) in (0, 253, 254)
        and message.get("mode", 0) < 32
        and message.get("marked", True)
    )


def encode(message: Json, sender: str = "robot", options: Json | None = None) -> bytes:
    """Section 6."""
    framing = Framing(**(options or {}))
    data = encode_controller(message) if sender == "robot" else encode_host(message)
    found = bytes([framing.checksum(data)])
    if framing.stuffed_checksum and found[0] == DLE:
        found *= 2
    stuffed = data.replace(bytes([DLE]), bytes([DLE, DLE]))
    return bytes([DLE] * framing.leading_dle + [STX]) + stuffed + bytes([DLE, ETX]) + found


def encode_controller(message: Json) -> bytes:
    """The data bytes of a message from the controller."""
    default = 0 if message["kind"] == "start" else None
    code = integer(message.get("error", default), 0, 7, "error")
    if message["kind"] == "start":
        fields(message, {"kind", "mode", "data"} | (message.keys() & {"error", "marked"}))
        boolean(message.get("marked", True), "marked")
        values = integers(message["data"], *WORD, range(15), "data")
        mode = integer(message["mode"], 0, 255, "mode")
        return bytes([0xA0 | code, mode]) + struct.pack(f"<{len(values)}h", *values)
    if message["kind"] == "end":
        fields(message, {"kind", "error"})
        return bytes([0xE0 | code])
    if message["kind"] != "motion":
        raise Refused(f"a controller does not send {message['kind']}")
    fields(message, {"kind", "phase", "error", "segment_status", "segment", "percent", "transform"})
    phase = one_of(message["phase"], {"running", "interrupted"}, "phase")
    status = integer(message["segment_status"], 0, 255, "segment_status")
    segment = integer(message["segment"], 0, 0xFFFF, "segment")
    percent = integer(message["percent"], 0, 0xFFFF, "percent")
    transform = message["transform"]
    values = [] if transform is None else integers(transform, *WORD, range(12, 13), "transform")
    control = (0x80 if phase == "running" else 0xC0) | code
    return struct.pack(f"<BBHH{len(values)}h", control, status, segment, percent, *values)


def encode_host(message: Json) -> bytes:
    """The data bytes of a message from the host."""
    if message["kind"] == "start_reply":
        fields(message, {"kind", "reply"})
        reply = one_of(message["reply"], set(REPLIES.values()), "reply")
        return bytes(code for code, name in REPLIES.items() if name == reply)
    if message["kind"] != "reply":
        raise Refused(f"a host does not send {message['kind']}")
    fields(message, {"kind", "exception", "values"})
    exception, values = integer(message["exception"], 0, 255, "exception"), message["values"]
    if not isinstance(values, list) or len(values) != AXES:
        raise Refused("values must be six")
    select = sum(1 << axis for axis, value in enumerate(values) if value is not None)
    chosen = [integer(value, *WORD, "value") for value in values if value is not None]
    return struct.pack(f"<BB{len(chosen)}h", exception, select, *chosen)
