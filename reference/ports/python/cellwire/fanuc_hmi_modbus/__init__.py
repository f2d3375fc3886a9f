"""Modbus of fanuc-hmi-modbus: reference/fanuc-hmi-modbus.md."""

from .block import BLOCK_LEN, Sample, TelemetryBlock, Track
from .client import Client, ClientConfig
from .codec import Decoder, encode
from .registers import Refusal, Registers
from .server import Server, ServerConfig
from .signals import place_of, signal_at
from .typed import Number, Slot, assign, read_text, write_text

__all__ = [
    "BLOCK_LEN",
    "Client",
    "ClientConfig",
    "Decoder",
    "Number",
    "Refusal",
    "Registers",
    "Sample",
    "Server",
    "ServerConfig",
    "Slot",
    "TelemetryBlock",
    "Track",
    "assign",
    "encode",
    "place_of",
    "read_text",
    "signal_at",
    "write_text",
]
