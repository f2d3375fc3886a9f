"""Messages of kawasaki-msg: reference/kawasaki-msg.md."""

from .codec import Decoder, encode
from .dialect import Dialect, Limits
from .robot import RecoveryLimits, Robot, RobotConfig

__all__ = ["Decoder", "Dialect", "Limits", "RecoveryLimits", "Robot", "RobotConfig", "encode"]
