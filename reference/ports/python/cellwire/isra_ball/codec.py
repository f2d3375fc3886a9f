"""isra-ball: packets of the ball. Clauses IB-… are those of reference/isra-ball.md."""

from ..stream import (
    Incomplete,
    Json,
    Refused,
    StreamDecoder,
    error,
    fields,
    integer,
    integers,
    one_of,
)

POLL = 0x05
HEADER_MASK = 0x55
MAX_LEN = 259  # IB-8
DATA_LEN = 8
STATUSES = {(0, 0): "fresh", (1, 0): "old", (0, 1): "reserved", (1, 1): "reserved"}  # (ab1, ab0)


def header(n: int) -> bytes:
    """The three bytes that announce n data bytes (IB-5)."""
    return bytes([n, -n & 0xFF, n ^ HEADER_MASK])


def checksum(n: int, data: bytes) -> int:
    """IB-6."""
    return -(n + sum(data)) & 0xFF


class Decoder(StreamDecoder):
    """Section 5."""

    def __init__(self, sender: str | None = None, options: Json | None = None) -> None:
        super().__init__()

    def take(self) -> tuple[int, Json | None, Json | None]:
        held = self.held
        n = held[0]
        size = n + 4
        if header(n).startswith(held[:3]):
            if len(held) >= size:
                data, found = bytes(held[3 : 3 + n]), held[3 + n]
                expected = checksum(n, data)
                if found == expected:
                    return size, decode_data(data), None
                return self.extent(), None, error("checksum", offset=3 + n, expected=expected, found=found)
            if not self.ended:
                raise Incomplete
            extent = self.extent()
            return extent, None, error("incomplete", expected=size, found=extent)
        extent = self.extent()
        return extent, None, error("noise", length=extent)

    def extent(self) -> int:
        """How many bytes an error covers (IB-15, IB-16)."""
        held = self.held
        for place in range(1, len(held) - 2):
            if held[place : place + 3] == header(held[place]):
                return min(place, MAX_LEN)
        if len(held) >= MAX_LEN + 3:
            return MAX_LEN
        if self.ended:
            return min(len(held), MAX_LEN)
        raise Incomplete


def decode_data(data: bytes) -> Json:
    """The data bytes of a packet (section 4.2, IB-13)."""
    if len(data) != DATA_LEN:
        return {"data": list(data)}
    ident = data[0]
    values = [byte - 256 if byte > 127 else byte for byte in data[1:7]]
    return {
        "sensor_type": ident >> 4 & 7,
        "sensor": ident & 7,
        "status": STATUSES[ident >> 7, ident >> 3 & 1],
        "force": values[:3],
        "moment": values[3:],
        "keys": data[7],
    }


def encode(message: Json, sender: str | None = None, options: Json | None = None) -> bytes:
    """Section 6."""
    if "data" in message:
        raise Refused("only packets with eight data bytes are written")
    fields(message, {"sensor_type", "sensor", "status", "force", "moment", "keys"})
    status = one_of(message["status"], set(STATUSES.values()), "status")
    ab1, ab0 = next(bits for bits, name in STATUSES.items() if name == status)
    sensor_type, sensor = (
        integer(message["sensor_type"], 0, 7, "sensor_type"),
        integer(message["sensor"], 0, 7, "sensor"),
    )
    three = range(3, 4)
    values = integers(message["force"], -128, 127, three, "force") + integers(
        message["moment"], -128, 127, three, "moment"
    )
    keys = integer(message["keys"], 0, 255, "keys")
    data = bytes([ab1 << 7 | sensor_type << 4 | ab0 << 3 | sensor, *(value & 0xFF for value in values), keys])
    return header(DATA_LEN) + data + bytes([checksum(DATA_LEN, data)])
