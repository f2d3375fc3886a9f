"""The testee of the Python port: reference/ports/README.md describes what it reads and writes."""

import json
import sys
from collections.abc import Callable
from typing import Protocol

from links import fanuc_hmi_modbus, isra_ball, kawasaki_msg, laser_eb90, mmacell_proto, val2_alter, val2_viewer
from links.stream import Item, Json, Refused


class Decoder(Protocol):
    """What the decoders of all links can do."""

    def push(self, data: bytes) -> None: ...
    def end(self) -> None: ...
    def next(self) -> Item | None: ...


class Link(Protocol):
    """What the modules of all links have."""

    @property
    def Decoder(self) -> Callable[..., Decoder]: ...
    @property
    def encode(self) -> Callable[..., bytes]: ...


LINKS: dict[str, Link] = {
    "fanuc-hmi-modbus": fanuc_hmi_modbus,
    "isra-ball": isra_ball,
    "kawasaki-msg": kawasaki_msg,
    "laser-eb90": laser_eb90,
    "mmacell-proto": mmacell_proto,
    "val2-alter": val2_alter,
    "val2-viewer": val2_viewer,
}


def sides(request: Json) -> Json:
    """The arguments that choose a side and its settings."""
    return {"options": request["options"]} | ({"sender": request["from"]} if "from" in request else {})


def decode(link: Link, request: Json) -> Json:
    """Everything that the decoder makes of the bytes."""
    decoder = link.Decoder(**sides(request))
    items: list[Json] = []

    def drain(end: bool) -> None:
        while (item := decoder.next()) is not None:
            shown: Json = {"offset": item.offset, "length": item.length}
            shown |= {"end": True} if end else {}
            shown |= {"message": item.message} if item.error is None else {"error": item.error}
            items.append(shown)

    *parts, rest = request["hex"].split("|")
    for part in [*parts, rest]:
        data = bytes.fromhex(part)
        size = request["read"] or max(len(data), 1)
        for first in range(0, len(data), size):
            decoder.push(data[first : first + size])
            drain(False)
        if part is not rest:
            decoder.end()
            drain(True)
    return {"items": items}


def encode(link: Link, request: Json) -> Json:
    """The bytes of a message."""
    try:
        return {"hex": link.encode(request["message"], **sides(request)).hex().upper()}
    except Refused as refused:
        return {"refused": str(refused)}
    except (AttributeError, KeyError, TypeError) as wrong:
        return {"refused": f"no message of this link: {wrong!r}"}


TASKS: dict[str, Callable[[Link, Json], Json]] = {"decode": decode, "stream": decode, "encode": encode}


def main() -> None:
    for line in sys.stdin:
        request = json.loads(line)
        link, task = LINKS.get(request["link"]), TASKS.get(request["task"])
        if link is None or task is None:
            answer = {"skipped": "not implemented"}
        else:
            answer = task(link, request)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
