"""Poses for a picture, val2-viewer: reference/val2-viewer.md."""

from .codec import Decoder, encode

__all__ = ["Decoder", "encode"]
