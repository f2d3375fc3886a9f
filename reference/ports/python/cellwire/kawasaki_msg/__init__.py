"""Messages of kawasaki-msg: reference/kawasaki-msg.md."""

from .codec import Decoder, encode

__all__ = ["Decoder", "encode"]
