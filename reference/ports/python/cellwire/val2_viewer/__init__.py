"""Poses for a picture, val2-viewer: reference/val2-viewer.md."""

from .codec import Decoder, encode
from .host import Host, HostConfig
from .workstation import Workstation, WorkstationConfig

__all__ = ["Decoder", "Host", "HostConfig", "Workstation", "WorkstationConfig", "encode"]
