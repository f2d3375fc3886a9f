"""Lines of mmacell-proto: reference/mmacell-proto.md."""

from .central import Central, CentralConfig
from .codec import Decoder, Dialect, encode
from .device import Device, DeviceConfig

__all__ = ["Central", "CentralConfig", "Decoder", "Device", "DeviceConfig", "Dialect", "encode"]
