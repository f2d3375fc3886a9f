"""Modbus of fanuc-hmi-modbus: reference/fanuc-hmi-modbus.md."""

from .client import Client, ClientConfig
from .codec import Decoder, encode

__all__ = ["Client", "ClientConfig", "Decoder", "encode"]
