"""The laser of laser-eb90: reference/laser-eb90.md."""

from .codec import Decoder, Profile, encode
from .controller import Controller, ControllerConfig
from .host import Host, HostConfig

__all__ = ["Controller", "ControllerConfig", "Decoder", "Host", "HostConfig", "Profile", "encode"]
