"""The ball of isra-ball: reference/isra-ball.md."""

from .ball import Ball, BallConfig
from .codec import Decoder, encode
from .host import Host, HostConfig

__all__ = ["Ball", "BallConfig", "Decoder", "Host", "HostConfig", "encode"]
