"""Modbus of fanuc-hmi-modbus: reference/fanuc-hmi-modbus.md."""

from .codec import Decoder, encode

__all__ = ["Decoder", "encode"]
