"""The ball of isra-ball: reference/isra-ball.md."""

from .codec import Decoder, encode

__all__ = ["Decoder", "encode"]
