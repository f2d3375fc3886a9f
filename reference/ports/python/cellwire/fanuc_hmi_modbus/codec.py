"""fanuc-hmi-modbus: frames and PDUs of Modbus. Clauses FM-… are those of reference/fanuc-hmi-modbus.md."""

import struct
from collections.abc import Callable
from typing import Any

from ..stream import Incomplete, Item, Json, Refused, StreamDecoder, error, integer, integers

MAX_PDU = 253
MBAP_LENGTHS = range(2, 255)  # unit and PDU
SHORTEST_TCP, EXCEPTION_TCP = 8, 9
EXCEPTION_LENGTH = 3  # of its unit and PDU
MIN_RTU, MAX_RTU = 4, 256
LOOKED_AT = 520  # bytes that are searched for the next frame
TCP_EXTENT, RTU_EXTENT = 504, 265
COIL_ON = 0xFF00
EXCEPTION = 0x80
MAX_REPLY_BYTES = 250
BITS = (1, 2)
READING = (1, 2, 3, 4, 23)
MAX_READ = {1: 2000, 2: 2000, 3: 125, 4: 125, 23: 125}
MAX_WRITE = {15: 1968, 16: 123, 23: 121}
MAX_WORDS = 125  # of function 8
MAX_OWN = {12: 70, 17: 250}  # bytes after the byte count
MAX_FIFO = 31
BARE = {7, 11, 12, 17}  # requests without anything
NAMED = {1, 2, 3, 4, 5, 6, 8, 15, 16, 20, 21, 22, 23, 24, 43} | BARE
ASKING = {*READING, *BARE, 20, 24}  # functions that only a reply makes sense of
REFERENCE = 6
# The most bytes of a message with runs of registers in files, and those of a run beside its registers.
RUNS = {20: (245, 2), 21: (251, 7)}
IDENTIFICATION = 14  # the MEI type of function 43 that has a shape
MORE = 0xFF


class Wrong(Exception):
    """What is wrong, as an error object."""

    def __init__(self, kind: str, **fields: int) -> None:
        super().__init__(kind)
        self.error = error(kind, **fields)


class Corrupt(Wrong):
    """What is wrong with the frame itself."""


def shift(value: int) -> int:
    """Eight steps of FM-9."""
    for _ in range(8):
        value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


SHIFTED = [shift(byte) for byte in range(256)]


def crc(data: bytes) -> int:
    """FM-9."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ SHIFTED[(value ^ byte) & 0xFF]
    return value


def rtu_length(frame: bytes, sender: str) -> int | None:
    """The bytes of an RTU frame (FM-10); None: only the silence shows it. Raises Incomplete."""
    if len(frame) < 2:
        raise Incomplete(MIN_RTU)
    function = frame[1]
    if function == 22:
        return 10
    fixed: dict[int, int]
    counts: dict[int, tuple[int, int]]
    if sender == "client":
        fixed = {code: 8 for code in range(1, 7)} | {code: 4 for code in BARE} | {24: 6}
        counts = {15: (9, 6), 16: (9, 6), 20: (5, 2), 21: (5, 2), 23: (13, 10)}
    else:
        fixed = {code: 8 for code in (5, 6, 11, 15, 16)} | {code: 5 for code in (7, *range(EXCEPTION + 1, 256))}
        counts = {code: (5, 2) for code in (1, 2, 3, 4, 12, 17, 20, 21, 23)} | {24: (6, 3)}
    if function in counts:
        size, at = counts[function]
        if at >= len(frame):
            raise Incomplete(size)
        return size + frame[at]
    return fixed.get(function)


class Decoder(StreamDecoder):
    """Section 5. `sender` is `client` or `server`."""

    def __init__(self, sender: str = "client", options: Json | None = None) -> None:
        super().__init__()
        self.sender = sender
        self.is_tcp = (options or {}).get("framing", "tcp") == "tcp"
        self.in_noise = False  # the bytes before were corrupt, and where a frame begins is not known yet
        self.corruption: Json | None = None  # the error of corrupt bytes whose end is not known yet
        self.frame = b""  # of the last item: a good one, whether its PDU is or not
        self.excess = 0  # bytes that may belong to the exception before them (FM-89)

    def next(self) -> Item | None:
        if self.ended and not self.held:
            self.excess = 0
        return super().next()

    def take(self) -> tuple[int, Json | None, Json | None]:
        held = bytes(self.held)
        self.frame = b""
        if self.in_noise:
            size = self.extent_tcp(held, 0) if self.is_tcp else self.extent_rtu(held, 0)
            if size > 0:
                return size, None, error("noise", length=size)
            self.in_noise, self.corruption = False, None
        if self.excess > 0:
            size = self.extent_exception(held)
            self.excess = 0
            if size > 0:
                return size, None, error("noise", length=size)
        try:
            size = self.size_tcp(held) if self.is_tcp else self.size_rtu(held)
        except Corrupt as wrong:
            self.corruption = wrong.error
            size = self.extent_tcp(held, self.skipped(held)) if self.is_tcp else self.extent_rtu(held, 1)
            if not self.in_noise:
                self.corruption = None
            return size, None, wrong.error
        self.frame = held[:size]
        header, pdu = split(self.frame, self.is_tcp)
        if self.is_tcp and self.is_exception(held):
            length = int.from_bytes(held[4:6], "big")
            self.excess = abs(length - EXCEPTION_LENGTH)
            if length > EXCEPTION_LENGTH:
                names = header | decode_reply(pdu) | {"expected": EXCEPTION_LENGTH, "found": length}
                return size, None, error("exception_length", **names)
        try:
            return size, header | (decode_request(pdu) if self.sender == "client" else decode_reply(pdu)), None
        except Wrong as wrong:
            return size, None, wrong.error

    def size_tcp(self, held: bytes) -> int:
        """The size of the frame at the beginning (FM-72)."""
        if len(held) < 6:
            raise self.more(held, 7)
        protocol, length = struct.unpack(">HH", held[2:6])
        if protocol != 0:
            raise Corrupt("protocol", found=protocol)
        if length not in MBAP_LENGTHS:
            raise Corrupt("mbap_length", found=length)
        size = int(6 + length)
        if self.is_exception(held):
            size = min(size, EXCEPTION_TCP)
        if len(held) < size:
            raise self.more(held, size)
        return size

    def is_exception(self, held: bytes) -> bool:
        """Whether this is an exception of a function that has two bytes of PDU (FM-89)."""
        code = held[7] if len(held) >= SHORTEST_TCP else 0
        return self.sender == "server" and code > EXCEPTION and code - EXCEPTION in NAMED

    def extent_exception(self, held: bytes) -> int:
        """How many bytes are before the next frame, behind an exception of a wrong length (FM-89)."""
        for at in range(self.excess):
            header = held[at : at + SHORTEST_TCP]
            if len(header) < SHORTEST_TCP:
                if self.ended:
                    return at
                raise Incomplete
            protocol, length = struct.unpack(">HH", header[2:6])
            if protocol == 0 and length in MBAP_LENGTHS and header[7] not in (0, EXCEPTION):
                return at
        return self.excess

    def skipped(self, held: bytes) -> int:
        """From where on the next frame over TCP is looked for: a frame of another protocol, or one that is cut, is skipped whole."""
        length = int.from_bytes(held[4:6], "big")
        return 6 + length if length < MBAP_LENGTHS.stop else 1

    def more(self, held: bytes, expected: int) -> Exception:
        return Corrupt("cut", expected=expected, found=len(held)) if self.ended else Incomplete()

    def extent_tcp(self, held: bytes, start: int) -> int:
        """How many bytes are before the next frame."""
        held = held[:LOOKED_AT]
        for at in range(start, len(held)):
            header = held[at : at + 6]
            if len(header) < 6:
                break
            protocol, length = struct.unpack(">HH", header[2:])
            if protocol != 0 or length not in MBAP_LENGTHS:
                continue
            if at == start and start > 1:
                return at
            try:
                if rtu_length(held[at + 6 :], self.sender) == length + 2:
                    return at
            except Incomplete:
                if not self.ended:
                    break  # behind a place that is not decided none is tried
        return self.extent_without_frame(held, TCP_EXTENT)

    def extent_without_frame(self, held: bytes, extent: int) -> int:
        if len(held) >= LOOKED_AT:
            self.in_noise = True
            return extent
        if self.ended:
            return len(held)
        raise Incomplete

    def size_rtu(self, held: bytes) -> int:
        """The size of the frame at the beginning (FM-73)."""
        try:
            size = rtu_length(held, self.sender)
        except Incomplete as incomplete:
            raise self.more(held, incomplete.args[0]) from None
        if size is None:
            if len(held) > MAX_RTU:
                raise Corrupt("too_long", found=MAX_RTU + 1)
            if not self.ended:
                raise Incomplete
            if len(held) < MIN_RTU:
                raise Corrupt("cut", expected=MIN_RTU, found=len(held))
            size = len(held)
        elif size > MAX_RTU:
            raise Corrupt("too_long", found=size)
        elif len(held) < size:
            raise self.more(held, size)
        found, expected = int.from_bytes(held[size - 2 : size], "little"), crc(held[: size - 2])
        if found != expected:
            raise Corrupt("crc", expected=expected, found=found, length=size)
        return size

    def extent_rtu(self, held: bytes, start: int) -> int:
        """How many bytes are before the next frame: the one that ends first (FM-30)."""
        held = held[:LOOKED_AT]
        found: tuple[int, int] | None = None
        for at in range(start, len(held)):
            try:
                size = rtu_length(held[at:], self.sender)
            except Incomplete:
                continue
            if size is None or size > MAX_RTU or at + size > len(held):
                continue
            whole = held[at : at + size]
            if int.from_bytes(whole[-2:], "little") == crc(whole[:-2]) and (found is None or at + size < found[0]):
                found = (at + size, at)
        if found is not None:
            return found[1]
        return self.extent_without_frame(held, RTU_EXTENT)


def split(frame: bytes, is_tcp: bool) -> tuple[Json, bytes]:
    """The header's fields, and the PDU."""
    if is_tcp:
        return {"transaction": int.from_bytes(frame[:2], "big"), "unit": frame[6]}, frame[7:]
    return {"unit": frame[0]}, frame[1:-2]


def wrap(pdu: bytes, unit: int, transaction: int | None) -> bytes:
    """The frame of a PDU; without a transaction it is one of RTU."""
    body = bytes([unit]) + pdu
    if transaction is None:
        return body + crc(body).to_bytes(2, "little")
    return struct.pack(">HHH", transaction, 0, len(body)) + body


class Pdu:
    """A PDU that is read from left to right."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.function = data[0]
        self.at = 1

    def exactly(self, expected: int) -> None:
        if len(self.data) != expected:
            raise Wrong("pdu_length", function=self.function, expected=expected, found=len(self.data))

    def u8(self) -> int:
        return self.number(1)

    def u16(self) -> int:
        return self.number(2)

    def number(self, size: int) -> int:
        """The next number, if it is there."""
        end = self.at + size
        if len(self.data) < end:
            self.exactly(end)
        value = int.from_bytes(self.data[self.at : end], "big")
        self.at = end
        return value

    def quantity(self, most: int) -> int:
        found = self.u16()
        if not 1 <= found <= most:
            raise Wrong("quantity", function=self.function, found=found, max=most)
        return found

    def coil(self) -> bool:
        found = self.u16()
        if found not in (0, COIL_ON):
            raise Wrong("coil_value", found=found)
        return found == COIL_ON

    def registers(self) -> list[int]:
        return list(struct.unpack(f">{len(self.data[self.at :]) // 2}H", self.data[self.at :]))

    def bits(self) -> list[bool]:
        return [bool(byte >> bit & 1) for byte in self.data[self.at :] for bit in range(8)]

    def head(self, size: int) -> bytes:
        """The next bytes, if all are there."""
        self.number(size)
        return self.data[self.at - size : self.at]

    def words(self, quantity: int, size: int) -> list[int]:
        """So many registers in the next bytes, if all are there."""
        return list(struct.unpack_from(f">{quantity}H", self.head(size)))

    def counted(self) -> int:
        """The byte count of a reply, and exactly so many bytes (FM-13)."""
        found = self.u8()
        most = MAX_OWN.get(self.function, MAX_REPLY_BYTES)
        if not 1 <= found <= most or (self.function in READING and self.function not in BITS and found % 2):
            raise Wrong("reply_byte_count", function=self.function, found=found)
        self.exactly(2 + found)
        return found

    def raw(self) -> Json:
        return {"function": self.function, "data": list(self.data[1:])}

    def written_values(self, quantity: int) -> list[Any]:
        """The byte count and the values of a request that writes (FM-12)."""
        expected = -(-quantity // 8) if self.function == 15 else 2 * quantity
        found = self.u8()
        if found != expected:
            raise Wrong("byte_count", function=self.function, expected=expected, found=found)
        self.exactly(self.at + found)
        return self.bits()[:quantity] if self.function == 15 else self.registers()


def is_identification(pdu: Pdu) -> bool:
    return pdu.data[:2] == bytes([43, IDENTIFICATION])


def decode_diagnostic(pdu: Pdu) -> Json:
    """Function 8, both ways (FM-96)."""
    pdu.exactly(max(5, len(pdu.data) | 1))
    return {"function": 8, "subfunction": pdu.u16(), "values": pdu.registers()}


def decode_identification(pdu: Pdu) -> Json:
    """The reply of function 43 (FM-97)."""
    if len(pdu.data) < 7:
        pdu.exactly(7)
    pdu.at = 2
    message: Json = {"function": 43, "category": pdu.u8(), "conformity": pdu.u8()}
    more = pdu.u8()
    if more not in (0, MORE):
        raise Wrong("more_follows", found=more)
    message |= {"more": more == MORE, "next": pdu.u8(), "objects": []}
    for _ in range(pdu.u8()):
        number, size = divmod(pdu.u16(), 256)
        end = pdu.at + size
        if len(pdu.data) < end:
            pdu.exactly(end)
        message["objects"].append({"id": number, "text": pdu.data[pdu.at : end].decode("latin-1")})
        pdu.at = end
    pdu.exactly(pdu.at)
    return message


def decode_runs(pdu: Pdu, is_reply: bool) -> Json:
    """Functions 20 and 21 (FM-104)."""
    size = pdu.u8()
    pdu.exactly(2 + size)
    left, around = RUNS[pdu.function]
    found: list[Any] = []
    while not found or pdu.at < len(pdu.data):
        length = 1
        run: Json = {}
        if pdu.function == 20 and is_reply:
            length, reference = pdu.head(2)
            quantity = max(length - 1, 0) // 2
            values = pdu.words(quantity, max(length - 1, 0))
        else:
            reference, *words = pdu.head(7)
            file, record, quantity = (256 * high + low for high, low in zip(words[::2], words[1::2], strict=True))
            values = pdu.words(quantity, 2 * quantity) if pdu.function == 21 else []
            run = {"file": file, "record": record} | ({"values": values} if pdu.function == 21 else {"quantity": quantity})
        if reference != REFERENCE:
            raise Wrong("reference_type", function=pdu.function, found=reference)
        if length > 0 and length % 2 == 0:
            raise Wrong("reply_byte_count", function=pdu.function, found=length)
        most = max(left - around, 0) // 2
        if not 1 <= quantity <= most:
            raise Wrong("quantity", function=pdu.function, found=quantity, max=most)
        left -= around + 2 * quantity
        found.append(run or values)
    name = "records" if pdu.function == 21 else "contents" if is_reply else "ranges"
    return {"function": pdu.function, name: found}


def decode_events(pdu: Pdu) -> Json:
    """The replies of functions 7, 11, 12 and 24 (FM-103, FM-105)."""
    function = pdu.function
    if function == 7:
        pdu.exactly(2)
        return {"function": 7, "status": pdu.u8()}
    if function == 11:
        pdu.exactly(5)
        return {"function": 11, "status": pdu.u16(), "events": pdu.u16()}
    if function == 12:
        size = pdu.counted()
        if size < 6:
            raise Wrong("reply_byte_count", function=12, found=size)
        message: Json = {"function": 12, "status": pdu.u16(), "events": pdu.u16(), "messages": pdu.u16()}
        return message | {"log": list(pdu.data[pdu.at :])}
    if len(pdu.data) < 5:
        pdu.exactly(5)
    size, quantity = pdu.u16(), pdu.u16()
    if quantity > MAX_FIFO:
        raise Wrong("quantity", function=24, found=quantity, max=MAX_FIFO)
    if size != 2 + 2 * quantity:
        raise Wrong("byte_count", function=24, expected=2 + 2 * quantity, found=size)
    pdu.exactly(3 + size)
    return {"function": 24, "registers": pdu.registers()}


def decode_single(pdu: Pdu) -> Json:
    """Functions 5, 6 and 22, whose replies repeat the request."""
    pdu.exactly(7 if pdu.function == 22 else 5)
    message: Json = {"function": pdu.function, "address": pdu.u16()}
    if pdu.function == 5:
        return message | {"value": pdu.coil()}
    if pdu.function == 6:
        return message | {"value": pdu.u16()}
    return message | {"and": pdu.u16(), "or": pdu.u16()}


def decode_request(data: bytes) -> Json:
    """FM-32."""
    pdu = Pdu(data)
    function = pdu.function
    if function == 0 or function >= EXCEPTION:
        raise Wrong("function", found=function)
    if function in (1, 2, 3, 4):
        pdu.exactly(5)
        return {"function": function, "address": pdu.u16(), "quantity": pdu.quantity(MAX_READ[function])}
    if function in (5, 6, 22):
        return decode_single(pdu)
    if function in (15, 16):
        address = pdu.u16()
        return {
            "function": function,
            "address": address,
            "values": pdu.written_values(pdu.quantity(MAX_WRITE[function])),
        }
    if function == 23:
        # All of the first three are there before the first quantity is looked at.
        if len(data) < 7:
            address, _, _ = pdu.u16(), pdu.u16(), pdu.u16()
        address, quantity, write_address = pdu.u16(), pdu.quantity(MAX_READ[23]), pdu.u16()
        values = pdu.written_values(pdu.quantity(MAX_WRITE[23]))
        return {
            "function": function,
            "address": address,
            "quantity": quantity,
            "write_address": write_address,
            "values": values,
        }
    if function == 8:
        return decode_diagnostic(pdu)
    if function in BARE:
        pdu.exactly(1)
        return {"function": function}
    if function in RUNS:
        return decode_runs(pdu, False)
    if function == 24:
        pdu.exactly(3)
        return {"function": 24, "address": pdu.u16()}
    if is_identification(pdu):
        pdu.exactly(4)
        return {"function": 43, "category": data[2], "object": data[3]}
    return pdu.raw()


def decode_reply(data: bytes) -> Json:
    """FM-32."""
    pdu = Pdu(data)
    function = pdu.function
    if function in (0, EXCEPTION):
        raise Wrong("function", found=function)
    if function > EXCEPTION:
        pdu.exactly(2)
        return {"function": function - EXCEPTION, "exception": pdu.u8()}
    if function in (7, 11, 12, 24):
        return decode_events(pdu)
    if function in RUNS:
        return decode_runs(pdu, True)
    if function in MAX_READ or function == 17:
        pdu.counted()
        if function == 17:
            return {"function": 17, "id": list(data[2:])}
        return (
            {"function": function, "bits": pdu.bits()}
            if function <= 2
            else {"function": function, "registers": pdu.registers()}
        )
    if function in (5, 6, 22):
        return decode_single(pdu)
    if function in (15, 16):
        pdu.exactly(5)
        return {"function": function, "address": pdu.u16(), "quantity": pdu.quantity(MAX_WRITE[function])}
    if function == 8:
        return decode_diagnostic(pdu)
    if is_identification(pdu):
        return decode_identification(pdu)
    return pdu.raw()


def encode(message: Json, sender: str = "client", options: Json | None = None) -> bytes:
    """Section 6."""
    pdu = encode_request(message) if sender == "client" else encode_reply(message)
    written = decode_request(pdu) if sender == "client" else decode_reply(pdu)
    if message.keys() - {"transaction", "unit"} != written.keys():
        raise Refused("a key that the message does not have")
    is_rtu = (options or {}).get("framing") == "rtu"
    if is_rtu and "transaction" in message:
        raise Refused("a frame of RTU has no transaction")
    return wrap(pdu, integer(message["unit"], 0, 255, "unit"), None if is_rtu else u16(message["transaction"]))


def u16(value: Any) -> int:
    return integer(value, 0, 0xFFFF, "a word")


def run(address: Any, quantity: Any, most: int) -> bytes:
    """An address and a quantity of at most `most` (FM-36)."""
    first, count = u16(address), integer(quantity, 1, most, "a quantity")
    if first + count > 0x10000:
        raise Refused("the last address is beyond 65535")
    return struct.pack(">HH", first, count)


def truth(value: Any) -> bool:
    if value not in (0, 1):
        raise Refused("a bit is true, false, 1 or 0")
    return bool(value)


def pack_bits(values: Any) -> bytes:
    """FM-8."""
    bits = [truth(value) for value in values]
    return bytes(sum(bit << at for at, bit in enumerate(bits[first : first + 8])) for first in range(0, len(bits), 8))


def pack_registers(values: Any) -> bytes:
    return struct.pack(f">{len(values)}H", *map(u16, values))


def counted(data: bytes) -> bytes:
    return bytes([len(data)]) + data


def encode_single(message: Json) -> bytes:
    """Functions 5, 6 and 22."""
    function = message["function"]
    if function == 22:
        return struct.pack(">BHHH", 22, *(u16(message[name]) for name in ("address", "and", "or")))
    value = (COIL_ON if truth(message["value"]) else 0) if function == 5 else u16(message["value"])
    return struct.pack(">BHH", function, u16(message["address"]), value)


def function_of(message: Json) -> int:
    return integer(message["function"], 1, EXCEPTION - 1, "function")


def encode_raw(message: Json) -> bytes:
    """A function that the table does not name."""
    function = function_of(message)
    data = integers(message["data"], 0, 255, range(MAX_PDU), "data")
    if function in NAMED and (function != 43 or data[:1] == [IDENTIFICATION]):
        raise Refused(f"function {function} has a shape of its own")
    return bytes([function, *data])


def encode_diagnostic(message: Json) -> bytes:
    """Function 8, both ways."""
    values = message["values"]
    integer(len(values), 1, MAX_WORDS, "a quantity")
    return struct.pack(">BH", 8, u16(message["subfunction"])) + pack_registers(values)


def u8(value: Any) -> int:
    return integer(value, 0, 0xFF, "a byte")


def encode_identification(message: Json) -> bytes:
    """The reply of function 43."""
    listed = b""
    if not isinstance(message["objects"], list):
        raise Refused("objects are a list")
    for item in message["objects"]:
        if item.keys() != {"id", "text"}:
            raise Refused("an object has id and text")
        try:
            value = item["text"].encode("latin-1")
        except UnicodeEncodeError as wrong:
            raise Refused("a character beyond U+00FF") from wrong
        listed += bytes([u8(item["id"]), u8(len(value))]) + value
    more = MORE if truth(message["more"]) else 0
    head = [43, IDENTIFICATION, u8(message["category"]), u8(message["conformity"]), more, u8(message["next"])]
    pdu = bytes([*head, u8(len(message["objects"]))]) + listed
    if len(pdu) > MAX_PDU:
        raise Refused("more objects than a PDU has")
    return pdu


def encode_runs(message: Json, name: str) -> bytes:
    """Functions 20 and 21."""
    runs = message[name]
    if not isinstance(runs, list) or not runs:
        raise Refused("runs are a list, which is not empty")
    left, around = RUNS[message["function"]]
    listed = b""
    for run in runs:
        values = run
        if name != "contents":
            if run.keys() != {"file", "record", "quantity" if name == "ranges" else "values"}:
                raise Refused("a run has a file, a record and its registers")
            values = run.get("values", [])
        if not isinstance(values, list):
            raise Refused("registers are a list")
        quantity = integer(run["quantity"] if name == "ranges" else len(values), 1, max(left - around, 0) // 2, "a quantity")
        left -= around + 2 * quantity
        if name == "contents":
            listed += bytes([1 + 2 * quantity, REFERENCE])
        else:
            listed += struct.pack(">BHHH", REFERENCE, u16(run["file"]), u16(run["record"]), quantity)
        listed += pack_registers(values)
    if 2 + len(listed) > MAX_PDU:
        raise Refused("more runs than a PDU has")
    return bytes([message["function"]]) + counted(listed)


def encode_events(message: Json) -> bytes:
    """The replies of functions 7, 11, 12 and 24."""
    function = message["function"]
    if function == 7:
        return bytes([7, u8(message["status"])])
    if function == 24:
        values = message["registers"]
        integer(len(values), 0, MAX_FIFO, "a quantity")
        return struct.pack(">BHH", 24, 2 + 2 * len(values), len(values)) + pack_registers(values)
    counters = struct.pack(">HH", u16(message["status"]), u16(message["events"]))
    if function == 11:
        return bytes([11]) + counters
    log = integers(message["log"], 0, 255, range(MAX_OWN[12] - 5), "log")
    return bytes([12]) + counted(counters + struct.pack(">H", u16(message["messages"])) + bytes(log))


def encode_request(message: Json) -> bytes:
    function = function_of(message)
    if "data" in message:
        return encode_raw(message)
    if function in (1, 2, 3, 4):
        return bytes([function]) + run(message["address"], message["quantity"], MAX_READ[function])
    if function in (5, 6, 22):
        return encode_single(message)
    pack: Callable[[Any], bytes] = pack_bits if function == 15 else pack_registers
    if function in (15, 16):
        values = message["values"]
        return bytes([function]) + run(message["address"], len(values), MAX_WRITE[function]) + counted(pack(values))
    if function == 23:
        values = message["values"]
        reads = run(message["address"], message["quantity"], MAX_READ[23])
        return bytes([23]) + reads + run(message["write_address"], len(values), MAX_WRITE[23]) + counted(pack(values))
    if function == 8:
        return encode_diagnostic(message)
    if function in BARE:
        return bytes([function])
    if function in RUNS:
        return encode_runs(message, "ranges" if function == 20 else "records")
    if function == 24:
        return struct.pack(">BH", 24, u16(message["address"]))
    if function == 43:
        return bytes([43, IDENTIFICATION, u8(message["category"]), u8(message["object"])])
    raise Refused(f"function {function} needs data")


def encode_reply(message: Json) -> bytes:
    function = function_of(message)
    if "exception" in message:
        return bytes([function + EXCEPTION, integer(message["exception"], 0, 255, "exception")])
    if "data" in message:
        return encode_raw(message)
    if function in MAX_READ:
        values = message["bits" if function <= 2 else "registers"]
        integer(len(values), 1, MAX_READ[function], "a quantity")
        return bytes([function]) + counted(pack_bits(values) if function <= 2 else pack_registers(values))
    if function in (5, 6, 22):
        return encode_single(message)
    if function in (15, 16):
        return bytes([function]) + run(message["address"], message["quantity"], MAX_WRITE[function])
    if function == 8:
        return encode_diagnostic(message)
    if function == 17:
        return bytes([17]) + counted(bytes(integers(message["id"], 0, 255, range(1, MAX_OWN[17] + 1), "id")))
    if function in (7, 11, 12, 24):
        return encode_events(message)
    if function in RUNS:
        return encode_runs(message, "contents" if function == 20 else "records")
    if function == 43:
        return encode_identification(message)
    raise Refused(f"function {function} needs data")
