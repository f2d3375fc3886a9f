"""ALTER, val2-alter: reference/val2-alter.md."""

from .codec import Decoder, Framing, encode
from .controller import Controller, ControllerConfig
from .host import Host, HostConfig
from .scale import PER_DEGREE, PER_MM, nearest_word, word

__all__ = ["Controller", "ControllerConfig", "Decoder", "Framing", "Host", "HostConfig", "PER_DEGREE", "PER_MM", "encode", "nearest_word", "word"]
