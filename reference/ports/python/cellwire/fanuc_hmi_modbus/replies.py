"""What a client takes for the beginning of a reply in RTU frames (FM-86 of reference/fanuc-hmi-modbus.md)."""

from enum import Enum, auto

from ..stream import Incomplete, Json
from . import codec
from .requests import is_right


class Begins(Enum):
    """What begins with some bytes."""

    PART = auto()
    WHOLE = auto()
    OTHER = auto()


def begins_reply(held: bytes, request: Json, any_unit: bool) -> bool:
    """Whether the rest of the reply may follow these bytes."""
    found = [begins(held[at:], request, any_unit) for at in range(len(held))]
    return Begins.PART in found[:1] or Begins.PART in found and Begins.WHOLE not in found


def begins(data: bytes, request: Json, any_unit: bool) -> Begins:
    """Whether a frame with the reply to the request begins with these bytes."""
    if not any_unit and data[0] != request["unit"]:
        return Begins.OTHER
    if len(data) > 1 and data[1] & ~codec.EXCEPTION != request["function"]:
        return Begins.OTHER
    is_whole = len(data) <= codec.MAX_RTU and len(data) >= codec.MIN_RTU and is_right(data)
    try:
        size = codec.rtu_length(data, "server")
    except Incomplete:
        return Begins.PART
    if size is None:
        return Begins.WHOLE if is_whole else Begins.PART
    if size < len(data) or not has_asked_count(data, request):
        return Begins.OTHER
    if size > len(data):
        return Begins.PART
    return Begins.WHOLE if is_whole else Begins.OTHER


def has_asked_count(data: bytes, request: Json) -> bool:
    """Whether the reply to a read, as far as it has come, counts the bytes that were asked for."""
    if len(data) < 3 or data[1] >= codec.EXCEPTION or "quantity" not in request:
        return True
    return data[2] == asked_bytes(request)


def asked_bytes(request: Json) -> int:
    """How many bytes of data the reply to a read has."""
    quantity: int = request["quantity"]
    return -(-quantity // 8) if request["function"] in codec.BITS else 2 * quantity


def is_mirrored(request: Json) -> bool:
    """Whether a reply can begin with the bytes of the request (FM-93)."""
    if request["function"] in codec.READING:
        return bool(request["address"] >> 8 == asked_bytes(request))
    if request["function"] == 24:
        return bool(request["address"] <= 2 + 2 * codec.MAX_FIFO)
    return request["function"] not in (15, 16, 20)
