"""The laser of laser-eb90: reference/laser-eb90.md."""

from .codec import Decoder, Profile, encode
from .host import Host, HostConfig

__all__ = ["Decoder", "Host", "HostConfig", "Profile", "encode"]
