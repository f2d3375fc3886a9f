"""Poses in units of their last digits: µm, and 0.1 mrad."""

from collections.abc import Sequence

from . import codec

Pose = tuple[int, ...]


def decimals_of(axes: Sequence[float]) -> tuple[int, ...]:
    """The decimals of each axis: a robot has four, a platform two."""
    return codec.ROBOT if len(axes) == len(codec.ROBOT) else codec.PLATFORM


def counts(axes: Sequence[float]) -> Pose:
    """Axes in their last digits."""
    return tuple(round(axis * 10**digits) for axis, digits in zip(axes, decimals_of(axes)))


def axes(pose: Pose) -> list[float]:
    """Millimetres and radians."""
    return [count / 10**digits for count, digits in zip(pose, decimals_of(pose))]


def added(pose: Pose, way: Pose) -> Pose | None:
    """The sum, if it fits the fields."""
    total = tuple(here + there for here, there in zip(pose, way))
    return total if all(abs(axis) <= codec.MAX_COORDINATE for axis in total) else None
