"""Modbus of fanuc-hmi-modbus: reference/fanuc-hmi-modbus.md."""

from .client import Client, ClientConfig
from .codec import Decoder, encode
from .registers import Refusal, Registers
from .server import Server, ServerConfig

__all__ = ["Client", "ClientConfig", "Decoder", "Refusal", "Registers", "Server", "ServerConfig", "encode"]
