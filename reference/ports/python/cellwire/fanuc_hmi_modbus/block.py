"""The telemetry block, and samples in the order in which they were read (section 4.4 of reference/fanuc-hmi-modbus.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..stream import Refused
from .typed import LOW_FIRST, Number, join, signed, split

BLOCK_LEN = 37  # FM-22: function 3, address 0
PERIOD = 8_000_000  # of the task, in nanoseconds
RESTARTED = 2**31  # FM-23
REALS = {"position": 3, "wpr": 3, "quaternion": 4, "velocity": 3, "quaternion_rate": 4}  # FM-71
FIRST_REAL = 3


@dataclass(frozen=True)
class TelemetryBlock:
    """FM-71: mm, degrees, %, mm/s, 1/s."""

    life_counter: int
    override: int
    position: list[float]
    wpr: list[float]
    quaternion: list[float]
    velocity: list[float]
    quaternion_rate: list[float]

    @staticmethod
    def read(registers: Sequence[int], order: str = LOW_FIRST) -> "TelemetryBlock":
        """The block of 37 registers; raises Refused."""
        if len(registers) != BLOCK_LEN:
            raise Refused(f"a block has {BLOCK_LEN} registers, not {len(registers)}")
        real, at = Number("float32", order=order), FIRST_REAL
        values: dict[str, list[float]] = {}
        for name, count in REALS.items():
            values[name] = [real.read(registers[place : place + 2]) for place in range(at, at + 2 * count, 2)]
            at += 2 * count
        return TelemetryBlock(join(registers[:2], order), signed(registers[2], 16), **values)

    def write(self, order: str = LOW_FIRST) -> list[int]:
        """Its 37 registers."""
        real = Number("float32", order=order)
        registers = split(self.life_counter, order) + [self.override & 0xFFFF]
        for name in REALS:
            for value in getattr(self, name):
                registers += real.write(value)
        return registers


@dataclass(frozen=True)
class Sample:
    """What a block says beside the one before: ns since the first, runs that were missed, rates by the controller's own time."""

    time: int
    missed: int
    orientation: list[float]
    velocity: list[float]
    quaternion_rate: list[float]


class Track:
    """Blocks as they are read (FM-23, FM-24)."""

    def __init__(self) -> None:
        self.last: tuple[TelemetryBlock, int] | None = None  # and its time

    def add(self, block: TelemetryBlock) -> Sample | str:
        """A sample; or `first`, `repeated` or `restarted`."""
        if self.last is None:
            self.last = block, 0
            return "first"
        last, time = self.last
        step = (block.life_counter - last.life_counter) % 2**32
        if step == 0:
            return "repeated"
        if step >= RESTARTED:
            self.last = block, 0
            return "restarted"
        quaternion = block.quaternion
        if sum(now * before for now, before in zip(quaternion, last.quaternion)) < 0:
            quaternion = [-value for value in quaternion]
        time += step * PERIOD
        self.last = replace(block, quaternion=quaternion), time
        seconds = step * PERIOD / 1e9

        def rate(now: list[float], before: list[float]) -> list[float]:
            return [(a - b) / seconds for a, b in zip(now, before)]

        rates = rate(block.position, last.position), rate(quaternion, last.quaternion)
        return Sample(time, step - 1, quaternion, *rates)
