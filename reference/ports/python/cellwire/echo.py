"""Lines that return what is sent, as adapters for two wires often do (FM-88, IB-41, LE-113, VV-42 of the reference)."""

from .stream import Json

# The bytes of noise that an adapter may give before a frame that comes back.
MAX_NOISE = 2


class Echo:
    """Takes out of the input of a connection what the line returns of the output."""

    def __init__(self, is_set: bool) -> None:
        self.returns = is_set  # the line returns what is sent
        self.frame = b""  # the last frame, if it is compared or looked for
        self.come = b""  # since it was sent, as far as it may be the frame

    def sent(self, frame: bytes, is_proof: bool) -> None:
        """A frame is sent. `is_proof`: no answer to it begins with the same bytes."""
        self.frame, self.come = frame if self.returns or is_proof else b"", b""

    def receive(self, data: bytes) -> tuple[bytes, Json | None]:
        """The bytes that have come, without the line's own; and what is wrong, once for a frame."""
        return self.compare(data) if self.returns else self.look(data)

    def compare(self, data: bytes) -> tuple[bytes, Json | None]:
        """FM-88, IB-41, LE-113, VV-42"""
        before, size = len(self.come), len(self.frame) - len(self.come)
        self.come += data[:size]
        differing = [at for at, pair in enumerate(zip(self.frame, self.come, strict=False)) if pair[0] != pair[1]]
        if not differing or differing[0] < before:
            return data[size:], None
        at = differing[0]
        return data[size:], {"kind": "collision", "offset": at, "expected": self.frame[at], "found": self.come[at]}

    def look(self, data: bytes) -> tuple[bytes, Json | None]:
        """FM-92, IB-42, LE-114, VV-43"""
        length, before = len(self.frame), len(self.come)
        self.come = (self.come + data)[: length + MAX_NOISE]
        noise = self.come.find(self.frame)
        if length == 0 or noise < 0:
            return data, None
        self.returns, self.frame, self.come = True, b"", b""
        return data[noise + length - before :], {"kind": "not_set", "length": length}
