"""Messages of kawasaki-msg: reference/kawasaki-msg.md."""

from .codec import Decoder, encode
from .dialect import Dialect, Limits
from .pc import Pc, PcConfig
from .robot import RecoveryLimits, Robot, RobotConfig

__all__ = ["Decoder", "Dialect", "Limits", "Pc", "PcConfig", "RecoveryLimits", "Robot", "RobotConfig", "encode"]
