"""The values of the Python port: what addresses, registers and words mean, apart from any frame (reference/README.md)."""

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from cellwire import fanuc_hmi_modbus as modbus
from cellwire import val2_alter as alter
from cellwire.stream import Json, Refused


def signal(given: Json) -> Any:
    ((name, number),) = given.items()
    found = modbus.place_of(name, number)
    return None if found is None else {"table": found[0], "address": found[1]}


def place(given: Json) -> Any:
    found = modbus.signal_at(given["table"], given["address"])
    return None if found is None else {found[0]: found[1]}


def read_block(given: Json) -> Any:
    block = asdict(modbus.TelemetryBlock.read(given["registers"], given["order"]))
    finite = lambda value: value if math.isfinite(value) else None  # noqa: E731
    return {name: [*map(finite, value)] if isinstance(value, list) else value for name, value in block.items()}


def track(given: list[Json]) -> Any:
    found = modbus.Track()
    samples = [found.add(modbus.TelemetryBlock(**block)) for block in given]
    return [sample if isinstance(sample, str) else asdict(sample) for sample in samples]


def amount(given: Json) -> tuple[float, float]:
    """A length or an angle, and its scale."""
    ((kind, value),) = given.items()
    return math.nan if value is None else value, alter.PER_MM if kind == "mm" else alter.PER_DEGREE


QUESTIONS: dict[str, Callable[[Any], Any]] = {
    "signal": signal,
    "place": place,
    "read": lambda given: modbus.Number(**given["number"]).read(given["registers"]),
    "write": lambda given: modbus.Number(**given["number"]).write(given["value"]),
    "read_text": lambda given: modbus.read_text(given["registers"]),
    "write_text": lambda given: modbus.write_text(given["text"], given["registers"]),
    "read_block": read_block,
    "write_block": lambda given: modbus.TelemetryBlock(**given["block"]).write(given["order"]),
    "assign": lambda given: [list(pair) for pair in modbus.assign([modbus.Slot(**slot) for slot in given])],
    "track": track,
    "word": lambda given: alter.word(*amount(given)),
    "nearest_word": lambda given: alter.nearest_word(*amount(given)),
}


def answer(given: Json) -> Json:
    """The answer to one question."""
    ((question, argument),) = given.items()
    try:
        return {"gives": QUESTIONS[question](argument)}
    except Refused as refused:
        return {"error": str(refused)}
