"""Lines of mmacell-proto: reference/mmacell-proto.md."""

from .central import Central, CentralConfig
from .codec import Decoder, Dialect, encode

__all__ = ["Central", "CentralConfig", "Decoder", "Dialect", "encode"]
