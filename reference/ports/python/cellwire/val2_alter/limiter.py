"""The limiter of val2-alter's host: section 7.5 of reference/val2-alter.md."""

from dataclasses import dataclass, field
from math import isqrt

from .codec import AXES

LOWEST, HIGHEST = -0x8000, 0x7FFF


def clamp(value: int, low: int, high: int) -> int:
    return max(low, min(value, high))


@dataclass
class Limiter:
    """How each axis moves, in units of a word and a cycle."""

    velocity: list[int]
    acceleration: list[int]
    speed: list[int] = field(default_factory=lambda: [0] * AXES)
    position: list[int] = field(default_factory=lambda: [0] * AXES)

    def copy(self) -> "Limiter":
        return Limiter(self.velocity, self.acceleration, self.speed[:], self.position[:])

    def step(self, axis: int, wanted: int) -> int:
        """The speed of this cycle on the way to the wanted one."""
        v, a, speed = self.velocity[axis], self.acceleration[axis], self.speed[axis]
        self.speed[axis] = clamp(clamp(wanted, -v, v), speed - a, speed + a)
        return self.speed[axis]

    def speeds(self, target: list[int]) -> list[int]:
        """Cumulative values."""
        return [self.step(axis, target[axis]) for axis in range(AXES)]

    def positions(self, target: list[int] | None) -> list[int]:
        """Non-cumulative values; without a target the axes brake, and stay where that ends."""
        for axis in range(AXES):
            way = 0 if target is None else target[axis] - self.position[axis]
            wanted = self.braking(axis, abs(way)) * (1 if way >= 0 else -1)
            self.move(axis, self.step(axis, wanted))
        return self.position[:]

    def move(self, axis: int, way: int) -> None:
        """Moves as far as a word goes."""
        before = self.position[axis]
        self.position[axis] = clamp(before + way, LOWEST, HIGHEST)
        self.speed[axis] = self.position[axis] - before

    def braking(self, axis: int, way: int) -> int:
        """The highest speed from which the axis stops within `way`, this cycle's move included."""
        a = self.acceleration[axis]
        if a == 0:
            return 0
        n = (isqrt(8 * (way // a) + 1) - 1) // 2
        rest = (way - a * n * (n + 1) // 2) // (n + 1)
        return n * a + rest

    def rejected(self) -> None:
        """The controller did not read the reply."""
        for axis in range(AXES):
            self.position[axis] = clamp(self.position[axis] - self.speed[axis], LOWEST, HIGHEST)
        self.missed()

    def missed(self) -> None:
        """No reply was sent."""
        self.speed = [0] * AXES

    def hold(self, axis: int) -> None:
        """AL-65"""
        self.speed[axis] = self.position[axis] = 0

    def is_at_rest(self) -> bool:
        return not any(self.speed)
