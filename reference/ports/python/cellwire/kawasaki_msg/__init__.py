"""Messages of kawasaki-msg: reference/kawasaki-msg.md."""

from .codec import Decoder, encode
from .config import PcConfig, RecoveryLimits, RobotConfig
from .dialect import Dialect, Limits
from .pc import Pc
from .robot import Robot

__all__ = ["Decoder", "Dialect", "Limits", "Pc", "PcConfig", "RecoveryLimits", "Robot", "RobotConfig", "encode"]
