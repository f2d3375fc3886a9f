"""Drivers for programs without an event loop: a session runs while its owner waits for an event.

    with Line(session, Tcp("192.168.0.7", 502)) as line:
        line.do(session.request, {"unit": 1, "function": 3, "address": 0, "quantity": 37})
        print(line.next(timeout=2.0))
"""

import importlib
import select
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from .line import Core, P, R, S, shortest
from .stream import Json

READ_SIZE = 4096
CONNECT_TIMEOUT = 5.0
MOST_READS = 64  # without a look at the clock
NAP = 0.1  # the longest sleep where nothing wakes


class Stream(Protocol):
    """An open connection or port. Whatever ends it is an OSError."""

    def receive(self, timeout: float | None) -> bytes:
        """What has come, at the latest after `timeout` seconds; empty: nothing."""

    def send(self, data: bytes) -> bool:
        """Writes everything; whether the last byte is known to have left."""

    def close(self) -> None: ...


class Transport(Protocol):
    """Makes connections, one after the other."""

    def open(self, timeout: float | None) -> Stream | None:
        """A connection; None: nobody has come within `timeout` seconds."""

    def close(self) -> None: ...


class Socket:
    """A TCP connection; `listener`: another client takes its place."""

    def __init__(self, connection: socket.socket, listener: socket.socket | None = None) -> None:
        self.connection, self.listener = connection, listener
        connection.settimeout(None)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, timeout: float | None) -> bytes:
        watched = [self.connection] + ([self.listener] if self.listener else [])
        ready, _, _ = select.select(watched, [], [], timeout)
        if self.connection in ready:
            data = self.connection.recv(READ_SIZE)
            if not data:
                raise ConnectionResetError("the peer has closed the connection")
            return data
        if ready:
            raise ConnectionResetError("another client takes the place of this one")
        return b""

    def send(self, data: bytes) -> bool:
        self.connection.sendall(data)
        return False

    def close(self) -> None:
        self.connection.close()


class Tcp:
    """Connects to an address."""

    def __init__(self, host: str, port: int) -> None:
        self.address = (host, port)

    def open(self, timeout: float | None) -> Stream | None:
        return Socket(socket.create_connection(self.address, CONNECT_TIMEOUT))

    def close(self) -> None:
        pass


class Listen:
    """Waits for clients at an address, one at a time; port 0 is any free one."""

    def __init__(self, host: str, port: int) -> None:
        self.listener = socket.create_server((host, port))
        self.port: int = self.listener.getsockname()[1]

    def open(self, timeout: float | None) -> Stream | None:
        ready, _, _ = select.select([self.listener], [], [], timeout)
        return Socket(self.listener.accept()[0], self.listener) if ready else None

    def close(self) -> None:
        self.listener.close()


class Port:
    """A serial port of pyserial."""

    def __init__(self, port: Any) -> None:
        self.port = port

    def receive(self, timeout: float | None) -> bytes:
        self.port.timeout = timeout
        return bytes(self.port.read(1) + self.port.read(self.port.in_waiting))

    def send(self, data: bytes) -> bool:
        self.port.write(data)
        self.port.flush()
        return True

    def close(self) -> None:
        self.port.close()


class Serial:
    """Opens a serial port: a name or a URL of pyserial, a rate, and what else `serial_for_url` takes."""

    def __init__(self, name: str, baudrate: int, **settings: Any) -> None:
        self.name, self.settings = name, {"baudrate": baudrate, **settings}

    def open(self, timeout: float | None) -> Stream | None:
        return Port(importlib.import_module("serial").serial_for_url(self.name, **self.settings))

    def close(self) -> None:
        pass


class Line(Core[S]):
    """A session over a transport: reconnected automatically, after growing pauses."""

    def __init__(self, session: S, transport: Transport) -> None:
        super().__init__(session)
        self.transport = transport
        self.stream: Stream | None = None

    def __enter__(self) -> "Line[S]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection, and makes no other."""
        self.drop()
        self.transport.close()

    def drop(self) -> None:
        if self.stream is not None:
            self.stream.close()
            self.stream = None
            self.closed()

    def __iter__(self) -> Iterator[Json]:
        while True:
            yield self.next()

    def next(self, timeout: float | None = None) -> Json:
        """The next event; raises TimeoutError after so many seconds."""
        ends = None if timeout is None else time.monotonic() + timeout
        while not self.taken:
            left = None if ends is None else ends - time.monotonic()
            if left is not None and left < 0:
                raise TimeoutError("no event")
            self.step(left)
        return self.taken.popleft()

    def do(self, call: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """A call of the session; what it is to send goes out at once."""
        result = super().do(call, *args, **kwargs)
        self.guard(self.send)
        return result

    def step(self, timeout: float | None) -> None:
        """What is due, and whatever comes within `timeout` seconds, or until the next deadline."""
        wait = shortest(timeout, self.wait())
        if self.stream is None:
            self.connect(wait)
        elif not self.session.wants_input():
            time.sleep(shortest(wait, NAP) or 0)
        else:
            self.guard(lambda: self.receive(wait))
        self.expire()
        self.guard(self.send)

    def connect(self, wait: float | None) -> None:
        if (rest := self.rest()) != 0:
            time.sleep(shortest(wait, rest, NAP) or 0)
            return
        try:
            self.stream = self.transport.open(wait)
        except OSError:
            self.closed()
            return
        if self.stream is not None:
            self.opened()

    def receive(self, wait: float | None) -> None:
        """Everything that has come is read before time passes."""
        for _ in range(MOST_READS):
            if self.stream is None or not (data := self.stream.receive(wait)):
                return
            self.received(data)
            wait = 0
            if not self.session.wants_input():
                return

    def send(self) -> None:
        for data in self.due():
            if self.stream is not None and self.stream.send(data):
                self.session.transmitted(self.now())
        if self.has_closed:
            self.drop()

    def guard(self, action: Callable[[], None]) -> None:
        """Does it; what ends the connection is no error of the owner's."""
        try:
            action()
        except OSError:
            self.drop()
