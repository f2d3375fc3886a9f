"""ALTER, val2-alter: reference/val2-alter.md."""

from .codec import Decoder, Framing, encode
from .host import Host, HostConfig

__all__ = ["Decoder", "Framing", "Host", "HostConfig", "encode"]
