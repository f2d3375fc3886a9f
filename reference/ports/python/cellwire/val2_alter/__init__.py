"""ALTER, val2-alter: reference/val2-alter.md."""

from .codec import Decoder, Framing, encode
from .controller import Controller, ControllerConfig
from .host import Host, HostConfig

__all__ = ["Controller", "ControllerConfig", "Decoder", "Framing", "Host", "HostConfig", "encode"]
