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
    sizes = [size for size in lengths_of(held, is_ours) if size is not None and size <= codec.MAX_RTU]
    needs_more = any(size > len(held) for size in sizes)
    if ended and codec.MIN_RTU <= len(held) <= codec.MAX_RTU and is_right(held) and not (is_stream and needs_more):
        return Found(len(held))
    if not ended and needs_more:
        return Found(waits=True)
    right = [size for size in sizes if size <= len(held) and is_right(held[:size])]
    if right:
        return Found(max(right))
    return Found(waits=needs_more if ended else len(held) <= codec.MAX_RTU)


def lengths_of(held: bytes, is_ours: bool) -> list[int | None]:
    """The lengths that a frame can have that begins so (FM-10): one byte more where that is not known yet, None where only the silence
    shows it."""
    lengths: list[int | None] = []
    for sender in ["client"] if is_ours else ["client", "server"]:
        try:
            lengths.append(codec.rtu_length(held, sender))
        except Incomplete:
            lengths.append(len(held) + 1)
    return lengths


def is_right(frame: bytes) -> bool:
    """Whether its CRC is."""
    return int.from_bytes(frame[-2:], "little") == codec.crc(frame[:-2])


def fault_of(held: bytes) -> Json:
    """The error of bytes that are no request."""
    decoder = codec.Decoder("client", {"framing": "rtu"})
    decoder.push(held)
    decoder.end()
    return decoder.take()[2] or {}
