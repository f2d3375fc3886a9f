"""What a server reads as a request in RTU frames (FM-82, FM-63 of reference/fanuc-hmi-modbus.md)."""

from dataclasses import dataclass

from ..stream import Incomplete, Json
from . import codec


@dataclass
class Found:
    """What stands at the beginning of the bytes: a frame of `size`, a reply of another unit too, or more bytes are needed."""

    size: int = 0
    waits: bool = False


def find(held: bytes, is_ours: bool, ended: bool, is_stream: bool) -> Found:
    """The pseudocode of FM-82; `is_ours`: only a request begins so; `is_stream`: through TCP."""
    sizes: list[int] = []
    needs_more = False
    for sender in ["client"] if is_ours else ["client", "server"]:
        try:
            size = codec.rtu_length(held, sender)
        except Incomplete:
            needs_more = True
            continue
        if size is not None and size <= codec.MAX_RTU:
            sizes.append(size)
            needs_more |= size > len(held)
    if ended and codec.MIN_RTU <= len(held) <= codec.MAX_RTU and is_right(held) and not (is_stream and needs_more):
        return Found(len(held))
    if not ended and needs_more:
        return Found(waits=True)
    right = [size for size in sizes if size <= len(held) and is_right(held[:size])]
    if right:
        return Found(max(right))
    return Found(waits=needs_more if ended else len(held) <= codec.MAX_RTU)


def is_right(frame: bytes) -> bool:
    """Whether its CRC is."""
    return int.from_bytes(frame[-2:], "little") == codec.crc(frame[:-2])


def fault_of(held: bytes) -> Json:
    """The error of bytes that are no request."""
    decoder = codec.Decoder("client", {"framing": "rtu"})
    decoder.push(held)
    decoder.end()
    return decoder.take()[2] or {}
