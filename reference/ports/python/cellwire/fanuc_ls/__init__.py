"""LS programs, fanuc-ls: reference/fanuc-ls.md."""

from .read import Document, decode, read_program
from .write import encode

__all__ = ["Document", "decode", "encode", "read_program"]
