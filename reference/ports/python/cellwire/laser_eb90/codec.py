"""laser-eb90: frames of the laser. Clauses LE-… are those of reference/laser-eb90.md."""

import math
import struct
from dataclasses import dataclass, field
from typing import Any, Literal

from ..stream import Incomplete, Json, Refused, StreamDecoder, error, fields, integer

HEAD = bytes([0xEB, 0x90, 0x82])
FLAG, MARK = 0xF0, 0x90
MAX_PAYLOAD = 512  # LE-12
TAILS = {"printed": bytes([0x82]), "etx": bytes([0x83]), "either": bytes([0x82, 0x83])}
SIZES = {"f32": 4, "i16": 2, "u8": 1, "char": 1}


@dataclass(frozen=True)
class Profile:
    """LE-101."""

    tail: str = "printed"
    flag: str = "separate"
    tags: dict[str, int] = field(default_factory=lambda: {"f32": 0xF0, "i16": 0xF1, "u8": 0xF2, "char": 0xF3})
    checksum: str = "u8"
    checksum_negated: bool = False
    checksum_with_flag: bool = False
    byte_order: str = "little"

    def __post_init__(self) -> None:
        if len(set(self.tags.values())) != len(SIZES) or not all(0 <= tag <= 0xFF for tag in self.tags.values()):
            raise ValueError("the tags are four different bytes (LE-16)")

    @property
    def sum_size(self) -> int:
        """The bytes of the check."""
        return 1 if self.checksum == "u8" else 2

    @property
    def is_separate(self) -> bool:
        """Whether a flag is before the payload (LE-8)."""
        return self.flag == "separate"

    def name(self, tag: int) -> str | None:
        """The type that a tag announces."""
        return next((name for name, number in self.tags.items() if number == tag), None)

    def check(self, payload: bytes) -> int:
        """LE-13."""
        total = sum(payload) + (FLAG if self.checksum_with_flag and self.is_separate else 0)
        return (-total if self.checksum_negated else total) & (0xFF if self.sum_size == 1 else 0xFFFF)

    def sum_order(self) -> Literal["little", "big"]:
        """The byte order of the check."""
        return "big" if self.checksum == "u16_be" else "little"

    def format(self, name: str, count: int) -> str:
        """The layout of an item's values."""
        return ("<" if self.byte_order == "little" else ">") + str(count) + {"f32": "f", "i16": "h"}[name]


class Wrong(Exception):
    """A frame is corrupt, which shows within `examined` bytes (LE-30)."""

    def __init__(self, examined: int, kind: str, **fields: int) -> None:
        super().__init__(kind)
        self.examined = examined
        self.error = error(kind, **fields)


def find_head(data: bytes) -> int:
    """Where the first head is, whole or cut off by the end."""
    return next((at for at in range(len(data)) if HEAD.startswith(data[at : at + 3])), len(data))


class Decoder(StreamDecoder):
    """Section 5."""

    def __init__(self, sender: str = "host", options: Json | None = None) -> None:
        super().__init__()
        self.profile = Profile(**(options or {}))

    def take(self) -> tuple[int, Json | None, Json | None]:
        held = bytes(self.held)
        try:
            if not held.startswith(HEAD):
                return self.take_no_head(held)
            size, message = self.read(held)
            return size, message, None
        except Incomplete:
            if not self.ended:
                raise
            return len(held), None, error("incomplete", held=len(held))
        except Wrong as wrong:
            return 1 + find_head(held[1 : wrong.examined]), None, wrong.error

    def take_no_head(self, held: bytes) -> tuple[int, Json | None, Json | None]:
        """Bytes before the first head (LE-32)."""
        begin = find_head(held)
        if begin >= MAX_PAYLOAD:
            begin = MAX_PAYLOAD
        elif not held[begin:].startswith(HEAD):
            raise Incomplete
        return begin, None, error("no_head", skipped=begin)

    def read(self, held: bytes) -> tuple[int, Json]:
        """The frame at the beginning, and its size."""
        profile = self.profile

        def byte(at: int) -> int:
            if at >= len(held):
                raise Incomplete
            return held[at]

        at = len(HEAD)
        if profile.is_separate:
            if byte(at) != FLAG:
                raise Wrong(4, "flag", offset=at, expected=FLAG, found=held[at])
            at += 1
        if profile.name(byte(at)) is None:
            raise Wrong(at + 1, "tag", offset=0, found=held[at])
        payload = bytearray()
        while True:
            last = at
            if byte(at) == MARK:
                last = at + 1
                if byte(last) in TAILS[profile.tail]:
                    break
                if byte(last) != MARK:
                    raise Wrong(last + 1, "stuffing", offset=last, found=held[last])
            if len(payload) == MAX_PAYLOAD:
                raise Wrong(last + 1, "too_long", offset=last, limit=MAX_PAYLOAD)
            payload.append(held[at])
            at = last + 1
        check_at = at + 2
        size = check_at + profile.sum_size
        byte(size - 1)
        found = int.from_bytes(held[check_at:size], profile.sum_order())
        expected = profile.check(bytes(payload))
        if found != expected:
            raise Wrong(size, "checksum", offset=check_at, expected=expected, found=found)
        return size, {"items": decode_items(bytes(payload), profile, size)}


def decode_items(payload: bytes, profile: Profile, examined: int) -> list[Json]:
    """The items of a payload (section 4.1)."""
    items = []
    at = 0
    while at < len(payload):
        name = profile.name(payload[at])
        if name is None:
            raise Wrong(examined, "tag", offset=at, found=payload[at])
        left = len(payload) - at
        count = payload[at + 1] if left > 1 else 0
        needed = 2 + count * SIZES[name]
        if left < needed:
            raise Wrong(examined, "item", offset=at, needed=needed, found=left)
        items.append({name: decode_values(name, payload[at + 2 : at + needed], count, profile)})
        at += needed
    return items


def decode_values(name: str, data: bytes, count: int, profile: Profile) -> Any:
    """The values of an item; what is no finite number is None (LE-35)."""
    if name == "char":
        return data.decode("latin-1")
    if name == "u8":
        return list(data)
    values = struct.unpack(profile.format(name, count), data)
    return [value if math.isfinite(value) else None for value in values]


def encode(message: Json, sender: str = "host", options: Json | None = None) -> bytes:
    """Section 6."""
    profile = Profile(**(options or {}))
    fields(message, {"items"})
    payload = b"".join(encode_item(item, profile) for item in message["items"])
    if not 0 < len(payload) <= MAX_PAYLOAD:
        raise Refused(f"a payload has 1 to {MAX_PAYLOAD} bytes, not {len(payload)}")
    head = HEAD + (bytes([FLAG]) if profile.is_separate else b"")
    stuffed = payload.replace(bytes([MARK]), bytes([MARK, MARK]))
    tail = bytes([MARK, TAILS[profile.tail][0]])
    return head + stuffed + tail + profile.check(payload).to_bytes(profile.sum_size, profile.sum_order())


def is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def text(value: Any) -> str:
    if not isinstance(value, str):
        raise Refused("characters are a string")
    return value


def encode_item(item: Json, profile: Profile) -> bytes:
    """A tag, a count, and the values."""
    if len(item) != 1 or not item.keys() <= SIZES.keys():
        raise Refused("an item has one type")
    ((name, values),) = item.items()
    if len(values) > 255:
        raise Refused("an item has up to 255 values")
    try:
        if name == "char":
            data = text(values).encode("latin-1")
        elif name == "u8":
            data = bytes(integer(value, 0, 255, "u8") for value in values)
        elif name == "i16":
            data = struct.pack(profile.format(name, len(values)), *(integer(v, -0x8000, 0x7FFF, "i16") for v in values))
        elif all(is_finite(value) for value in values):
            data = struct.pack(profile.format(name, len(values)), *values)
        else:
            raise Refused("a float is a finite number")
    except (OverflowError, UnicodeEncodeError) as wrong:
        raise Refused(str(wrong)) from wrong
    return bytes([profile.tags[name], len(values)]) + data
